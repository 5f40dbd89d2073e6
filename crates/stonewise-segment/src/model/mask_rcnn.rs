//! The whole model: a photo in, stones out.

use super::activation::{sigmoid, softmax};
use super::anchors::anchors;
use super::boxes::{Bounds, HEAD_WEIGHTS, clip, decode, is_large};
use super::config::{ConfigError, MaskRcnnConfig};
use super::contrast::has_contrast;
use super::fpn::Fpn;
use super::heads::RoiHeads;
use super::init::Init;
use super::nms::suppress;
use super::parameter::Parameters;
use super::paste::paste_mask;
use super::preprocess::{Seen, batch, relief_batch};
use super::resnet::{Resnet, channels};
use super::roi_align::{FeatureRows, RoiAlign};
use super::rpn::{AnchorScores, Rpn, proposals};
use crate::Detection;
use crate::engine::Tensor;
use stonewise_core::raster::{ReliefMap, RgbImage};

/// Shorter sides make no detection, pixels.
const MIN_SIDE: f32 = 1e-2;

/// Mask R-CNN. Its parameters have torchvision's names.
#[derive(Clone, Debug)]
pub struct MaskRcnn {
    body: Resnet,
    fpn: Fpn,
    rpn: Rpn,
    pub(super) roi_heads: RoiHeads,
    pub(super) config: MaskRcnnConfig,
}

/// One object found, before its mask is drawn into the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Left, top, right, bottom, pixels of the image.
    pub bounds: Bounds,
    /// Class, 1 or more.
    pub class: usize,
    /// Probability of the class.
    pub score: f32,
    /// Probability of belonging to the object in a square grid stretched over the bounds, row by row.
    pub mask: Vec<f32>,
}

/// What the model sees in images: features at all scales and the scores and shifts of the proposal network.
pub(super) struct Sight {
    pub rows: FeatureRows,
    pub scores: AnchorScores,
    pub anchors: Vec<Vec<Bounds>>,
}

impl MaskRcnn {
    /// A model with random weights, the same for the same seed.
    ///
    /// # Errors
    /// The configuration makes no sense.
    pub fn init(config: &MaskRcnnConfig, seed: u64) -> Result<Self, ConfigError> {
        Self::build(config, Some(seed))
    }

    /// A model of zeros, to [load weights](super::load_weights) into.
    ///
    /// # Errors
    /// The configuration makes no sense.
    pub fn zeros(config: &MaskRcnnConfig) -> Result<Self, ConfigError> {
        Self::build(config, None)
    }

    fn build(config: &MaskRcnnConfig, seed: Option<u64>) -> Result<Self, ConfigError> {
        config.check()?;
        let init = &mut Init::new(seed);
        let shapes = config.anchors.sizes[0].len() * config.anchors.aspect_ratios.len();
        let norm = config.head_norm();
        Ok(Self {
            body: Resnet::new(init, &config.backbone, config.relief_channels),
            fpn: Fpn::new(init, channels(&config.backbone), config.fpn_channels, norm),
            rpn: Rpn::new(init, config.fpn_channels, shapes, norm),
            roi_heads: RoiHeads::new(init, config),
            config: config.clone(),
        })
    }

    /// What the model looks like.
    pub fn config(&self) -> &MaskRcnnConfig {
        &self.config
    }

    /// Whether relief makes a difference.
    pub fn takes_relief(&self) -> bool {
        self.body.takes_relief()
    }

