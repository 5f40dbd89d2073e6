//! Search for optima far from the field's motion.
//!
//! A noisy stone that moved by more than the reach of its relief does not show at the field's motion where it
//! went.

use super::likelihood_ratio::Placed;
use crate::registration::adjustment::observation::surface::{Equations, LocalPair, SurfaceModel};
use crate::registration::adjustment::stone_vector::{Matrix9, StoneVector};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Directions in the face in which a stone is tried, 45 degrees apart: neighbouring places are then nearer to
/// each other than to where the stone was.
const DIRECTIONS: usize = 8;
/// A stone is probed if its points leave its motion in the face less certain than this share of what loose
/// stones move: below it the equations at the field's motion reach as far as the stone can have gone.
const OPEN_SHARE: f64 = 0.1;

/// A stone that is tried at a distance.
pub(crate) struct Probe<'a> {
    pub pair: &'a LocalPair,
    /// Where it is, and where its window is; the window stays, so that the same points count everywhere.
    pub here: Placed,
    pub surface: &'a SurfaceModel,
    /// Factor on the points' variances.
    pub inflation: f64,
    /// Distance at which it is tried: how far loose stones typically move, metres.
    pub move_m: f64,
}

impl Probe<'_> {
    /// Whether a stone's points alone leave its motion in the face uncertain by a share of what loose stones
    /// move, and yet say something about it.
    pub fn is_open(equations: &Equations, inflation: f64, move_m: f64) -> bool {
        let least = move_m.powi(-2);
        let known = equations
            .information
            .fixed_view::<2, 2>(0, 0)
            .symmetric_eigenvalues()
            .min()
            / inflation;
        known > least && known < least * OPEN_SHARE.powi(-2)
    }

    /// The place, of those tried, where the stone's points are best explained after one more step; `None` if
    /// that is where it is.
    ///
    /// `equations`: those here. Cost: eight evaluations.
    pub fn best(&self, equations: &Equations) -> Option<StoneVector> {
        let mut best = (self.expected_deviance(equations), None);
        for k in 0..DIRECTIONS {
            let (s, c) = (TAU * k as f64 / DIRECTIONS as f64).sin_cos();
            let step = Vector3::new(self.move_m * c, self.move_m * s, 0.0);
            let place = self.here.motion + StoneVector::from_translation(step);
            let there = self.surface.equations(self.pair, &place, &self.here.window);
            let value = self.expected_deviance(&there);
            if value < best.0 {
                best = (value, Some(place));
            }
        }
        best.1
    }

    /// Deviance after a step that the prior of loose stones holds back.
    fn expected_deviance(&self, e: &Equations) -> f64 {
        let held = e.information + Matrix9::identity() * self.inflation / self.move_m.powi(2);
        held.cholesky().map_or(f64::INFINITY, |c| {
            e.deviance - e.gradient.dot(&c.solve(&e.gradient))
        })
    }
}
