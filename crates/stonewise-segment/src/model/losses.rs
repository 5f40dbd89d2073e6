//! The losses of Mask R-CNN (He et al. 2017, section 3; Ren et al. 2015, eq. 1).

use burn::tensor::activation::log_softmax;
use burn::tensor::backend::Backend;
use burn::tensor::{Int, Tensor, TensorData};

/// Where the smooth L1 loss turns from a parabola to a line.
const BETA: f32 = 1.0 / 9.0;

/// The five losses of a batch, one number each.
#[derive(Clone, Debug)]
pub struct Losses<B: Backend> {
    /// Does a reference box hold a stone.
    pub rpn_objectness: Tensor<B, 1>,
    /// Offsets of reference boxes.
    pub rpn_box: Tensor<B, 1>,
    /// Class of a proposal.
    pub class: Tensor<B, 1>,
    /// Offsets of proposals.
    pub box_regression: Tensor<B, 1>,
    /// Masks.
    pub mask: Tensor<B, 1>,
}

impl<B: Backend> Losses<B> {
    /// Their sum.
    pub fn total(&self) -> Tensor<B, 1> {
        self.rpn_objectness.clone()
            + self.rpn_box.clone()
            + self.class.clone()
            + self.box_regression.clone()
            + self.mask.clone()
    }
}

/// Mean cross entropy between logits and probabilities.
pub fn binary_cross_entropy<B: Backend>(logits: Tensor<B, 1>, targets: Vec<f32>) -> Tensor<B, 1> {
    let targets = Tensor::from_data(TensorData::new(targets, logits.dims()), &logits.device());
    // max(x, 0) - x t + ln(1 + exp(-|x|)) does not overflow.
    let tail = (-logits.clone().abs()).exp().log1p();
    (logits.clone().clamp_min(0.0) - logits * targets + tail).mean()
}

/// Mean cross entropy between logits [items, classes] and classes.
pub fn cross_entropy<B: Backend>(logits: Tensor<B, 2>, classes: Vec<i32>) -> Tensor<B, 1> {
    let shape = [classes.len(), 1];
    let classes = Tensor::<B, 2, Int>::from_data(TensorData::new(classes, shape), &logits.device());
    -log_softmax(logits, 1).gather(1, classes).mean()
}

/// Sum of smooth L1 distances (Girshick 2015, eq. 3) between offsets [items, 4].
pub fn smooth_l1<B: Backend>(offsets: Tensor<B, 2>, targets: Vec<[f32; 4]>) -> Tensor<B, 1> {
    let shape = [targets.len(), 4];
    let targets = Tensor::from_data(TensorData::new(targets.concat(), shape), &offsets.device());
    let distance = (offsets - targets).abs();
    let near = distance.clone().clamp_max(BETA);
    (near.clone().square() * (0.5 / BETA) + distance - near).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::backend::Flex;

    #[test]
    fn losses_agree_with_their_definitions() {
        let device = Default::default();
        let logits = [0.3f32, -2.0, 40.0, -40.0];
        let targets = [1.0f32, 0.25, 1.0, 0.0];
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let entropy = |(x, t): (&f32, &f32)| {
            let p = sigmoid(f64::from(*x)).clamp(1e-15, 1.0 - 1e-15);
            -f64::from(*t) * p.ln() - (1.0 - f64::from(*t)) * (1.0 - p).ln()
        };
        let expected = logits.iter().zip(&targets).map(entropy).sum::<f64>() / 4.0;
        let got: f32 =
            binary_cross_entropy::<Flex>(Tensor::from_floats(logits, &device), targets.into()).into_scalar();
        assert!((f64::from(got) - expected).abs() < 1e-6);

        let rows = Tensor::<Flex, 2>::from_floats([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]], &device);
        let got: f32 = cross_entropy(rows, vec![2, 0]).into_scalar();
        let expected = 0.5 * ((1.0f64 + (-1.0f64).exp() + (-2.0f64).exp()).ln() + 3.0f64.ln());
        assert!((f64::from(got) - expected).abs() < 1e-6);

        let offsets = Tensor::<Flex, 2>::from_floats([[0.05, -0.5, 2.0, 0.0]], &device);
        let got: f32 = smooth_l1(offsets, vec![[0.0; 4]]).into_scalar();
        let expected = 0.5 * 9.0 * 0.05 * 0.05 + (0.5 - 0.5 / 9.0) + (2.0 - 0.5 / 9.0);
        assert!((got - expected).abs() < 1e-6);
    }
}
