//! The whole model: a photo in, stones out; labelled photos in, losses out.

use super::anchors::anchors;
use super::boxes::{Bounds, HEAD_WEIGHTS, PROPOSAL_WEIGHTS, clip, decode, encode, is_large};
use super::config::{ConfigError, MaskRcnnConfig};
use super::contrast::has_contrast;
use super::fpn::Fpn;
use super::heads::RoiHeads;
use super::init::Init;
use super::kernels::{ModelBackend, TrainBackend};
use super::losses::{Losses, binary_cross_entropy, cross_entropy, smooth_l1};
use super::matcher::match_boxes;
use super::nms::suppress;
use super::paste::paste_mask;
use super::preprocess::{Seen, batch, relief_batch};
use super::resnet::{Resnet, channels};
use super::roi_align::{FeatureRows, RoiAlign};
use super::rpn::{AnchorScores, Rpn, proposals};
use super::sampler::draw;
use super::targets::Targets;
use crate::{Detection, Detector, Sample};
use burn::module::Module;
use burn::tensor::activation::{sigmoid, softmax};
use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use stonewise_core::raster::{ReliefMap, RgbImage};

/// Shorter sides make no detection, pixels.
const MIN_SIDE: f32 = 1e-2;
/// Class of all stones of a [`Sample`].
const STONE: usize = 1;

/// Mask R-CNN. Its parameters have torchvision's names.
#[derive(Module, Debug)]
pub struct MaskRcnn<B: Backend> {
    backbone: Backbone<B>,
    rpn: Rpn<B>,
    roi_heads: RoiHeads<B>,
    #[module(skip)]
    config: MaskRcnnConfig,
}

#[derive(Module, Debug)]
struct Backbone<B: Backend> {
    body: Resnet<B>,
    fpn: Fpn<B>,
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
struct Sight<B: ModelBackend> {
    rows: FeatureRows<B>,
    scores: AnchorScores<B>,
    anchors: Vec<Vec<Bounds>>,
}

impl<B: ModelBackend> MaskRcnn<B> {
    /// A model with random weights, the same for the same seed.
    ///
    /// # Errors
    /// The configuration makes no sense.
    pub fn init(config: &MaskRcnnConfig, seed: u64, device: &B::Device) -> Result<Self, ConfigError> {
        Self::build(config, Some(seed), device)
    }

    /// A model of zeros, to [load weights](super::load_weights) into.
    ///
    /// # Errors
    /// The configuration makes no sense.
    pub fn zeros(config: &MaskRcnnConfig, device: &B::Device) -> Result<Self, ConfigError> {
        Self::build(config, None, device)
    }

    fn build(config: &MaskRcnnConfig, seed: Option<u64>, device: &B::Device) -> Result<Self, ConfigError> {
        config.check()?;
        let init = &mut Init::new(seed, device);
        let shapes = config.anchors.sizes[0].len() * config.anchors.aspect_ratios.len();
        let norm = config.head_norm();
        Ok(Self {
            backbone: Backbone {
                body: Resnet::new(init, &config.backbone, config.relief_channels),
                fpn: Fpn::new(init, channels(&config.backbone), config.fpn_channels, norm),
            },
            rpn: Rpn::new(init, config.fpn_channels, shapes, norm),
            roi_heads: RoiHeads::new(init, config),
            config: config.clone(),
        })
    }

    /// What the model looks like.
    pub fn config(&self) -> &MaskRcnnConfig {
        &self.config
    }

