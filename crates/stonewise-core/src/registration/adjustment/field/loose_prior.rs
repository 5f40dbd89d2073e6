//! What is expected of loose stones beforehand.

use super::variance_components::VarianceComponents;

/// Loose stones that are expected beforehand tell as much as half a stone that is found (Jeffreys 1946): on a wall of
/// any size the first loose stone must show itself more clearly than the tenth.
const LOOSE_EXPECTED: f64 = 0.5;

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
/// maximisation (Dempster, Laird & Rubin 1977) with a beta prior whose mean is `expected`.
///
/// Never above `expected`: before field and noise have settled, many stones look loose.
pub(crate) fn estimated_share(expected: f64, p_loose: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = p_loose.fold((0.0, 0.0), |(sum, count), p| (sum + p, count + 1.0));
    let share = expected * (LOOSE_EXPECTED + sum) / (LOOSE_EXPECTED + expected * count);
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
        // As 0.5 loose stones of 0.5 / 0.03 would tell.
        let expected = |loose: f64, stones: f64| (0.5 + loose) / (0.5 / 0.03 + stones);
        assert!((share(0, 0) - 0.03).abs() < 1e-15);
        assert!((share(0, 300) - expected(0.0, 300.0)).abs() < 1e-15);
        assert!((share(1, 9700) - expected(1.0, 9700.0)).abs() < 1e-15);
        assert!((share(50, 100) - 0.03).abs() < 1e-15);
    }
}
