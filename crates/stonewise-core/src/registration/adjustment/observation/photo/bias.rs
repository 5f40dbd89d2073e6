//! The law of the appearance bias.
//!
//! What light, moisture and growth shift on a stone between two epochs has heavier tails than a normal law: a
//! few stones are off by many standard deviations although their photos agree with each other. The bias
//! follows Student's t with two components, written as a normal law whose variance is divided by a weight of
//! the stone (Lange, Little & Taylor 1989). A stone has a weight for each way in which it may have moved: if
//! it moved with the field, its photos may imply an improbably large bias; if on its own, perhaps none.

use crate::registration::adjustment::candidate::Moving;

/// Degrees of freedom of Student's t. The log likelihood of the photos' errors on ten simulated walls (1,427
/// stones) is greatest at eight, 33 above that of a normal law; on `dam_small` and the fountain (346 stones) it
/// is 66 above that at eight and 88 at three. With five, moves of many standard deviations that photos show
/// clearly are taken for a bias: of 43 loose stones one more is missed.
const FREEDOM: f64 = 8.0;

/// Factors on the inverse variance of a stone's appearance bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BiasWeights {
    with_field: f64,
    on_own: f64,
}

impl BiasWeights {
    /// The weights of a bias as large as is expected.
    pub const USUAL: Self = Self {
        with_field: 1.0,
        on_own: 1.0,
    };

    /// From the expected squared bias over its variance, for each way of moving; `components`: number of
    /// components of the bias.
    pub fn from_squares(components: f64, square: impl Fn(Moving) -> f64) -> Self {
        let weight = |moving| (FREEDOM + components) / (FREEDOM + square(moving));
        Self {
            with_field: weight(Moving::WithField),
            on_own: weight(Moving::OnOwn),
        }
    }

    pub fn of(&self, moving: Moving) -> f64 {
        match moving {
            Moving::WithField => self.with_field,
            Moving::OnOwn => self.on_own,
        }
    }

    /// Log density of the weight, zero where it is one. Together with the normal law of the bias it makes
    /// Student's t, up to a constant, at the weight that [`Self::from_squares`] gives.
    pub fn log_density(&self, moving: Moving) -> f64 {
        let weight = self.of(moving);
        0.5 * FREEDOM * (weight.ln() - weight + 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::function::gamma::ln_gamma;
    use std::f64::consts::PI;

    #[test]
    fn a_normal_law_with_the_weight_is_students_t() {
        // Density of the t law with two components (Kotz & Nadarajah 2004, eq. 1.1), scale one.
        let t = |square: f64| {
            let half = 0.5 * (FREEDOM + 2.0);
            ln_gamma(half)
                - ln_gamma(0.5 * FREEDOM)
                - (FREEDOM * PI).ln()
                - half * (1.0 + square / FREEDOM).ln()
        };
        let weighted = |square: f64| {
            let weights = BiasWeights::from_squares(2.0, |_| square);
            let w = weights.of(Moving::OnOwn);
            (w / (2.0 * PI)).ln() - 0.5 * w * square + weights.log_density(Moving::OnOwn)
        };
        let constant = weighted(0.0) - t(0.0);
        for square in [0.5, 2.0, 9.0, 100.0, 1e4] {
            let difference = weighted(square) - t(square) - constant;
            assert!(difference.abs() < 1e-9, "{square}: {difference}");
        }
    }

    #[test]
    fn each_way_of_moving_has_its_weight() {
        let weights = BiasWeights::from_squares(2.0, |moving| match moving {
            Moving::WithField => 52.0,
            Moving::OnOwn => 2.0,
        });
        assert_eq!(
            [Moving::WithField, Moving::OnOwn].map(|m| weights.of(m)),
            [1.0 / 6.0, 1.0]
        );
        assert_eq!(weights.log_density(Moving::OnOwn), 0.0);
    }
}
