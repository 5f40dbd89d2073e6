//! What observations hand over to the adjustment: a quadratic in a stone's motion.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use std::ops::AddAssign;

/// Information that keeps a rotation solvable where no point determines it; far below any that counts.
const RIDGE: f64 = 1e-9;

/// Log likelihood of a stone's observations as a quadratic in its motion x, in the stone's frame:
/// constant + vector' x - x' information x / 2.
///
/// Independent observations of one stone are joined by adding their equations.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    pub information: Matrix6<f64>,
    pub vector: Vector6<f64>,
    /// Log likelihood at motion zero.
    pub constant: f64,
}

impl NormalEquations {
    /// The equations of a stone that nothing observes.
    pub fn nothing() -> Self {
        Self {
            information: Matrix6::zeros(),
            vector: Vector6::zeros(),
            constant: 0.0,
        }
    }

    /// What is observed of the displacement alone, information and vector, with the rotation free. `noise`: covariance of
    /// what the stone does and errs on its own besides.
    pub fn of_displacement(&self, noise: &Matrix3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        let h = &self.information;
        let rest = h.fixed_view::<3, 3>(3, 3).into_owned();
        // Unknowns have different units.
        let scale = rest.diagonal().map(|v| 1.0 / v.max(RIDGE).sqrt());
        let scaled =
            Matrix3::from_fn(|r, c| rest[(r, c)] * scale[r] * scale[c]) + Matrix3::identity() * RIDGE;
        let Some(factor) = scaled.cholesky() else {
            return (Matrix3::zeros(), Vector3::zeros());
        };
        let cross = Matrix3::from_fn(|r, c| h[(3 + r, c)] * scale[r]);
        let pull = Vector3::from_fn(|r, _| self.vector[3 + r] * scale[r]);
        let information = h.fixed_view::<3, 3>(0, 0) - cross.transpose() * factor.solve(&cross);
        let vector = self.vector.fixed_rows::<3>(0) - cross.transpose() * factor.solve(&pull);
        // (I^-1 + N)^-1 = (1 + I N)^-1 I, which holds for a singular I too.
        let information = 0.5 * (information + information.transpose());
        match (Matrix3::identity() + information * noise).try_inverse() {
            Some(share) => {
                let with_noise = share * information;
                (0.5 * (with_noise + with_noise.transpose()), share * vector)
            }
            None => (Matrix3::zeros(), Vector3::zeros()),
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
