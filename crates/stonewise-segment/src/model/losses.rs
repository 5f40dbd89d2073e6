//! The losses of Mask R-CNN (He et al. 2017, section 3; Ren et al. 2015, eq. 1).

use super::activation::{sigmoid, softmax};
use crate::engine::Tensor;

/// Where the smooth L1 loss turns from a parabola to a line.
const BETA: f32 = 1.0 / 9.0;

/// The five losses of a batch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Losses {
    /// Does a reference box hold a stone.
    pub rpn_objectness: f32,
    /// Offsets of reference boxes.
    pub rpn_box: f32,
    /// Class of a proposal.
    pub class: f32,
    /// Offsets of proposals.
    pub box_regression: f32,
    /// Masks.
    pub mask: f32,
}

impl Losses {
    /// All of them, in the order of the fields.
    pub fn parts(&self) -> [f32; 5] {
        [
            self.rpn_objectness,
            self.rpn_box,
            self.class,
            self.box_regression,
            self.mask,
        ]
    }

    /// Their sum.
    pub fn total(&self) -> f32 {
        self.parts().iter().sum()
    }
}

/// No loss where there is nothing to learn from.
pub fn nothing() -> Tensor {
    Tensor::new([1], vec![0.0])
}

/// Mean cross entropy between logits and probabilities.
pub fn binary_cross_entropy(logits: &Tensor, targets: &[f32]) -> Tensor {
    // max(x, 0) - x t + ln(1 + exp(-|x|)) does not overflow.
    let entropy = |x: f32, t: f32| x.max(0.0) - x * t + (-x.abs()).exp().ln_1p();
    let pairs = || logits.values().iter().zip(targets);
    let value = pairs().map(|(x, t)| f64::from(entropy(*x, *t))).sum();
    let slopes = pairs().map(|(x, t)| sigmoid(*x) - t).collect();
    divided(logits, value, slopes, targets.len())
}

/// Mean cross entropy between logits [items, classes] and classes.
pub fn cross_entropy(logits: &Tensor, classes: &[usize]) -> Tensor {
    let [_, count] = logits.dims();
    let (mut value, mut slopes) = (0.0, Vec::with_capacity(logits.values().len()));
    for (logits, class) in logits.values().chunks(count).zip(classes) {
        let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let sum: f64 = logits.iter().map(|logit| f64::from(logit - most).exp()).sum();
        value += sum.ln() + f64::from(most - logits[*class]);
        let shares = softmax(logits).into_iter().enumerate();
        slopes.extend(shares.map(|(of, share)| if of == *class { share - 1.0 } else { share }));
    }
    divided(logits, value, slopes, classes.len())
}

/// Sum of smooth L1 distances (Girshick 2015, eq. 3) between offsets [items, 4], over a number of boxes.
pub fn smooth_l1(offsets: &Tensor, targets: &[[f32; 4]], boxes: usize) -> Tensor {
    let distances = || {
        offsets
            .values()
            .iter()
            .zip(targets.as_flattened())
            .map(|(x, t)| x - t)
    };
    let loss = |distance: f32| {
        let near = distance.abs().min(BETA);
        near * near * (0.5 / BETA) + distance.abs() - near
    };
    let value = distances().map(|distance| f64::from(loss(distance))).sum();
    let slopes = distances()
        .map(|distance| (distance / BETA).clamp(-1.0, 1.0))
        .collect();
    divided(offsets, value, slopes, boxes)
}

/// A loss of this value and these derivatives with regard to the predictions, both over a count.
fn divided(predictions: &Tensor, value: f64, slopes: Vec<f32>, count: usize) -> Tensor {
    let share = 1.0 / count as f32;
    let value = (value / count as f64) as f32;
    Tensor::derived([1], vec![value], &[predictions.node()], move |grad, _| {
        vec![slopes.into_iter().map(|slope| slope * share * grad[0]).collect()]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::testing::assert_derivatives;

    fn tensor(shape: &[usize], values: &[f32]) -> Tensor {
        Tensor::new(shape, values.to_vec())
    }

    #[test]
    fn losses_agree_with_their_definitions() {
        let logits = [0.3f32, -2.0, 40.0, -40.0];
        let targets = [1.0f32, 0.25, 1.0, 0.0];
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let entropy = |(x, t): (&f32, &f32)| {
            let p = sigmoid(f64::from(*x)).clamp(1e-15, 1.0 - 1e-15);
            -f64::from(*t) * p.ln() - (1.0 - f64::from(*t)) * (1.0 - p).ln()
        };
        let expected = logits.iter().zip(&targets).map(entropy).sum::<f64>() / 4.0;
        let got = binary_cross_entropy(&tensor(&[4], &logits), &targets).values()[0];
        assert!((f64::from(got) - expected).abs() < 1e-6);

        let rows = tensor(&[2, 3], &[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
        let got = cross_entropy(&rows, &[2, 0]).values()[0];
        let expected = 0.5 * ((1.0f64 + (-1.0f64).exp() + (-2.0f64).exp()).ln() + 3.0f64.ln());
        assert!((f64::from(got) - expected).abs() < 1e-6);

        let got = smooth_l1(&tensor(&[1, 4], &[0.05, -0.5, 2.0, 0.0]), &[[0.0; 4]], 2).values()[0];
        let expected = 0.5 * 9.0 * 0.05 * 0.05 + (0.5 - 0.5 / 9.0) + (2.0 - 0.5 / 9.0);
        assert!((got - 0.5 * expected).abs() < 1e-6);
    }

    #[test]
    fn derivatives_are_differences() {
        assert_derivatives(&[tensor(&[3], &[0.3, -2.0, 4.0])], |x| {
            binary_cross_entropy(&x[0], &[1.0, 0.25, 0.0])
        });
        assert_derivatives(&[tensor(&[2, 3], &[1.0, 2.0, 3.0, 0.5, 0.0, -1.0])], |x| {
            cross_entropy(&x[0], &[1, 0])
        });
        assert_derivatives(&[tensor(&[1, 4], &[0.05, -0.5, 2.0, 0.0])], |x| {
            smooth_l1(&x[0], &[[0.0; 4]], 3)
        });
    }
}
