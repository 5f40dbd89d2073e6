//! Derivatives of a loss.

use std::collections::BTreeMap;

/// Derivatives with regard to parameters, by name; parameters that the loss does not depend on have none.
#[derive(Clone, Debug, Default)]
pub struct Gradients(BTreeMap<String, Vec<f32>>);

impl Gradients {
    /// Adds those of another batch.
    pub fn add(&mut self, other: Self) {
        for (name, gradient) in other.0 {
            match self.0.get_mut(&name) {
                Some(sum) => sum.iter_mut().zip(gradient).for_each(|(sum, more)| *sum += more),
                None => drop(self.0.insert(name, gradient)),
            }
        }
    }

    /// Multiplies all by a factor.
    pub fn scale(&mut self, factor: f32) {
        let values = self.0.values_mut().flatten();
        values.for_each(|value| *value *= factor);
    }

    /// Length of all taken as one vector; not finite where one of them is not.
    pub fn norm(&self) -> f64 {
        let squares = self.0.values().map(|gradient| {
            let squares = gradient.iter().map(|value| f64::from(*value).powi(2));
            squares.sum::<f64>()
        });
        squares.sum::<f64>().sqrt()
    }

    /// The gradient of a parameter.
    pub fn get(&self, name: &str) -> Option<&[f32]> {
        self.0.get(name).map(Vec::as_slice)
    }
}

impl FromIterator<(String, Vec<f32>)> for Gradients {
    fn from_iter<I: IntoIterator<Item = (String, Vec<f32>)>>(gradients: I) -> Self {
        Self(gradients.into_iter().collect())
    }
}
