//! Equations for tests.

use super::equations::Equations;

/// The equations of a stone without points.
pub(crate) fn without_points() -> Equations {
    Equations::zeros(1.0)
}
