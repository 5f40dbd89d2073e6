//! The optimiser.

use crate::model::{Gradients, MaskRcnn, Parameters};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Values that a thread takes at a time.
const AT_ONCE: usize = 1 << 14;

/// Parameters of AdamW (Loshchilov and Hutter 2019).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamWParams {
    /// Decay of the mean of gradients.
    pub beta_1: f64,
    /// Decay of the mean of squared gradients.
    pub beta_2: f64,
    /// Keeps the step finite where gradients vanish.
    pub epsilon: f64,
    /// Share of the rate by which weights shrink a step; biases and normalisations do not shrink.
    pub weight_decay: f64,
    /// Gradients longer than this, as one vector over all parameters, are shortened to it.
    pub max_gradient_norm: f64,
}

impl Default for AdamWParams {
    fn default() -> Self {
        Self {
            beta_1: 0.9,
            beta_2: 0.99,
            epsilon: 1e-8,
            weight_decay: 0.05,
            max_gradient_norm: 5.0,
        }
    }
}

/// Adam with decoupled weight decay.
///
/// Its state is kept by the name of the parameter, so that it can be saved and taken up by another process.
/// Source: Loshchilov & Hutter 2019, algorithm 2; clipping by the global norm: Pascanu et al. 2013.
pub struct AdamW {
    params: AdamWParams,
    steps: i32,
    moments: BTreeMap<String, Moments>,
}

/// Running means for one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    /// Running mean of the gradients.
    pub mean: Vec<f32>,
    /// Running mean of their squares.
    pub square: Vec<f32>,
}

impl AdamW {
    /// An optimiser that has seen nothing.
    pub fn new(params: AdamWParams) -> Self {
        Self::from_state(params, BTreeMap::new(), 0)
    }

    /// An optimiser that goes on from a saved state after this number of steps.
    pub(super) fn from_state(params: AdamWParams, moments: BTreeMap<String, Moments>, steps: i32) -> Self {
        Self {
            params,
            steps,
            moments,
        }
    }

    /// The state, to be saved.
    pub(super) fn moments(&self) -> &BTreeMap<String, Moments> {
        &self.moments
    }

    /// Takes a step against the gradients; returns the length of the gradient before it was clipped.
    ///
    /// A gradient that is not finite leaves the model as it was.
    pub fn step(&mut self, model: &mut MaskRcnn, gradients: Gradients, rate: f64) -> f64 {
        self.step_on(model.parameters(), gradients, rate)
    }

    fn step_on(&mut self, parameters: Parameters, mut gradients: Gradients, rate: f64) -> f64 {
        let norm = gradients.norm();
        if !norm.is_finite() {
            return norm;
        }
        if norm > self.params.max_gradient_norm {
            gradients.scale((self.params.max_gradient_norm / norm) as f32);
        }
        self.steps += 1;
        for (name, param) in parameters {
            if let Some(gradient) = gradients.get(&name) {
                let is_matrix = param.tensor.shape().len() > 1;
                let decay = if is_matrix { self.params.weight_decay } else { 0.0 };
                self.update(name, param.tensor.values_mut(), gradient, [rate, decay]);
            }
        }
        norm
    }

    fn update(&mut self, name: String, values: &mut [f32], gradient: &[f32], [rate, decay]: [f64; 2]) {
        let p = &self.params;
        let zeros = || vec![0.0; gradient.len()];
        let moments = self.moments.entry(name).or_insert_with(|| Moments {
            mean: zeros(),
            square: zeros(),
        });
        // The corrections for the start from zero, drawn out of the quotient of the means.
        let mean_correction = 1.0 - p.beta_1.powi(self.steps);
        let root_correction = (1.0 - p.beta_2.powi(self.steps)).sqrt();
        let step = (rate * root_correction / mean_correction) as f32;
        let epsilon = (p.epsilon * root_correction) as f32;
        let kept = (1.0 - rate * decay) as f32;
        let [of_mean, of_square] = [p.beta_1, p.beta_2].map(|beta| (beta as f32, (1.0 - beta) as f32));

        let means = moments.mean.par_chunks_mut(AT_ONCE);
        let state = means.zip(moments.square.par_chunks_mut(AT_ONCE));
        let weights = values.par_chunks_mut(AT_ONCE).zip(gradient.par_chunks(AT_ONCE));
        weights
            .zip(state)
            .for_each(|((values, gradient), (means, squares))| {
                let state = means.iter_mut().zip(squares);
                for ((value, gradient), (mean, square)) in values.iter_mut().zip(gradient).zip(state) {
                    *mean = of_mean.0 * *mean + of_mean.1 * gradient;
                    *square = of_square.0 * *square + of_square.1 * gradient * gradient;
                    *value = kept * *value - step * *mean / (square.sqrt() + epsilon);
                }
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Tensor;
    use crate::model::Param;

    fn param(value: f32) -> Param {
        Param {
            tensor: Tensor::new([1, 1], vec![value]),
            is_fixed: false,
        }
    }

    fn step(optimizer: &mut AdamW, param: &mut Param, slope: f32) -> f64 {
        let gradients = Gradients::from_iter([("weight".to_owned(), vec![slope])]);
        optimizer.step_on(vec![("weight".to_owned(), param)], gradients, 0.3)
    }

    #[test]
    fn steps_follow_the_published_algorithm() {
        let params = AdamWParams {
            beta_1: 0.8,
            beta_2: 0.9,
            epsilon: 0.01,
            weight_decay: 0.1,
            max_gradient_norm: 2.5,
        };
        let mut optimizer = AdamW::new(params);
        let mut param = param(2.0);
        // Algorithm 2 by hand, with gradients 2, -1, and 5 that is clipped to 2.5.
        let (mut w, mut m, mut v) = (2.0f64, 0.0, 0.0);
        for (t, slope) in [2.0, -1.0, 5.0].into_iter().enumerate() {
            let g = f64::min(slope, 2.5);
            m = 0.8 * m + 0.2 * g;
            v = 0.9 * v + 0.1 * g * g;
            let t = t as i32 + 1;
            let (m_hat, v_hat) = (m / (1.0 - 0.8f64.powi(t)), v / (1.0 - 0.9f64.powi(t)));
            w -= 0.3 * (m_hat / (v_hat.sqrt() + 0.01) + 0.1 * w);
            let norm = step(&mut optimizer, &mut param, slope as f32);
            assert!((norm - slope.abs()).abs() < 1e-6);
            let weight = f64::from(param.tensor.values()[0]);
            assert!((weight - w).abs() < 1e-6, "{weight} {w}");
        }
    }

    #[test]
    fn gradients_that_are_not_finite_change_nothing() {
        let mut optimizer = AdamW::new(AdamWParams::default());
        let mut param = param(2.0);
        assert!(step(&mut optimizer, &mut param, f32::NAN).is_nan());
        assert_eq!(param.tensor.values(), [2.0]);
    }
}
