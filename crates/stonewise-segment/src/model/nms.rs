//! Non-maximum suppression.

use super::boxes::{Bounds, iou};

/// Places of the boxes that no better box of the same group overlaps by more than `max_iou`, best first.
///
/// Equal scores keep their order. Cost: O(boxes x kept).
pub fn suppress(boxes: &[Bounds], scores: &[f32], groups: &[usize], max_iou: f32) -> Vec<usize> {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
    let mut kept: Vec<usize> = Vec::new();
    for candidate in order {
        let beaten = kept.iter().any(|&better| {
            groups[better] == groups[candidate] && iou(boxes[better], boxes[candidate]) > max_iou
        });
        if !beaten {
            kept.push(candidate);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_of_an_overlapping_pair_stays_and_groups_do_not_meet() {
        let boxes = [
            [0.0, 0.0, 10.0, 10.0],
            [1.0, 0.0, 11.0, 10.0],
            [20.0, 0.0, 30.0, 10.0],
            [1.0, 0.0, 11.0, 10.0],
        ];
        let scores = [0.5, 0.9, 0.7, 0.6];
        assert_eq!(suppress(&boxes, &scores, &[0, 0, 0, 1], 0.5), [1, 2, 3]);
        assert_eq!(suppress(&boxes, &scores, &[0, 0, 0, 0], 0.5), [1, 2]);
        assert_eq!(suppress(&boxes, &scores, &[0, 0, 0, 0], 0.9), [1, 2, 0]);
    }
}
