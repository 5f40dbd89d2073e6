//! Region proposal network (Ren et al. 2015).

use super::boxes::{Bounds, PROPOSAL_WEIGHTS, clip, decode, is_large};
use super::config::{Norm, ProposalConfig};
use super::init::Init;
use super::kernels::ModelBackend;
use super::layers::{Conv, ConvBlock, Spread};
use super::nms::suppress;
use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;
use burn::tensor::backend::Backend;

/// Shorter sides make no proposal, pixels.
const MIN_SIDE: f32 = 1e-3;

/// The part of the model that scores and shifts reference boxes.
#[derive(Module, Debug)]
pub struct Rpn<B: Backend> {
    head: Head<B>,
}

#[derive(Module, Debug)]
struct Head<B: Backend> {
    hidden: Vec<ConvBlock<B>>,
    cls_logits: Conv<B>,
    bbox_pred: Conv<B>,
}

/// Scores and shifts of every reference box of a batch.
#[derive(Clone, Debug)]
pub struct AnchorScores<B: Backend> {
    /// Logit of holding something: [batch, boxes].
    pub objectness: Tensor<B, 2>,
    /// Offsets to it: [batch, boxes, 4].
    pub offsets: Tensor<B, 3>,
}

impl<B: ModelBackend> Rpn<B> {
    /// `shapes`: reference boxes at a place.
    pub fn new(init: &mut Init<B>, channels: usize, shapes: usize, norm: Option<Norm>) -> Self {
        let spread = Spread::Normal(0.01);
        let hidden = vec![ConvBlock::new(init, [channels; 2], 3, spread, norm)];
        let mut conv = |outputs| Conv::new(init, [channels, outputs], 1, 1, spread, true);
        Self {
            head: Head {
                hidden,
                cls_logits: conv(shapes),
                bbox_pred: conv(4 * shapes),
            },
        }
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.head.hidden.iter_mut().for_each(ConvBlock::prepare);
    }

    /// Scores in the order of [`anchors`](super::anchors::anchors).
    pub fn forward(&self, levels: &[Tensor<B, 4>]) -> AnchorScores<B> {
        let mut objectness = Vec::with_capacity(levels.len());
        let mut offsets = Vec::with_capacity(levels.len());
        for level in levels {
            let hidden = self
                .head
                .hidden
                .iter()
                .fold(level.clone(), |x, block| relu(block.forward(x)));
            let scores = self.head.cls_logits.forward(hidden.clone());
            let [batch, shapes, rows, columns] = scores.dims();
            let boxes = rows * columns * shapes;
            objectness.push(scores.permute([0, 2, 3, 1]).reshape([batch, boxes]));
            let shifts = self.head.bbox_pred.forward(hidden);
            offsets.push(shifts.permute([0, 2, 3, 1]).reshape([batch, boxes, 4]));
        }
        AnchorScores {
            objectness: Tensor::cat(objectness, 1),
            offsets: Tensor::cat(offsets, 1),
        }
    }
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
