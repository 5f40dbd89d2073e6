//! Operations on single values.

use super::tensor::Tensor;
use rayon::prelude::*;
use std::sync::Arc;

/// Values that a thread takes at a time.
const AT_ONCE: usize = 1 << 15;

impl Tensor {
    /// The values above zero, zero for the others.
    #[must_use]
    pub fn relu(self) -> Self {
        let (shape, node) = (self.shape().to_vec(), self.node());
        let mut values = self.into_values();
        values.par_chunks_mut(AT_ONCE).for_each(|values| {
            for value in values {
                // Other than max(0, value) it hands on what is not a number.
                *value = if *value < 0.0 { 0.0 } else { *value };
            }
        });
        let values = Arc::new(values);
        let made = values.clone();
        Self::derived(shape, values, &[node], move |mut grad, _| {
            for (grad, value) in grad.iter_mut().zip(made.iter()) {
                if *value <= 0.0 {
                    *grad = 0.0;
                }
            }
            vec![grad]
        })
    }

    /// The sum with a tensor of the same shape.
    #[must_use]
    pub fn plus(self, other: &Self) -> Self {
        let (shape, nodes) = (self.shape().to_vec(), [self.node(), other.node()]);
        let mut values = self.into_values();
        let parts = values
            .par_chunks_mut(AT_ONCE)
            .zip(other.values().par_chunks(AT_ONCE));
        parts.for_each(|(values, others)| {
            values
                .iter_mut()
                .zip(others)
                .for_each(|(value, other)| *value += other);
        });
        Self::derived(shape, values, &nodes, |grad, wanted| {
            let copy = if wanted[0] && wanted[1] {
                grad.clone()
            } else {
                Vec::new()
            };
            if wanted[1] {
                vec![copy, grad]
            } else {
                vec![grad, copy]
            }
        })
    }

    /// Every value of [batch, channels, ...] times the scale of its channel plus its shift, both constants.
    #[must_use]
    pub fn scaled(self, scale: Vec<f32>, shift: &[f32]) -> Self {
        let (shape, node) = (self.shape().to_vec(), self.node());
        let plane = shape.iter().skip(2).product::<usize>().max(1);
        let channels = scale.len();
        let mut values = self.into_values();
        values
            .par_chunks_mut(plane)
            .enumerate()
            .for_each(|(place, values)| {
                let (scale, shift) = (scale[place % channels], shift[place % channels]);
                values
                    .iter_mut()
                    .for_each(|value| *value = *value * scale + shift);
            });
        Self::derived(shape, values, &[node], move |mut grad, _| {
            for (place, grad) in grad.chunks_mut(plane).enumerate() {
                grad.iter_mut().for_each(|grad| *grad *= scale[place % channels]);
            }
            vec![grad]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_derivatives, wave};
    use std::slice::from_ref;

    #[test]
    fn derivatives_are_differences() {
        let [x, y] = [0.7, 1.9].map(|pace| wave(&[2, 3, 2, 4], pace));
        assert_derivatives(from_ref(&x), |x| x[0].clone().relu());
        assert_derivatives(&[x.clone(), y.clone()], |x| x[0].clone().plus(&x[1]));
        assert_derivatives(from_ref(&x), |x| x[0].clone().plus(&x[0]).plus(&y));
        assert_derivatives(&[x], |x| {
            x[0].clone().scaled(vec![2.0, -1.0, 0.5], &[0.1, 0.2, 0.3])
        });
    }
}
