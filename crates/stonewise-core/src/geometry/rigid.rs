//! Rigid motions.

/// A rigid motion in metres: `p_b = b_from_a * p_a`.
pub type Rigid3 = nalgebra::Isometry3<f64>;
