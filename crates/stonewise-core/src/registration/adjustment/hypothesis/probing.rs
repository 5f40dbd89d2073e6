//! Search for optima far from the field's motion.
//!
//! A noisy stone that moved by more than the reach of its relief does not show at the field's motion where it
//! went.

use super::likelihood_ratio::Placed;
use crate::registration::adjustment::observation::surface::{
    Equations, LocalPair, PointWeights, SurfaceModel,
};
use crate::registration::adjustment::stone_vector::StoneVector;
use nalgebra::{Matrix6, Vector3};
use std::f64::consts::TAU;

/// Directions in the face in which a stone is tried, 45 degrees apart: neighbouring places are then nearer to
/// each other than to where the stone was.
const DIRECTIONS: usize = 8;
/// A stone that moves with the field is probed if its points leave its motion in the face less certain than this
/// share of what loose stones move: below it the equations at the field's motion reach as far as the stone can have
/// gone.
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
            let there = self
                .surface
                .equations(self.pair, &place, &self.here.window, &PointWeights::NONE);
            let value = self.expected_deviance(&there);
            if value < best.0 {
                best = (value, Some(place));
            }
        }
        best.1
    }

    /// Deviance after a step that the prior of loose stones holds back, and that goes no farther along the face
    /// than half the way to another place: beyond, the equations there say more.
    fn expected_deviance(&self, e: &Equations) -> f64 {
        let held = e.information + Matrix6::identity() * self.inflation / self.move_m.powi(2);
        held.cholesky().map_or(f64::INFINITY, |c| {
            let step = c.solve(&e.gradient);
            let share = (0.5 * self.move_m / step.xy().norm()).min(1.0);
            e.deviance - share * (2.0 - share) * e.gradient.dot(&step)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::observation::surface::{Layout, SurfaceNoise, without_points};
    use nalgebra::{Rotation2, Vector6};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const MOVE_M: f64 = 0.015;
    const NOISE_M: f64 = 0.003;

    fn model() -> SurfaceModel {
        let mut model = SurfaceModel::start(Layout {
            cell_m: 0.02,
            patch_cells: 24,
            outlier_sigmas: 1e9,
        });
        model.noise = SurfaceNoise {
            sigma_m: [NOISE_M; 2],
            tau_m: 0.003,
        };
        model
    }

    /// Two scans of a wavy face of 20 x 20 cm; the second after a motion in the face.
    fn scans(moved: [f64; 2]) -> LocalPair {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut scan = |[du, dv]: [f64; 2]| {
            let point = |_| {
                let (u, v) = (rng.random_range(-0.1..0.1), rng.random_range(-0.1..0.1));
                let noise = NOISE_M * stonewise_testing::normal(&mut rng);
                let height: f64 = 0.006 * ((50.0_f64 * u).sin() + (41.0_f64 * v).cos());
                [u + du, v + dv, height + noise]
            };
            (0..600).map(point).collect::<Vec<_>>()
        };
        let first = scan([0.0; 2]);
        LocalPair::of_points(first, scan(moved))
    }

    fn probe<'a>(pair: &'a LocalPair, surface: &'a SurfaceModel) -> Probe<'a> {
        Probe {
            pair,
            here: Placed {
                motion: StoneVector::zeros(),
                window: StoneVector::zeros(),
            },
            surface,
            inflation: 1.0,
            move_m: MOVE_M,
        }
    }

    #[test]
    fn a_stone_is_found_in_the_direction_in_which_it_went() {
        let surface = model();
        for k in 0..DIRECTIONS {
            let (s, c) = (TAU * k as f64 / DIRECTIONS as f64).sin_cos();
            let truth = Vector3::new(MOVE_M * c, MOVE_M * s, 0.0);
            let pair = scans([truth.x, truth.y]);
            let probe = probe(&pair, &surface);
            let zero = StoneVector::zeros();
            let here = surface.equations(&pair, &zero, &zero, &PointWeights::NONE);
            let found = probe.best(&here).unwrap();
            // The next direction may be as good, because one more step is taken from there.
            let angle = found.translation().angle(&truth);
            assert!(angle < TAU / DIRECTIONS as f64 + 1e-9, "{k}: {angle}");
            let there = surface.equations(&pair, &found, &zero, &PointWeights::NONE);
            let held = there.information + Matrix6::identity() / MOVE_M.powi(2);
            let step = held.cholesky().unwrap().solve(&there.gradient);
            let error = found.translation() - step.fixed_rows::<3>(0) - truth;
            assert!(error.norm() < 0.3 * MOVE_M, "{k}: {error}");
        }
    }

    #[test]
    fn a_stone_that_stayed_is_left_where_it_is() {
        let surface = model();
        let pair = scans([0.0; 2]);
        let zero = StoneVector::zeros();
        let here = surface.equations(&pair, &zero, &zero, &PointWeights::NONE);
        assert_eq!(probe(&pair, &surface).best(&here), None);
    }

    #[test]
    fn a_stone_is_open_between_two_standard_deviations_in_the_face() {
        let equations = |sd_m: [f64; 2], inflation: f64| {
            let turn = *Rotation2::new(0.7).matrix();
            let diagonal = nalgebra::Matrix2::from_diagonal(&sd_m.map(|s| inflation * s.powi(-2)).into());
            let mut equations = without_points();
            let inside = turn * diagonal * turn.transpose();
            equations
                .information
                .fixed_view_mut::<2, 2>(0, 0)
                .copy_from(&inside);
            // What is known out of the face does not count.
            equations.information[(2, 2)] = 1e12;
            equations
        };
        for inflation in [1.0, 4.0] {
            let is_open = |sd_m: [f64; 2]| Probe::is_open(&equations(sd_m, inflation), inflation, MOVE_M);
            assert!(is_open([0.9 * MOVE_M, 1e-4]), "the less certain axis decides");
            assert!(is_open([0.11 * MOVE_M, 1e-4]));
            assert!(!is_open([0.09 * MOVE_M, 1e-4]), "certain");
            assert!(!is_open([1.1 * MOVE_M, 1e-4]), "nothing is known");
        }
    }

    #[test]
    fn the_expected_deviance_is_the_least_of_the_held_quadratic() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let root = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let mut equations = without_points();
        equations.information = root * root.transpose() * 1e4;
        equations.gradient = Vector6::from_fn(|_, _| rng.random_range(-3.0..3.0));
        equations.deviance = 17.0;
        let (pair, surface) = (scans([0.0; 2]), model());
        let mut probe = probe(&pair, &surface);
        probe.inflation = 3.0;
        // Coordinate by coordinate, the quadratic is minimised without a factorisation.
        let held = equations.information + Matrix6::identity() * (3.0 / MOVE_M.powi(2));
        let mut x = Vector6::zeros();
        for _ in 0..2000 {
            for k in 0..6 {
                x[k] -= (equations.gradient[k] + held.row(k).dot(&x.transpose())) / held[(k, k)];
            }
        }
        let least = equations.deviance + 2.0 * equations.gradient.dot(&x) + x.dot(&(held * x));
        let found = probe.expected_deviance(&equations);
        assert!((found - least).abs() < 1e-9 * least.abs(), "{found} {least}");
    }
}
