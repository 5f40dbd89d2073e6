//! A stone's equations linearised at one of its motions, kept from iteration to iteration.

use super::equations::Equations;
use super::point_weights::PointWeights;
use crate::registration::adjustment::observation::normal_equations::NormalEquations;
use crate::registration::adjustment::stone_vector::StoneVector;

/// Evaluations in which a stone's points are chosen anew. Noise and variance components are estimated in the
/// first eight iterations; from then on motions change by less than a window's border, and points that come
/// and go would keep the iteration from settling.
const CHOICES: usize = 11;
/// The equations of a stone's surface at one of its motions, and the window in which its points count.
#[derive(Clone, Debug)]
pub(crate) struct Linearisation {
    /// The motion with which the stone's window moved when points were last chosen.
    window: StoneVector,
    choices: usize,
    /// Weights of the points at the last exact evaluation.
    weights: PointWeights,
    /// The motion at which the equations were evaluated, and the equations.
    evaluated: Option<(StoneVector, Equations)>,
}

impl Linearisation {
    /// The linearisation of a stone at this motion, not yet evaluated.
    pub fn new(motion: StoneVector) -> Self {
        Self {
            window: motion,
            choices: 0,
            weights: PointWeights::NONE,
            evaluated: None,
        }
    }

    /// The equations last computed.
    pub fn equations(&self) -> Option<&Equations> {
        self.evaluated.as_ref().map(|e| &e.1)
    }

    /// Weights with which the points start at the next evaluation, for the stone at `motion`.
    pub fn weights(&self, motion: &StoneVector) -> &PointWeights {
        static NONE: PointWeights = PointWeights::NONE;
        match &self.evaluated {
            Some((at, _)) if at.is_alike(motion) => &self.weights,
            _ => &NONE,
        }
    }

    /// Whether the equations are missing or belong to a motion farther away than this, metres.
    pub fn is_due(&self, motion: &StoneVector, reach_m: f64) -> bool {
        self.evaluated
            .as_ref()
            .is_none_or(|(at, _)| at.distance_m(motion) > reach_m)
    }

    /// The motion with which the window moves at the next evaluation, for the stone at `motion`: the stone's,
    /// until that is known well enough; then points no longer come and go, and the iteration settles.
    pub fn window(&self, motion: &StoneVector) -> StoneVector {
        if self.choices < CHOICES {
            *motion
        } else {
            self.window
        }
    }

    /// Takes over equations that were evaluated at `motion`.
    pub fn set(&mut self, motion: StoneVector, mut equations: Equations) {
        self.weights = std::mem::replace(&mut equations.weights, PointWeights::NONE);
        self.window = self.window(&motion);
        self.choices += 1;
        self.evaluated = Some((motion, equations));
    }

    /// Forgets the equations and the weights of the points: the noise they were evaluated with has changed.
    pub fn invalidate(&mut self) {
        self.weights = PointWeights::NONE;
        self.evaluated = None;
    }

    /// Log likelihood of the points as a quadratic about the motion `origin`, divided by `inflation`.
    pub fn normal_equations(&self, origin: &StoneVector, inflation: f64) -> NormalEquations {
        let Some((at, e)) = &self.evaluated else {
            return NormalEquations::nothing();
        };
        let x = *(*at - *origin).unknowns();
        let hx = e.information * x;
        NormalEquations {
            information: e.information / inflation,
            vector: (hx - e.gradient) / inflation,
            constant: (-0.5 * e.deviance + e.gradient.dot(&x) - 0.5 * x.dot(&hx)) / inflation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::observation::surface::testing::without_points;
    use nalgebra::{Matrix6, Vector3, Vector6};

    fn at(x: f64) -> StoneVector {
        StoneVector::from_translation(Vector3::new(x, 0.0, 0.0))
    }

    /// Equations whose log likelihood is -(x - optimum)' H (x - optimum) / 2 - 1, evaluated at `motion`.
    fn quadratic(motion: &StoneVector, optimum: &Vector6<f64>, information: Matrix6<f64>) -> Equations {
        let apart = motion.unknowns() - optimum;
        Equations {
            information,
            gradient: information * apart,
            deviance: apart.dot(&(information * apart)) + 2.0,
            ..without_points()
        }
    }

    #[test]
    fn a_quadratic_is_the_same_about_any_origin() {
        let m = Matrix6::from_fn(|r, c| ((r * 7 + c * 3) % 5) as f64 - 2.0);
        let information = m * m.transpose() + Matrix6::identity() * 10.0;
        let optimum = Vector6::from_fn(|k, _| 0.1 * k as f64 - 0.3);
        let motion = at(0.2);
        let mut linear = Linearisation::new(motion);
        linear.set(motion, quadratic(&motion, &optimum, information));
        for origin in [StoneVector::zeros(), at(-0.4)] {
            let e = linear.normal_equations(&origin, 2.0);
            let peak = e.information.try_inverse().unwrap() * e.vector;
            assert!((peak + origin.unknowns() - optimum).norm() < 1e-9);
            let highest = e.constant + 0.5 * peak.dot(&e.vector);
            assert!((highest + 0.5).abs() < 1e-9, "{highest}");
        }
    }

    #[test]
    fn equations_are_due_once_the_stone_has_left_them() {
        let mut linear = Linearisation::new(at(0.0));
        assert!(linear.is_due(&at(0.0), 1e-3));
        linear.set(at(0.0), without_points());
        assert!(!linear.is_due(&at(0.9e-3), 1e-3) && linear.is_due(&at(1.1e-3), 1e-3));
        let turned = StoneVector::from(Vector6::from_fn(|k, _| if k == 4 { 6e-3 } else { 0.0 }));
        assert!(linear.is_due(&turned, 1e-3));
        linear.invalidate();
        assert!(linear.is_due(&at(0.0), 1e-3) && linear.equations().is_none());
        assert_eq!(linear.normal_equations(&at(0.0), 1.0).constant, 0.0);
    }

    #[test]
    fn the_window_follows_the_stone_until_its_points_are_chosen_for_good() {
        let mut linear = Linearisation::new(at(0.0));
        for k in 0..CHOICES {
            let motion = at(k as f64);
            assert_eq!(linear.window(&motion), motion);
            linear.set(motion, without_points());
        }
        assert_eq!(linear.window(&at(99.0)), at((CHOICES - 1) as f64));
    }

    #[test]
    fn weights_hold_near_the_motion_until_the_noise_changes() {
        let weights = PointWeights::full([3, 2]);
        let equations = Equations {
            weights: weights.clone(),
            ..without_points()
        };
        let mut linear = Linearisation::new(at(0.0));
        assert_eq!(linear.weights(&at(0.0)), &PointWeights::NONE);
        linear.set(at(0.0), equations);
        assert_eq!(linear.weights(&at(0.0005)), &weights);
        assert_eq!(linear.weights(&at(0.002)), &PointWeights::NONE);
        linear.invalidate();
        assert_eq!(linear.weights(&at(0.0)), &PointWeights::NONE);
    }
}
