//! Labelled photos in, losses and their derivatives out.

use super::boxes::{Bounds, HEAD_WEIGHTS, PROPOSAL_WEIGHTS, encode};
use super::gradients::Gradients;
use super::losses::{Losses, binary_cross_entropy, cross_entropy, nothing, smooth_l1};
use super::mask_rcnn::{MaskRcnn, Sight, of_classes};
use super::matcher::match_boxes;
use super::parameter::Param;
use super::preprocess::{Seen, batch};
use super::roi_align::FeatureRows;
use super::rpn::{AnchorScores, proposals};
use super::sampler::draw;
use super::targets::Targets;
use crate::Sample;
use crate::engine::{Tape, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use stonewise_core::raster::{ReliefMap, RgbImage};

/// Class of all stones of a [`Sample`].
const STONE: usize = 1;

impl MaskRcnn {
    /// The losses of a batch of labelled photos; boxes are drawn by chance, the same for the same seed.
    ///
    /// A box that lies mostly where nothing is known and holds no known stone takes no part.
    pub fn losses(&self, samples: &[Sample], seed: u64) -> Losses {
        values(&self.computed_losses(samples, seed))
    }

    /// The losses of [`Self::losses`], and the derivatives of their sum with respect to all parameters that are not
    /// fixed.
    pub fn gradients(&self, samples: &[Sample], seed: u64) -> (Losses, Gradients) {
        let tape = Tape::default();
        let mut model = self.clone();
        for (_, param) in model.parameters() {
            if !param.is_fixed {
                param.tensor = param.tensor.on(&tape);
            }
        }
        let losses = model.computed_losses(samples, seed);
        let nodes: Vec<_> = losses.iter().filter_map(Tensor::node).collect();
        let mut derivatives = tape.derivatives(&nodes);
        let of_param =
            |(name, param): (String, &mut Param)| Some((name, param.tensor.derivative(&mut derivatives)?));
        let gradients = model.parameters().into_iter().filter_map(of_param).collect();
        (values(&losses), gradients)
    }

    /// The losses in the order of [`Losses::parts`].
    fn computed_losses(&self, samples: &[Sample], seed: u64) -> [Tensor; 5] {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let images: Vec<&RgbImage> = samples.iter().map(Sample::image).collect();
        let seen: Vec<Seen> = images
            .iter()
            .map(|image| Seen::new(image, self.config.resize))
            .collect();
        let target = |(sample, &seen)| Targets::new(sample, seen, self.config.min_stone_pixels);
        let targets: Vec<Targets> = samples.iter().zip(&seen).map(target).collect();
        let relief: Vec<Option<&ReliefMap>> = samples.iter().map(Sample::relief).collect();
        let sight = self.look(&batch(&images, &seen, &self.config), &relief, &seen);
        let regions = self.propose(&sight, &targets, &seen);
        let [rpn_objectness, rpn_box] =
            self.proposal_losses(sight.scores, &sight.anchors.concat(), &targets, rng);
        let [class, box_regression, mask] = self.region_losses(&sight.rows, &regions, &targets, rng);
        [rpn_objectness, rpn_box, class, box_regression, mask]
    }

    /// Regions of every image for the heads to learn from: the proposals and the stones themselves.
    fn propose(&self, sight: &Sight, targets: &[Targets], seen: &[Seen]) -> Vec<Vec<Bounds>> {
        let objectness = sight.scores.objectness.values();
        let offsets = sight.scores.offsets.values();
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
        scores: AnchorScores,
        anchors: &[Bounds],
        targets: &[Targets],
        rng: &mut ChaCha8Rng,
    ) -> [Tensor; 2] {
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

        if drawn.is_empty() {
            return [nothing(), nothing()];
        }
        let count = drawn.len();
        let boxes = targets.len() * anchors.len();
        let logits = scores.objectness.reshaped([boxes]).selected(drawn);
        let objectness = binary_cross_entropy(&logits, &is_stone);
        if positive.is_empty() {
            return [objectness, nothing()];
        }
        let predicted = scores.offsets.reshaped([boxes, 4]).selected(positive);
        [objectness, smooth_l1(&predicted, &offsets, count)]
    }

    /// Class, box and mask loss of the heads.
    fn region_losses(
        &self,
        rows: &FeatureRows,
        regions: &[Vec<Bounds>],
        targets: &[Targets],
        rng: &mut ChaCha8Rng,
    ) -> [Tensor; 3] {
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
                classes.push(STONE);
            }
            for place in drawn.negative {
                chosen.push((image, regions[place]));
                classes.push(0);
            }
        }

        if chosen.is_empty() {
            return [nothing(), nothing(), nothing()];
        }
        let (logits, predicted) = self
            .roi_heads
            .boxes(rows.cut(&chosen, &self.align(config.box_cells)));
        let class = cross_entropy(&logits, &classes);
        if positive.is_empty() {
            return [class, nothing(), nothing()];
        }
        let of_stones = positive.iter().map(|place| place * self.config.classes + STONE);
        let predicted = predicted.reshaped([chosen.len() * self.config.classes, 4]);
        let predicted = predicted.selected(of_stones.collect());
        let box_regression = smooth_l1(&predicted, &offsets, chosen.len());

        let stones: Vec<_> = positive.iter().map(|&place| chosen[place]).collect();
        let logits = self
            .roi_heads
            .masks(rows.cut(&stones, &self.align(config.mask_cells)));
        let logits = of_classes(logits, (0..stones.len()).map(|region| (region, STONE)));
        [class, box_regression, binary_cross_entropy(&logits, &masks)]
    }
}

fn values(losses: &[Tensor; 5]) -> Losses {
    let [rpn_objectness, rpn_box, class, box_regression, mask] =
        losses.each_ref().map(|loss| loss.values()[0]);
    Losses {
        rpn_objectness,
        rpn_box,
        class,
        box_regression,
        mask,
    }
}
