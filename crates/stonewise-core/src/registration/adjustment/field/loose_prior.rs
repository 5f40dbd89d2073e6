//! What is expected of loose stones beforehand.

use super::variance_components::VarianceComponents;

/// The component of the mixture that loose stones belong to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoosePrior {
    /// Expected share of the stones.
    pub share: f64,
    /// Standard deviation of a loose stone's translation beside the field, metres.
    pub move_m: f64,
    /// Standard deviation of its rotation beside the field, radians.
    pub turn_rad: f64,
}

impl LoosePrior {
    /// Variances of a loose stone's own (translation, rotation, bending) in its frame.
    pub fn own_variances(&self, components: &VarianceComponents) -> [f64; 9] {
        let mut own = components.own_variances();
        for k in 0..3 {
            own[k] += self.move_m * self.move_m;
            own[3 + k] += self.turn_rad * self.turn_rad;
        }
        own
    }
}
