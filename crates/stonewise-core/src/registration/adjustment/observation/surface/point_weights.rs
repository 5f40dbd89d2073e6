//! Weights of a stone's points from one fit of its surface to the next.

use super::patch_grid::WeightedPoint;

/// Stored form of full weight.
const FULL: f64 = u8::MAX as f64;

/// Weights of a stone's points, per epoch, by the points' indices; a byte each, as large walls have many points. A
/// stone's points have the same indices whenever they are read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PointWeights([Vec<u8>; 2]);

impl PointWeights {
    /// None are stored.
    pub const NONE: Self = Self([const { Vec::new() }; 2]);

    /// Full weights of this many points of each epoch.
    pub fn full(counts: [usize; 2]) -> Self {
        Self(counts.map(|count| vec![u8::MAX; count]))
    }

    /// Sets the weights of these points to the stored ones; where none is stored, a point keeps its weight.
    pub fn apply(&self, epochs: &mut [Vec<WeightedPoint>; 2]) {
        for (weights, points) in self.0.iter().zip(epochs) {
            for point in points {
                if let Some(weight) = weights.get(point.index as usize) {
                    point.weight = f64::from(*weight) / FULL;
                }
            }
        }
    }

    /// Stores the weights of these points. None becomes zero: where all points had no weight, the shares of the epochs
    /// in the motion would not be defined.
    pub fn store(&mut self, epochs: &[Vec<WeightedPoint>; 2]) {
        for (weights, points) in self.0.iter_mut().zip(epochs) {
            for point in points {
                if let Some(weight) = weights.get_mut(point.index as usize) {
                    *weight = (FULL * point.weight).round().max(1.0) as u8;
                }
            }
        }
    }
}
