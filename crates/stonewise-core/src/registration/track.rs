//! A motion at which a stone's equations are linearised, followed from iteration to iteration.

use super::equations::{Equations, Motion9};
use super::field::StoneTerm;

/// Evaluations in which a stone's points are chosen anew.
const CHOICES: usize = 11;
/// Distance of a stone's rim from its centroid, metres, for judging rotation and bending.
const RIM_M: f64 = 0.2;

/// One motion of a stone with its equations.
#[derive(Clone, Debug)]
pub(super) struct Track {
    /// In the stone's frame.
    pub motion: Motion9,
    /// The motion with which the stone's window moved when points were last chosen.
    window: Motion9,
    choices: usize,
    evaluated: Option<(Motion9, Equations)>,
    last_step: Motion9,
    share: f64,
}

impl Track {
    pub fn new(motion: Motion9) -> Self {
        Self {
            motion,
            window: motion,
            choices: 0,
            evaluated: None,
            last_step: Motion9::zeros(),
            share: 1.0,
        }
    }

    /// The equations last computed.
    pub fn equations(&self) -> Option<&Equations> {
        self.evaluated.as_ref().map(|e| &e.1)
    }

    /// Whether the equations are missing or belong to a motion farther away than this, metres (of the centroid or the rim).
    pub fn is_due(&self, reach_m: f64) -> bool {
        self.evaluated.as_ref().is_none_or(|(at, _)| {
            let d = at - self.motion;
            let turn = RIM_M * d.fixed_rows::<3>(3).norm() + RIM_M * RIM_M * d.fixed_rows::<3>(6).norm();
            d.fixed_rows::<3>(0).norm() + turn > reach_m
        })
    }

    /// The motion with which the stone's window moves at the next evaluation: the stone's, until that is known well enough; then
    /// points no longer come and go, and the iteration settles.
    pub fn window(&self) -> Motion9 {
        if self.choices < CHOICES {
            self.motion
        } else {
            self.window
        }
    }

    pub fn set(&mut self, equations: Equations) {
        self.window = self.window();
        self.choices += 1;
        self.evaluated = Some((self.motion, equations));
    }

    pub fn invalidate(&mut self) {
        self.evaluated = None;
    }

    /// Log likelihood of the points as a quadratic about the motion `origin`, divided by `inflation`.
    pub fn term(&self, origin: &Motion9, inflation: f64) -> StoneTerm {
        let Some((at, e)) = &self.evaluated else {
            return StoneTerm::nothing();
        };
        let x = at - origin;
        let hx = e.information * x;
        StoneTerm {
            information: e.information / inflation,
            vector: (hx - e.gradient) / inflation,
            constant: (-0.5 * e.deviance + e.gradient.dot(&x) - 0.5 * x.dot(&hx)) / inflation,
        }
    }

    /// Steps towards a motion, not further than `max_step_m`, less where the stone swings; the length gone.
    pub fn move_to(&mut self, target: &Motion9, max_step_m: f64) -> f64 {
        let mut step = target - self.motion;
        let length = step.fixed_rows::<3>(0).norm();
        if length > max_step_m {
            step *= max_step_m / length;
        }
        let (now, before) = (step.fixed_rows::<3>(0), self.last_step.fixed_rows::<3>(0));
        self.share = if now.dot(&before) < -0.3 * now.norm() * before.norm() {
            (self.share * 0.5).max(0.02)
        } else {
            (self.share * 1.3).min(1.0)
        };
        self.last_step = step;
        self.motion += step * self.share;
        length.min(max_step_m) * self.share
    }
}