    /// The same model, faster: stored statistics are moved into the convolutions, and their weights are kept
    /// in the form that is fastest in use. It can neither be trained nor saved under torchvision's names.
    pub fn for_inference(mut self) -> Self {
        self.backbone.body.prepare();
        self.backbone.fpn.prepare();
        self.rpn.prepare();
        self.roi_heads.prepare();
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
        let device = &self.devices()[0];
        let seen = Seen::new(image, self.config.resize);
        let images = batch(&[image], &[seen], &self.config, device);
        let sight = self.look(images, &[relief], &[seen]);
        let objectness = floats(sight.scores.objectness);
        let offsets = floats(sight.scores.offsets);
        let [before, after] = [
            self.config.proposals.before_nms[1],
            self.config.proposals.after_nms[1],
        ];
        let regions = proposals(
            &objectness,
            &offsets,
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
        let masks = floats(sigmoid(pick_classes(masks, classes)));
        let cells = masks.len() / found.len();
        let [sx, sy] = seen.scale;
        for (instance, mask) in found.iter_mut().zip(masks.chunks(cells)) {
            instance.mask = mask.to_vec();
            let [left, top, right, bottom] = instance.bounds;
            let bounds = [left / sx, top / sy, right / sx, bottom / sy];
            instance.bounds = clip(bounds, image.width() as f32, image.height() as f32);
        }
        found
    }

    fn look(&self, images: Tensor<B, 4>, relief: &[Option<&ReliefMap>], seen: &[Seen]) -> Sight<B> {
        let [_, _, rows, columns] = images.dims();
        let body = &self.backbone.body;
        let relief = if body.takes_relief() {
            relief_batch(relief, seen, [columns, rows], &images.device())
        } else {
            None
        };
        let levels = self.backbone.fpn.forward(body.forward(images, relief));
        let grids: Vec<[usize; 2]> = levels
            .iter()
            .map(|level| [level.dims()[3], level.dims()[2]])
            .collect();
        Sight {
            rows: FeatureRows::new(&levels),
            scores: self.rpn.forward(&levels),
            anchors: anchors(&self.config.anchors, [columns, rows], &grids),
        }
    }

    /// The objects in regions of one image, best first, without masks; bounds in pixels of the model.
    fn classify(&self, rows: &FeatureRows<B>, regions: &[Bounds], seen: Seen) -> Vec<Instance> {
        if regions.is_empty() {
            return Vec::new();
        }
        let [width, height] = seen.extent();
        let indexed: Vec<_> = regions.iter().map(|&bounds| (0, bounds)).collect();
        let (logits, offsets) = self
            .roi_heads
            .boxes(rows.cut(&indexed, &self.align(self.config.roi.box_cells)));
        let scores = floats(softmax(logits, 1));
        let offsets = floats(offsets);
        let classes = self.config.classes;
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

    fn align(&self, cells: usize) -> RoiAlign {
        RoiAlign {
            cells,
            samples: self.config.roi.samples,
            half_pixel: self.config.roi.half_pixel,
        }
    }
}

impl<B: TrainBackend> MaskRcnn<B> {
    /// The losses of a batch of labelled photos; boxes are drawn by chance, the same for the same seed.
    ///
    /// A box that lies mostly where nothing is known and holds no known stone takes no part.
    pub fn losses(&self, samples: &[Sample], seed: u64) -> Losses<B> {
        let device = &self.devices()[0];
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let images: Vec<&RgbImage> = samples.iter().map(Sample::image).collect();
        let seen: Vec<Seen> = images
            .iter()
            .map(|image| Seen::new(image, self.config.resize))
            .collect();
        let target = |(sample, &seen)| Targets::new(sample, seen, self.config.min_stone_pixels);
        let targets: Vec<Targets> = samples.iter().zip(&seen).map(target).collect();
        let relief: Vec<Option<&ReliefMap>> = samples.iter().map(Sample::relief).collect();
        let sight = self.look(batch(&images, &seen, &self.config, device), &relief, &seen);
        let regions = self.propose(&sight, &targets, &seen);
        let (rpn_objectness, rpn_box) =
            self.proposal_losses(sight.scores, &sight.anchors.concat(), &targets, rng);
        let (class, box_regression, mask) = self.region_losses(&sight.rows, &regions, &targets, rng);
        Losses {
            rpn_objectness,
            rpn_box,
            class,
            box_regression,
            mask,
        }
    }

    /// Regions of every image for the heads to learn from: the proposals and the stones themselves.
    fn propose(&self, sight: &Sight<B>, targets: &[Targets], seen: &[Seen]) -> Vec<Vec<Bounds>> {
        let objectness = floats(sight.scores.objectness.clone());
        let offsets = floats(sight.scores.offsets.clone());
        let boxes = objectness.len() / targets.len().max(1);
        let [before, after] = [
            self.config.proposals.before_nms[0],
            self.config.proposals.after_nms[0],
        ];
        let mut regions = Vec::with_capacity(targets.len());
        for (image, (targets, seen)) in targets.iter().zip(seen).enumerate() {
            let mut found = proposals(
                &objectness[image * boxes..][..boxes],
                &offsets[4 * image * boxes..][..4 * boxes],
                &sight.anchors,
                seen.extent(),
                [before, after],
                &self.config.proposals,
            );
            found.extend(&targets.bounds);
            regions.push(found);
        }
        regions
    }

    /// Objectness and box loss of the proposal network.
    fn proposal_losses(
        &self,
        scores: AnchorScores<B>,
        anchors: &[Bounds],
        targets: &[Targets],
        rng: &mut ChaCha8Rng,
    ) -> (Tensor<B, 1>, Tensor<B, 1>) {
        let config = &self.config.anchor_sampling;
        let (mut drawn, mut is_stone, mut positive, mut offsets) = (vec![], vec![], vec![], vec![]);
        for (image, targets) in targets.iter().enumerate() {
            let matches = match_boxes(
                &targets.bounds,
                anchors,
                config.positive_iou,
                config.negative_iou,
                true,
            );
            let chosen = draw(&matches, config, |place| targets.is_known(anchors[place]), rng);
            let start = image * anchors.len();
            for (place, stone) in chosen.positive {
                positive.push(start + place);
                offsets.push(encode(anchors[place], targets.bounds[stone], PROPOSAL_WEIGHTS));
                drawn.push(start + place);
                is_stone.push(1.0);
            }
            for place in chosen.negative {
                drawn.push(start + place);
                is_stone.push(0.0);
            }
        }
        let device = &scores.objectness.device();
        let nothing = || Tensor::zeros([1], device);
        if drawn.is_empty() {
            return (nothing(), nothing());
        }
        let count = drawn.len() as f32;
        let logits = scores
            .objectness
            .flatten::<1>(0, 1)
            .select(0, indices(&drawn, device));
        let objectness = binary_cross_entropy(logits, is_stone);
        if positive.is_empty() {
            return (objectness, nothing());
        }
        let predicted = scores
            .offsets
            .flatten::<2>(0, 1)
            .select(0, indices(&positive, device));
        (objectness, smooth_l1(predicted, offsets) / count)
    }

    /// Class, box and mask loss of the heads.
    fn region_losses(
        &self,
        rows: &FeatureRows<B>,
        regions: &[Vec<Bounds>],
        targets: &[Targets],
        rng: &mut ChaCha8Rng,
    ) -> (Tensor<B, 1>, Tensor<B, 1>, Tensor<B, 1>) {
        let config = &self.config.roi;
        let mask_cells = 2 * config.mask_cells;
        let (mut chosen, mut classes) = (vec![], vec![]);
        let (mut positive, mut offsets, mut masks) = (vec![], vec![], Vec::<f32>::new());
        for (image, (regions, targets)) in regions.iter().zip(targets).enumerate() {
            let sampling = &config.sampling;
            let matches = match_boxes(
                &targets.bounds,
                regions,
                sampling.positive_iou,
                sampling.negative_iou,
                false,
            );
            let drawn = draw(&matches, sampling, |place| targets.is_known(regions[place]), rng);
            for (place, stone) in drawn.positive {
                positive.push(chosen.len());
                offsets.push(encode(regions[place], targets.bounds[stone], HEAD_WEIGHTS));
                masks.extend(targets.mask(stone, regions[place], mask_cells));
                chosen.push((image, regions[place]));
                classes.push(STONE as i32);
            }
            for place in drawn.negative {
                chosen.push((image, regions[place]));
                classes.push(0);
            }
        }
        let device = &self.devices()[0];
        let nothing = || Tensor::zeros([1], device);
        if chosen.is_empty() {
            return (nothing(), nothing(), nothing());
        }
        let count = chosen.len() as f32;
        let (logits, predicted) = self
            .roi_heads
            .boxes(rows.cut(&chosen, &self.align(config.box_cells)));
        let class = cross_entropy(logits, classes);
        if positive.is_empty() {
            return (class, nothing(), nothing());
        }
        let of_stones = predicted
            .select(0, indices(&positive, device))
            .slice_dim(1, 4 * STONE..4 * STONE + 4);
        let box_regression = smooth_l1(of_stones, offsets) / count;
        let stones: Vec<_> = positive.iter().map(|&place| chosen[place]).collect();
        let logits = self
            .roi_heads
            .masks(rows.cut(&stones, &self.align(config.mask_cells)));
        let logits = logits.slice_dim(1, STONE..STONE + 1).flatten::<1>(0, 3);
        (class, box_regression, binary_cross_entropy(logits, masks))
    }
}

/// Finds stones with a trained model.
#[derive(Clone, Debug)]
pub struct StoneDetector<B: ModelBackend> {
    model: MaskRcnn<B>,
}

impl<B: ModelBackend> StoneDetector<B> {
    /// A detector that runs this model.
    pub fn new(model: MaskRcnn<B>) -> Self {
        Self {
            model: model.for_inference(),
        }
    }

    /// Leaves out stones that score less, before their masks cost time.
    pub fn with_min_score(mut self, score: f32) -> Self {
        let threshold = &mut self.model.config.score_threshold;
        // The model keeps scores above its threshold; a stone that scores just this much stays.
        *threshold = threshold.max(score.next_down());
        self
    }
}

impl<B: ModelBackend> Detector for StoneDetector<B>
where
    MaskRcnn<B>: Sync,
{
    type Error = std::convert::Infallible;

    fn detect(&self, image: &RgbImage, relief: Option<&ReliefMap>) -> Result<Vec<Detection>, Self::Error> {
        Ok(self.model.detect(image, relief))
    }

    fn takes_relief(&self) -> bool {
        self.model.backbone.body.takes_relief()
    }
}

fn floats<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

fn indices<B: Backend>(places: &[usize], device: &B::Device) -> Tensor<B, 1, Int> {
    let places: Vec<i32> = places.iter().map(|&place| place as i32).collect();
    let count = places.len();
    Tensor::from_data(TensorData::new(places, [count]), device)
}

/// Of masks [regions, classes, rows, columns] those of given (region, class): [pairs, rows, columns].
fn pick_classes<B: Backend>(
    masks: Tensor<B, 4>,
    pairs: impl Iterator<Item = (usize, usize)>,
) -> Tensor<B, 3> {
    let classes = masks.dims()[1];
    let places: Vec<usize> = pairs.map(|(region, class)| region * classes + class).collect();
    let device = masks.device();
    masks.flatten::<3>(0, 1).select(0, indices(&places, &device))
}
