//! The heads that look at one region each: class and box (Girshick 2015), mask (He et al. 2017, figure 4).

use super::config::MaskRcnnConfig;
use super::init::Init;
use super::kernels::ModelBackend;
use super::layers::{Conv, ConvBlock, Doubling, Linear, Spread, assembled};
use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;
use burn::tensor::backend::Backend;

/// Both heads.
#[derive(Module, Debug)]
pub struct RoiHeads<B: Backend> {
    box_head: BoxHead<B>,
    box_predictor: BoxPredictor<B>,
    mask_head: Vec<ConvBlock<B>>,
    mask_predictor: MaskPredictor<B>,
}

#[derive(Module, Debug)]
struct BoxHead<B: Backend> {
    fc6: Linear<B>,
    fc7: Linear<B>,
}

#[derive(Module, Debug)]
struct BoxPredictor<B: Backend> {
    cls_score: Linear<B>,
    bbox_pred: Linear<B>,
}

#[derive(Module, Debug)]
struct MaskPredictor<B: Backend> {
    conv5_mask: Doubling<B>,
    mask_fcn_logits: Conv<B>,
}

impl<B: ModelBackend> RoiHeads<B> {
    pub fn new(init: &mut Init<B>, config: &MaskRcnnConfig) -> Self {
        let features = config.fpn_channels * config.roi.box_cells * config.roi.box_cells;
        let hidden = config.roi.box_hidden;
        let norm = config.head_norm();
        let mut channels = config.fpn_channels;
        let box_head = BoxHead {
            fc6: Linear::new(init, [features, hidden]),
            fc7: Linear::new(init, [hidden, hidden]),
        };
        let box_predictor = BoxPredictor {
            cls_score: Linear::new(init, [hidden, config.classes]),
            bbox_pred: Linear::new(init, [hidden, 4 * config.classes]),
        };
        let mut mask_head = Vec::with_capacity(config.roi.mask_channels.len());
        for &outputs in &config.roi.mask_channels {
            mask_head.push(ConvBlock::new(
                init,
                [channels, outputs],
                3,
                Spread::KaimingNormal,
                norm,
            ));
            channels = outputs;
        }
        let mask_predictor = MaskPredictor {
            conv5_mask: Doubling::new(init, [channels, channels]),
            mask_fcn_logits: Conv::new(
                init,
                [channels, config.classes],
                1,
                1,
                Spread::KaimingNormal,
                true,
            ),
        };
        Self {
            box_head,
            box_predictor,
            mask_head,
            mask_predictor,
        }
    }

    /// Class logits [regions, classes] and box offsets [regions, 4 classes] of regions [regions, channels,
    /// cells, cells].
    pub fn boxes(&self, regions: Tensor<B, 4>) -> (Tensor<B, 2>, Tensor<B, 2>) {
        let x = relu(self.box_head.fc6.forward(regions.flatten(1, 3)));
        let x = relu(self.box_head.fc7.forward(x));
        (
            self.box_predictor.cls_score.forward(x.clone()),
            self.box_predictor.bbox_pred.forward(x),
        )
    }

    /// Mask logits [regions, classes, 2 cells, 2 cells] of regions [regions, channels, cells, cells].
    pub fn masks(&self, regions: Tensor<B, 4>) -> Tensor<B, 4> {
        let x = self
            .mask_head
            .iter()
            .fold(regions, |x, block| relu(block.forward(x)));
        let x = relu(self.mask_predictor.conv5_mask.forward(x));
        assembled(self.mask_predictor.mask_fcn_logits.forward(x))
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.mask_head.iter_mut().for_each(ConvBlock::prepare);
    }
}
