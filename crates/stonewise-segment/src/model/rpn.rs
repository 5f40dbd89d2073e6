//! Region proposal network (Ren et al. 2015).

use super::boxes::{Bounds, PROPOSAL_WEIGHTS, clip, decode, is_large};
use super::config::{Norm, ProposalConfig};
use super::init::Init;
use super::layers::{Conv, ConvBlock, Spread};
use super::nms::suppress;
use super::parameter::{Parameters, part};
use crate::engine::Tensor;

/// Shorter sides make no proposal, pixels.
const MIN_SIDE: f32 = 1e-3;

/// The part of the model that scores and shifts reference boxes.
#[derive(Clone, Debug)]
pub struct Rpn {
    hidden: ConvBlock,
    cls_logits: Conv,
    bbox_pred: Conv,
}

/// Scores and shifts of every reference box of a batch.
#[derive(Clone, Debug)]
pub struct AnchorScores {
    /// Logit of holding something: [batch, boxes].
    pub objectness: Tensor,
    /// Offsets to it: [batch, 4 boxes], those of a box one after another.
    pub offsets: Tensor,
}

impl Rpn {
    /// `shapes`: reference boxes at a place.
    pub fn new(init: &mut Init, channels: usize, shapes: usize, norm: Option<Norm>) -> Self {
        let spread = Spread::Normal(0.01);
        let hidden = ConvBlock::new(init, [channels; 2], 3, spread, norm);
        let mut conv = |outputs| Conv::new(init, [channels, outputs], 1, 1, spread, true);
        Self {
            hidden,
            cls_logits: conv(shapes),
            bbox_pred: conv(4 * shapes),
        }
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.hidden.prepare();
    }

    /// Scores in the order of [`anchors`](super::anchors::anchors).
    pub fn forward(&self, levels: &[Tensor]) -> AnchorScores {
        let mut objectness = Vec::with_capacity(levels.len());
        let mut offsets = Vec::with_capacity(levels.len());
        for level in levels {
            let hidden = self.hidden.forward(level.clone()).relu();
            objectness.push(by_place(self.cls_logits.forward(&hidden)));
            offsets.push(by_place(self.bbox_pred.forward(&hidden)));
        }
        AnchorScores {
            objectness: Tensor::joined(&objectness),
            offsets: Tensor::joined(&offsets),
        }
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        let name = &part(name, "head");
        self.hidden
            .numbered_parameters(&part(&part(name, "conv"), 0), found);
        self.cls_logits.parameters(&part(name, "cls_logits"), found);
        self.bbox_pred.parameters(&part(name, "bbox_pred"), found);
    }
}

/// [batch, channels, rows, columns] to [batch, values], the channels of a place one after another.
fn by_place(x: Tensor) -> Tensor {
    let [batch, channels, rows, columns] = x.dims();
    let x = x.reshaped([batch, channels, rows * columns]).exchanged();
    x.reshaped([batch, rows * columns * channels])
}

/// The best boxes of one image, best first: of each level the best reference boxes, shifted, inside the
/// image, without those that a better one of the same level covers.
///
/// `keep`: boxes of a level before suppression, of the image after it.
pub fn proposals(
    objectness: &[f32],
    offsets: &[f32],
    anchors: &[Vec<Bounds>],
    [width, height]: [f32; 2],
    keep: [usize; 2],
    config: &ProposalConfig,
) -> Vec<Bounds> {
    let (mut boxes, mut scores, mut levels) = (Vec::new(), Vec::new(), Vec::new());
    let mut start = 0;
    for (level, references) in anchors.iter().enumerate() {
        let logits = &objectness[start..start + references.len()];
        for place in best(logits, keep[0]) {
            let shift = &offsets[4 * (start + place)..][..4];
            let shift = [shift[0], shift[1], shift[2], shift[3]];
            let bounds = clip(decode(references[place], shift, PROPOSAL_WEIGHTS), width, height);
            if is_large(bounds, MIN_SIDE) && logits[place].is_finite() {
                boxes.push(bounds);
                scores.push(logits[place]);
                levels.push(level);
            }
        }
        start += references.len();
    }
    let kept = suppress(&boxes, &scores, &levels, config.nms_iou);
    kept.into_iter().take(keep[1]).map(|place| boxes[place]).collect()
}

/// Places of the largest scores, largest first.
fn best(scores: &[f32], count: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..scores.len()).collect();
    let order = |a: &usize, b: &usize| scores[*b].total_cmp(&scores[*a]).then(a.cmp(b));
    if places.len() > count {
        places.select_nth_unstable_by(count, order);
        places.truncate(count);
    }
    places.sort_unstable_by(order);
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proposals_are_the_best_shifted_boxes_inside_the_image() {
        let anchors = vec![
            vec![
                [0.0, 0.0, 10.0, 10.0],
                [1.0, 0.0, 11.0, 10.0],
                [40.0, 40.0, 50.0, 50.0],
            ],
            vec![[0.0, 0.0, 10.0, 10.0]],
        ];
        let objectness = [1.0, 2.0, 3.0, 0.5];
        let mut offsets = [0.0; 16];
        offsets[8] = 1.0;
        let config = ProposalConfig {
            before_nms: [10, 10],
            after_nms: [10, 10],
            nms_iou: 0.7,
        };
        let boxes = proposals(&objectness, &offsets, &anchors, [55.0, 100.0], [10, 10], &config);
        let expected = [
            [50.0, 40.0, 55.0, 50.0],
            [1.0, 0.0, 11.0, 10.0],
            [0.0, 0.0, 10.0, 10.0],
        ];
        assert_eq!(boxes, expected);
        let boxes = proposals(&objectness, &offsets, &anchors, [55.0, 100.0], [1, 10], &config);
        assert_eq!(boxes, [expected[0], [0.0, 0.0, 10.0, 10.0]]);
    }
}
