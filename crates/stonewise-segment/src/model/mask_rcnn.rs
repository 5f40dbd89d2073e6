//! The whole model: a photo in, stones out.

use super::activation::{sigmoid, softmax};
use super::anchors::anchors;
use super::backbone::{Backbone, channels};
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
    backbone: Backbone,
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
    /// A model with random weights; equal seeds give equal weights.
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
            backbone: Backbone::new(init, config, seed),
            fpn: Fpn::new(init, channels(&config.backbone), config.fpn_channels, norm),
            rpn: Rpn::new(
                init,
                config.fpn_channels,
                shapes,
                norm.filter(|_| !config.plain_proposals),
            ),
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
        self.backbone.takes_relief()
    }

    /// All parameters, to be changed.
    pub(crate) fn parameters(&mut self) -> Parameters<'_> {
        let mut found = Vec::new();
        self.backbone.parameters("backbone", &mut found);
        self.fpn.parameters("backbone.fpn", &mut found);
        self.rpn.parameters("rpn", &mut found);
        self.roi_heads.parameters("roi_heads", &mut found);
        found
    }

    /// Prepares the model for fast inference: moves stored statistics into the convolutions, and keeps their weights in
    /// the form that is fastest in use. The model can then neither be trained nor saved under torchvision's names.
    #[must_use]
    pub fn for_inference(mut self) -> Self {
        self.backbone.prepare();
        self.fpn.prepare();
        self.rpn.prepare();
        self.roi_heads.prepare();
        self
    }

    /// Leaves out stones that score less than `score`; no masks are computed for them.
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
        let instances = self.instances(image, relief).into_iter();
        instances
            .filter(|i| has_contrast(image, i.bounds))
            .map(|i| self.pasted(&i, image))
            .collect()
    }

    /// The stones that boxes of an image hold, one a box, in their order: what the heads say of regions that
    /// a person gives instead of the proposal network.
    ///
    /// `boxes`: left, top, right, bottom, pixels. The box head fits each to its stone before the mask is
    /// drawn; the score is the probability that there is one.
    pub fn outline(&self, image: &RgbImage, relief: Option<&ReliefMap>, boxes: &[Bounds]) -> Vec<Detection> {
        let (seen, sight) = self.look_at(image, relief);
        let [sx, sy] = seen.scale;
        let regions: Vec<Bounds> = boxes
            .iter()
            .map(|[left, top, right, bottom]| [left * sx, top * sy, right * sx, bottom * sy])
            .collect();
        let judged = self.judged(&sight.rows, &regions, seen);
        let best = |of_region: &[Instance]| {
            of_region
                .iter()
                .max_by(|a, b| a.score.total_cmp(&b.score))
                .cloned()
        };
        let mut found: Vec<Instance> = judged.chunks(self.config.classes - 1).filter_map(best).collect();
        self.draw(&sight.rows, &mut found, seen, image);
        found.iter().map(|i| self.pasted(i, image)).collect()
    }

    /// An object with its mask in the pixels of the image.
    fn pasted(&self, instance: &Instance, image: &RgbImage) -> Detection {
        let size = [image.width(), image.height()];
        let cells = 2 * self.config.roi.mask_cells;
        Detection {
            bounds: instance.bounds,
            score: instance.score,
            mask: paste_mask(&instance.mask, cells, instance.bounds, size),
        }
    }

    /// The objects of an image, best score first, their masks still on the model's grid.
    pub fn instances(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> Vec<Instance> {
        let (seen, sight) = self.look_at(image, relief);
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
        self.draw(&sight.rows, &mut found, seen, image);
        found
    }

    /// One image at the size of the model.
    fn look_at(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> (Seen, Sight) {
        let seen = Seen::new(image, self.config.resize);
        let images = batch(&[image], &[seen], &self.config);
        (seen, self.look(&images, &[relief], &[seen]))
    }

    /// Gives objects their masks, and bounds in pixels of the image instead of the model's.
    fn draw(&self, rows: &FeatureRows, found: &mut [Instance], seen: Seen, image: &RgbImage) {
        if found.is_empty() {
            return;
        }
        let regions: Vec<_> = found.iter().map(|instance| (0, instance.bounds)).collect();
        let masks = self
            .roi_heads
            .masks(rows.cut(&regions, &self.align(self.config.roi.mask_cells)));
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
    }

    /// Looks at images [batch, 3, rows, columns] and their relief.
    pub(super) fn look(&self, images: &Tensor, relief: &[Option<&ReliefMap>], seen: &[Seen]) -> Sight {
        let [_, _, rows, columns] = images.dims();
        let levels = self.levels(images, relief, seen);
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

    /// Levels of the feature pyramid of images [batch, 3, rows, columns] and their relief.
    pub(super) fn levels(
        &self,
        images: &Tensor,
        relief: &[Option<&ReliefMap>],
        seen: &[Seen],
    ) -> Vec<Tensor> {
        let [_, _, rows, columns] = images.dims();
        let present: Vec<bool> = relief.iter().map(Option::is_some).collect();
        let relief = if self.takes_relief() {
            relief_batch(relief, seen, [columns, rows], self.backbone.relief_step())
        } else {
            None
        };
        self.fpn
            .forward(self.backbone.forward(images, relief.as_ref(), &present))
    }

    /// The objects in regions of one image, best first, without masks; bounds in pixels of the model.
    fn classify(&self, rows: &FeatureRows, regions: &[Bounds], seen: Seen) -> Vec<Instance> {
        let mut found = self.judged(rows, regions, seen);
        found.retain(|i| i.score > self.config.score_threshold && is_large(i.bounds, MIN_SIDE));
        let bounds: Vec<Bounds> = found.iter().map(|i| i.bounds).collect();
        let scores: Vec<f32> = found.iter().map(|i| i.score).collect();
        let classes: Vec<usize> = found.iter().map(|i| i.class).collect();
        let best = suppress(&bounds, &scores, &classes, self.config.nms_iou).into_iter();
        best.take(self.config.detections)
            .map(|place| found[place].clone())
            .collect()
    }

    /// What the box head says of regions of one image: for each region every class but the background, without
    /// masks; bounds in pixels of the model.
    fn judged(&self, rows: &FeatureRows, regions: &[Bounds], seen: Seen) -> Vec<Instance> {
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
        let judge = |(region, &reference): (usize, &Bounds)| {
            (1..classes).map(move |class| (region * classes + class, class, reference))
        };
        let instance = |(place, class, reference): (usize, usize, Bounds)| {
            let offset = &offsets[4 * place..][..4];
            let offset = [offset[0], offset[1], offset[2], offset[3]];
            Instance {
                bounds: clip(decode(reference, offset, HEAD_WEIGHTS), width, height),
                class,
                score: scores[place],
                mask: Vec::new(),
            }
        };
        regions.iter().enumerate().flat_map(judge).map(instance).collect()
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

/// Selects from masks [regions, classes, rows, columns] those of given (region, class): [pairs, rows, columns].
pub(super) fn of_classes(masks: Tensor, pairs: impl Iterator<Item = (usize, usize)>) -> Tensor {
    let [regions, classes, rows, columns] = masks.dims();
    let places = pairs.map(|(region, class)| region * classes + class);
    masks
        .reshaped([regions * classes, rows, columns])
        .selected(places.collect())
}