    /// All parameters, to be changed.
    pub(crate) fn parameters(&mut self) -> Parameters<'_> {
        let mut found = Vec::new();
        self.body.parameters("backbone.body", &mut found);
        self.fpn.parameters("backbone.fpn", &mut found);
        self.rpn.parameters("rpn", &mut found);
        self.roi_heads.parameters("roi_heads", &mut found);
        found
    }

    /// The same model, faster: stored statistics are moved into the convolutions, and their weights are kept
    /// in the form that is fastest in use. It can neither be trained nor saved under torchvision's names.
    #[must_use]
    pub fn for_inference(mut self) -> Self {
        self.body.prepare();
        self.fpn.prepare();
        self.rpn.prepare();
        self.roi_heads.prepare();
        self
    }

    /// The same model without what scores less; this costs no time for masks then.
    #[must_use]
    pub fn with_min_score(mut self, score: f32) -> Self {
        let threshold = &mut self.config.score_threshold;
        // The model keeps scores above its threshold; a stone that scores just this much stays.
        *threshold = threshold.max(score.next_down());
        self
    }

    /// The stones of an image, best score first; none where the image shows neither an edge nor a texture.
    /// `relief`: that of the whole image, at any resolution.
    pub fn detect(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> Vec<Detection> {
        let size = [image.width(), image.height()];
        let detection = |instance: Instance| Detection {
            bounds: instance.bounds,
            score: instance.score,
            mask: paste_mask(
                &instance.mask,
                2 * self.config.roi.mask_cells,
                instance.bounds,
                size,
            ),
        };
        let instances = self.instances(image, relief).into_iter();
        instances
            .filter(|i| has_contrast(image, i.bounds))
            .map(detection)
            .collect()
    }

    /// The objects of an image, best score first, their masks still on the model's grid.
    pub fn instances(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> Vec<Instance> {
        let seen = Seen::new(image, self.config.resize);
        let images = batch(&[image], &[seen], &self.config);
        let sight = self.look(&images, &[relief], &[seen]);
        let [before, after] = [
            self.config.proposals.before_nms[1],
            self.config.proposals.after_nms[1],
        ];
        let regions = proposals(
            sight.scores.objectness.values(),
            sight.scores.offsets.values(),
            &sight.anchors,
            seen.extent(),
            [before, after],
            &self.config.proposals,
        );
        let mut found = self.classify(&sight.rows, &regions, seen);
        if found.is_empty() {
            return found;
        }
        let regions: Vec<_> = found.iter().map(|instance| (0, instance.bounds)).collect();
        let masks = self
            .roi_heads
            .masks(sight.rows.cut(&regions, &self.align(self.config.roi.mask_cells)));
        let classes = found.iter().map(|instance| instance.class).enumerate();
        let masks = of_classes(masks, classes);
        let cells = masks.values().len() / found.len();
        let [sx, sy] = seen.scale;
        for (instance, mask) in found.iter_mut().zip(masks.values().chunks(cells)) {
            instance.mask = mask.iter().map(|logit| sigmoid(*logit)).collect();
            let [left, top, right, bottom] = instance.bounds;
            let bounds = [left / sx, top / sy, right / sx, bottom / sy];
            instance.bounds = clip(bounds, image.width() as f32, image.height() as f32);
        }
        found
    }

    /// Looks at images [batch, 3, rows, columns] and their relief.
    pub(super) fn look(&self, images: &Tensor, relief: &[Option<&ReliefMap>], seen: &[Seen]) -> Sight {
        let [_, _, rows, columns] = images.dims();
        let relief = if self.takes_relief() {
            relief_batch(relief, seen, [columns, rows])
        } else {
            None
        };
        let levels = self.fpn.forward(self.body.forward(images, relief.as_ref()));
        let grid = |level: &Tensor| {
            let [_, _, rows, columns] = level.dims();
            [columns, rows]
        };
        let grids: Vec<[usize; 2]> = levels.iter().map(grid).collect();
        Sight {
            rows: FeatureRows::new(&levels),
            scores: self.rpn.forward(&levels),
            anchors: anchors(&self.config.anchors, [columns, rows], &grids),
        }
    }

    /// The objects in regions of one image, best first, without masks; bounds in pixels of the model.
    fn classify(&self, rows: &FeatureRows, regions: &[Bounds], seen: Seen) -> Vec<Instance> {
        if regions.is_empty() {
            return Vec::new();
        }
        let [width, height] = seen.extent();
        let indexed: Vec<_> = regions.iter().map(|&bounds| (0, bounds)).collect();
        let (logits, offsets) = self
            .roi_heads
            .boxes(rows.cut(&indexed, &self.align(self.config.roi.box_cells)));
        let classes = self.config.classes;
        let scores: Vec<f32> = logits.values().chunks(classes).flat_map(softmax).collect();
        let offsets = offsets.values();
        let (mut boxes, mut kept_scores, mut kept_classes) = (Vec::new(), Vec::new(), Vec::new());
        for (region, &reference) in regions.iter().enumerate() {
            for class in 1..classes {
                let place = region * classes + class;
                let offset = &offsets[4 * place..][..4];
                let offset = [offset[0], offset[1], offset[2], offset[3]];
                let bounds = clip(decode(reference, offset, HEAD_WEIGHTS), width, height);
                if scores[place] > self.config.score_threshold && is_large(bounds, MIN_SIDE) {
                    boxes.push(bounds);
                    kept_scores.push(scores[place]);
                    kept_classes.push(class);
                }
            }
        }
        let best = suppress(&boxes, &kept_scores, &kept_classes, self.config.nms_iou);
        let instance = |place: usize| Instance {
            bounds: boxes[place],
            class: kept_classes[place],
            score: kept_scores[place],
            mask: Vec::new(),
        };
        best.into_iter()
            .take(self.config.detections)
            .map(instance)
            .collect()
    }

    /// How regions are cut into this number of cells along a side.
    pub(super) fn align(&self, cells: usize) -> RoiAlign {
        RoiAlign {
            cells,
            samples: self.config.roi.samples,
            half_pixel: self.config.roi.half_pixel,
        }
    }
}

/// Of masks [regions, classes, rows, columns] those of given (region, class): [pairs, rows, columns].
pub(super) fn of_classes(masks: Tensor, pairs: impl Iterator<Item = (usize, usize)>) -> Tensor {
    let [regions, classes, rows, columns] = masks.dims();
    let places = pairs.map(|(region, class)| region * classes + class);
    masks
        .reshaped([regions * classes, rows, columns])
        .selected(places.collect())
}
