//! The optimiser.

use super::parameters::Gradients;
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Device, Tensor, TensorData};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
/// Its state is kept by the path of the parameter, so that it can be saved and taken up by another process.
/// Source: Loshchilov & Hutter 2019, algorithm 2; clipping by the global norm: Pascanu et al. 2013.
pub struct AdamW<B: Backend> {
    params: AdamWParams,
    steps: i32,
    moments: BTreeMap<String, Moments<B>>,
}

/// Running means for one parameter, flattened.
struct Moments<B: Backend> {
    mean: Tensor<B, 1>,
    square: Tensor<B, 1>,
}

impl<B: Backend> AdamW<B> {
    /// An optimiser that has seen nothing.
    pub fn new(params: AdamWParams) -> Self {
        Self {
            params,
            steps: 0,
            moments: BTreeMap::new(),
        }
    }

    /// Takes a step against the gradients; returns the module and the length of the gradient before it was
    /// clipped.
    ///
    /// A gradient that is not finite leaves the module as it was.
    pub fn step<A, M>(&mut self, module: M, mut gradients: Gradients<B>, rate: f64) -> (M, f64)
    where
        A: AutodiffBackend<InnerBackend = B>,
        M: Module<A>,
    {
        let norm = gradients.norm();
        if !norm.is_finite() {
            return (module, norm);
        }
        if norm > self.params.max_gradient_norm {
            gradients.scale(self.params.max_gradient_norm / norm);
        }
        self.steps += 1;
        let mut update = Update {
            path: Vec::new(),
            optimizer: self,
            gradients,
            rate,
        };
        (module.map(&mut update), norm)
    }

    /// The state, to be saved: running means of gradients and of their squares by parameter.
    pub fn state(&self) -> BTreeMap<String, [TensorData; 2]> {
        let data = |(path, m): (&String, &Moments<B>)| {
            let pair = [m.mean.clone().into_data(), m.square.clone().into_data()];
            (path.clone(), pair)
        };
        self.moments.iter().map(data).collect()
    }

    /// An optimiser that goes on from a saved state after so many steps.
    pub fn from_state(
        params: AdamWParams,
        moments: BTreeMap<String, [TensorData; 2]>,
        steps: i32,
        device: &Device<B>,
    ) -> Self {
        let moments = moments.into_iter().map(|(path, [mean, square])| {
            let moments = Moments {
                mean: Tensor::from_data(mean, device),
                square: Tensor::from_data(square, device),
            };
            (path, moments)
        });
        Self {
            params,
            steps,
            moments: moments.collect(),
        }
    }

    /// The next value of a parameter, all flattened.
    fn next(
        &mut self,
        path: &str,
        value: Tensor<B, 1>,
        gradient: Tensor<B, 1>,
        rate: f64,
        decay: f64,
    ) -> Tensor<B, 1> {
        let p = &self.params;
        let square = gradient.clone().powi_scalar(2).mul_scalar(1.0 - p.beta_2);
        let mean = gradient.mul_scalar(1.0 - p.beta_1);
        let (mean, square) = match self.moments.remove(path) {
            Some(old) => (
                mean + old.mean.mul_scalar(p.beta_1),
                square + old.square.mul_scalar(p.beta_2),
            ),
            None => (mean, square),
        };
        // The corrections for the start from zero, drawn out of the quotient of the means.
        let mean_correction = 1.0 - p.beta_1.powi(self.steps);
        let root_correction = (1.0 - p.beta_2.powi(self.steps)).sqrt();
        let root = square.clone().sqrt().add_scalar(p.epsilon * root_correction);
        let change = (mean.clone() / root).mul_scalar(rate * root_correction / mean_correction);
        self.moments.insert(path.to_owned(), Moments { mean, square });
        let value = if decay > 0.0 {
            value.mul_scalar(1.0 - rate * decay)
        } else {
            value
        };
        value - change
    }
}

struct Update<'a, B: Backend> {
    path: Vec<String>,
    optimizer: &'a mut AdamW<B>,
    gradients: Gradients<B>,
    rate: f64,
}

impl<A: AutodiffBackend> ModuleMapper<A> for Update<'_, A::InnerBackend> {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<A, D>>) -> Param<Tensor<A, D>> {
        let path = self.path.join(".");
        let (id, tensor, mapper) = param.consume();
        let tensor = match self.gradients.take(&path) {
            None => tensor,
            Some(gradient) => {
                let shape = tensor.shape();
                let decay = if D > 1 {
                    self.optimizer.params.weight_decay
                } else {
                    0.0
                };
                let value = tensor.inner().reshape([shape.num_elements()]);
                let value = self.optimizer.next(&path, value, gradient, self.rate, decay);
                Tensor::from_inner(value.reshape(shape)).require_grad()
            }
        };
        Param::from_mapped_value(id, tensor, mapper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::parameters::parameters;
    use burn::backend::{Autodiff, Flex};
    use burn::nn::{Linear, LinearConfig};

    type A = Autodiff<Flex>;

    fn linear() -> Linear<A> {
        let mut layer = LinearConfig::new(1, 1).init::<A>(&Device::<A>::default());
        layer.weight = layer
            .weight
            .map(|w| w.zeros_like().add_scalar(2.0).require_grad());
        layer
    }

    fn gradients(layer: &Linear<A>, slope: f64) -> Gradients<Flex> {
        let loss = layer.weight.val().mul_scalar(slope).sum();
        Gradients::of::<A, _>(layer, &loss.backward())
    }

    fn weight(layer: &Linear<A>) -> f64 {
        f64::from(parameters(layer)["weight"].iter::<f32>().next().unwrap())
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
        let mut layer = linear();
        // Algorithm 2 by hand, with gradients 2, -1, and 5 that is clipped to 2.5.
        let (mut w, mut m, mut v) = (2.0f64, 0.0, 0.0);
        for (t, slope) in [2.0, -1.0, 5.0].into_iter().enumerate() {
            let g = f64::min(slope, 2.5);
            m = 0.8 * m + 0.2 * g;
            v = 0.9 * v + 0.1 * g * g;
            let t = t as i32 + 1;
            let (m_hat, v_hat) = (m / (1.0 - 0.8f64.powi(t)), v / (1.0 - 0.9f64.powi(t)));
            w -= 0.3 * (m_hat / (v_hat.sqrt() + 0.01) + 0.1 * w);
            let gradients = gradients(&layer, slope);
            let norm;
            (layer, norm) = optimizer.step::<A, _>(layer, gradients, 0.3);
            assert!((norm - slope.abs()).abs() < 1e-6);
            assert!((weight(&layer) - w).abs() < 1e-6, "{} {w}", weight(&layer));
        }
    }

    #[test]
    fn gradients_that_are_not_finite_change_nothing() {
        let mut optimizer = AdamW::new(AdamWParams::default());
        let layer = linear();
        let gradients = gradients(&layer, f64::NAN);
        let (layer, norm) = optimizer.step::<A, _>(layer, gradients, 0.3);
        assert!(norm.is_nan());
        assert_eq!(weight(&layer), 2.0);
    }
}
