//! What is expected of loose stones beforehand.

use super::variance_components::VarianceComponents;

/// So many stones would tell as much of the share of loose stones as is expected beforehand. 300: on a wall
/// of that many stones none of which is loose, half of the expected share is left; on walls of thousands the
/// stones decide.
const STONES_EXPECTED: f64 = 300.0;

/// The component of the mixture that loose stones belong to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoosePrior {
    /// Share of the stones, [estimated](estimated_share).
    pub share: f64,
    /// Standard deviation of a loose stone's translation beside the field, metres.
    pub move_m: f64,
    /// Standard deviation of its rotation beside the field, radians.
    pub turn_rad: f64,
}

impl LoosePrior {
    /// Variances of a loose stone's own (translation, rotation) in its frame.
    pub fn own_variances(&self, components: &VarianceComponents) -> [f64; 6] {
        let mut own = components.own_variances();
        for k in 0..3 {
            own[k] += self.move_m * self.move_m;
            own[3 + k] += self.turn_rad * self.turn_rad;
        }
        own
    }
}

/// Share of loose stones, from the probability of each decided stone to be loose: one step of expectation
/// maximisation (Dempster, Laird & Rubin 1977) with a beta prior whose mode is about `expected`.
///
/// Never above `expected`: before field and noise have settled, many stones look loose.
pub(crate) fn estimated_share(expected: f64, p_loose: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = p_loose.fold((0.0, 0.0), |(sum, count), p| (sum + p, count + 1.0));
    let share = (STONES_EXPECTED * expected + sum) / (STONES_EXPECTED + count);
    share.min(expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_follows_the_stones_down_but_not_up() {
        let share = |loose: usize, stones: usize| {
            estimated_share(0.03, (0..stones).map(|i| f64::from(u8::from(i < loose))))
        };
        assert!((share(0, 0) - 0.03).abs() < 1e-15);
        assert!((share(0, 300) - 0.015).abs() < 1e-15);
        assert!((share(1, 9700) - 0.001).abs() < 1e-15);
        assert!((share(50, 100) - 0.03).abs() < 1e-15);
    }
}
