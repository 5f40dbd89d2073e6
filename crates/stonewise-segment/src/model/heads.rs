//! The heads that look at one region each: class and box (Girshick 2015), mask (He et al. 2017, figure 4).

use super::config::MaskRcnnConfig;
use super::init::Init;
use super::layers::{Conv, ConvBlock, Doubling, Linear, Spread, assembled};
use super::parameter::{Parameters, part};
use crate::engine::Tensor;

/// Both heads.
#[derive(Clone, Debug)]
pub struct RoiHeads {
    fc6: Linear,
    fc7: Linear,
    cls_score: Linear,
    bbox_pred: Linear,
    mask_head: Vec<ConvBlock>,
    conv5_mask: Doubling,
    mask_fcn_logits: Conv,
}

impl RoiHeads {
    pub fn new(init: &mut Init, config: &MaskRcnnConfig) -> Self {
        let features = config.fpn_channels * config.roi.box_cells * config.roi.box_cells;
        let (hidden, classes) = (config.roi.box_hidden, config.classes);
        let (spread, norm) = (Spread::KaimingNormal, config.head_norm());
        let mut channels = config.fpn_channels;
        let fc6 = Linear::new(init, [features, hidden]);
        let fc7 = Linear::new(init, [hidden, hidden]);
        let cls_score = Linear::new(init, [hidden, classes]);
        let bbox_pred = Linear::new(init, [hidden, 4 * classes]);
        let mut mask_head = Vec::with_capacity(config.roi.mask_channels.len());
        for &outputs in &config.roi.mask_channels {
            mask_head.push(ConvBlock::new(init, [channels, outputs], 3, spread, norm));
            channels = outputs;
        }
        Self {
            fc6,
            fc7,
            cls_score,
            bbox_pred,
            mask_head,
            conv5_mask: Doubling::new(init, [channels, channels]),
            mask_fcn_logits: Conv::new(init, [channels, classes], 1, 1, spread, true),
        }
    }

    /// Class logits [regions, classes] and box offsets [regions, 4 classes] of regions [regions, channels,
    /// cells, cells].
    pub fn boxes(&self, regions: Tensor) -> (Tensor, Tensor) {
        let [count, channels, rows, columns] = regions.dims();
        let x = regions.reshaped([count, channels * rows * columns]);
        let x = self.fc6.forward(&x).relu();
        let x = self.fc7.forward(&x).relu();
        (self.cls_score.forward(&x), self.bbox_pred.forward(&x))
    }

    /// Mask logits [regions, classes, 2 cells, 2 cells] of regions [regions, channels, cells, cells].
    pub fn masks(&self, regions: Tensor) -> Tensor {
        let x = self
            .mask_head
            .iter()
            .fold(regions, |x, block| block.forward(x).relu());
        let x = self.conv5_mask.forward(x).relu();
        assembled(&self.mask_fcn_logits.forward(&x))
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.mask_head.iter_mut().for_each(ConvBlock::prepare);
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        let [boxes, classes, mask_head, masks] =
            ["box_head", "box_predictor", "mask_head", "mask_predictor"].map(|head| part(name, head));
        self.fc6.parameters(&part(&boxes, "fc6"), found);
        self.fc7.parameters(&part(&boxes, "fc7"), found);
        self.cls_score.parameters(&part(&classes, "cls_score"), found);
        self.bbox_pred.parameters(&part(&classes, "bbox_pred"), found);
        for (place, block) in self.mask_head.iter_mut().enumerate() {
            block.numbered_parameters(&part(&mask_head, place), found);
        }
        self.conv5_mask.parameters(&part(&masks, "conv5_mask"), found);
        self.mask_fcn_logits
            .parameters(&part(&masks, "mask_fcn_logits"), found);
    }
}
