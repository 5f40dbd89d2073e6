//! What observations hand over to the adjustment: a quadratic in a stone's motion.

use crate::registration::adjustment::stone_vector::{Matrix9, Vector9};
use std::ops::AddAssign;

/// Log likelihood of a stone's observations as a quadratic in its motion x, in the stone's frame:
/// constant + vector' x - x' information x / 2.
///
/// Independent observations of one stone are joined by adding their equations.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    pub information: Matrix9,
    pub vector: Vector9,
    /// Log likelihood at motion zero.
    pub constant: f64,
}

impl NormalEquations {
    /// Of a stone that nothing observes.
    pub fn nothing() -> Self {
        Self {
            information: Matrix9::zeros(),
            vector: Vector9::zeros(),
            constant: 0.0,
        }
    }
}

impl AddAssign for NormalEquations {
    fn add_assign(&mut self, other: Self) {
        self.information += other.information;
        self.vector += other.vector;
        self.constant += other.constant;
    }
}
