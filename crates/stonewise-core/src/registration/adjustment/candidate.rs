//! A motion that a stone may have made, followed from iteration to iteration.

use super::observation::surface::Linearisation;
use super::stone_vector::StoneVector;
use nalgebra::Vector3;

/// A step that turns back by more than this cosine shows a stone that swings between two windows or two
/// optima.
const TURNS_BACK: f64 = -0.3;
/// Factor on the share of a step that is taken where the stone swings, and the least share: at 2 % the next
/// iterations still move.
const SHORTER: [f64; 2] = [0.5, 0.02];
/// Factor on the share where it does not swing, so that the full step is back after three such iterations.
const LONGER: f64 = 1.3;

/// How a stone may have moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moving {
    /// It moved as its neighbours predict.
    WithField,
    /// It moved on its own, as loose stones do.
    OnOwn,
}

impl Moving {
    pub fn more_probable(p_with_field: f64) -> Self {
        if p_with_field < 0.5 {
            Self::OnOwn
        } else {
            Self::WithField
        }
    }
}

/// A candidate for a stone's motion: moving with the field, or on its own.
///
/// A stone's likelihood can have several maxima; what the observations say at one must not be read off at
/// another, so each candidate has its own equations.
#[derive(Clone, Debug)]
pub(crate) struct CandidateMotion {
    /// In the stone's frame.
    pub motion: StoneVector,
    /// What the stone's surface says there.
    pub surface: Linearisation,
    last_step: Vector3<f64>,
    share: f64,
}

impl CandidateMotion {
    /// A candidate at this motion, not yet observed.
    pub fn new(motion: StoneVector) -> Self {
        Self {
            motion,
            surface: Linearisation::new(motion),
            last_step: Vector3::zeros(),
            share: 1.0,
        }
    }

    /// Returns to full steps. For use once the weights are frozen: their changes can make a candidate swing.
    pub fn forget_swings(&mut self) {
        self.last_step = Vector3::zeros();
        self.share = 1.0;
    }

    /// Steps towards a motion, not farther than `max_step_m`, less where the stone swings; the length of the
    /// step, metres.
    pub fn move_to(&mut self, target: &StoneVector, max_step_m: f64) -> f64 {
        let mut step = *target - self.motion;
        let length = step.translation().norm();
        if length > max_step_m {
            step = step.scaled(max_step_m / length);
        }
        let (now, before) = (step.translation(), self.last_step);
        self.share = if now.dot(&before) < TURNS_BACK * now.norm() * before.norm() {
            (self.share * SHORTER[0]).max(SHORTER[1])
        } else {
            (self.share * LONGER).min(1.0)
        };
        self.last_step = now;
        self.motion = self.motion + step.scaled(self.share);
        length.min(max_step_m) * self.share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(x: f64) -> StoneVector {
        StoneVector::from_translation(Vector3::new(x, 0.0, 0.0))
    }

    #[test]
    fn steps_are_bounded_and_reach_their_target() {
        let mut stone = CandidateMotion::new(along(0.0));
        let target = along(0.04);
        let lengths: Vec<f64> = (0..3).map(|_| stone.move_to(&target, 0.015)).collect();
        for (length, expected) in lengths.iter().zip([0.015, 0.015, 0.01]) {
            assert!((length - expected).abs() < 1e-15, "{lengths:?}");
        }
        assert!((stone.motion.translation().x - 0.04).abs() < 1e-15);
    }

    #[test]
    fn full_steps_return_once_swings_are_forgotten() {
        let mut stone = CandidateMotion::new(along(0.0));
        for target in [4e-3, 0.0, 4e-3, 0.0] {
            stone.move_to(&along(target), 0.015);
        }
        assert!(stone.share < 0.2, "{}", stone.share);
        stone.forget_swings();
        stone.move_to(&along(9e-3), 0.015);
        assert!((stone.motion.translation().x - 9e-3).abs() < 1e-15);
    }

    #[test]
    fn a_stone_between_two_optima_settles() {
        // Beyond zero the optimum lies at -1 mm, before it at 1 mm: full steps would swing for ever.
        let mut stone = CandidateMotion::new(along(5e-4));
        let mut length = 0.0;
        for _ in 0..40 {
            let side = if stone.motion.translation().x > 0.0 {
                -1e-3
            } else {
                1e-3
            };
            length = stone.move_to(&along(side), 0.015);
        }
        assert!(length < 5e-5, "{length}");
    }
}
