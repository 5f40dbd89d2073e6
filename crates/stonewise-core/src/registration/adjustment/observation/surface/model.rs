//! The model under which the stones' points are observations of their motions: noise, cells and correlation.

use super::correlation::{Correlation, shared_variance, stone_factor, stone_slope_factor};
use super::discount::discounted;
use super::equations::{Equations, FitOptions, equations};
use super::layout::Layout;
use super::linearisation::Linearisation;
use super::local_pair::LocalPair;
use super::point_weights::PointWeights;
use super::surface_noise::SurfaceNoise;
use crate::registration::adjustment::observation::normal_equations::NormalEquations;
use crate::registration::adjustment::stone_vector::StoneVector;

/// Lever by which an error that half a stone shares turns it, metres: that of a block of 40 cm.
const HALF_STONE_M: f64 = 0.1;

/// How exactly stones are evaluated, and how far they may move until they are evaluated again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effort {
    /// Approximately, see [`FitOptions::is_rough`]: noise and variance components change as well.
    Aligning,
    /// Exactly, again once the equations may be wrong by a micrometre, less than any standard deviation.
    Weighing,
    /// Exactly, again once the equations may be wrong by a tenth of the tolerance at which the adjustment has settled.
    Settling,
}

impl Effort {
    /// A stone is evaluated again once its equations, which are those of another motion, may be wrong by this, metres.
    fn linear_m(self) -> f64 {
        match self {
            Self::Aligning | Self::Weighing => 1e-6,
            Self::Settling => 1e-7,
        }
    }
}

/// How all stones' surfaces are observed.
pub(crate) struct SurfaceModel {
    pub noise: SurfaceNoise,
    pub layout: Layout,
    pub correlation: Correlation,
    pub effort: Effort,
}

/// The linearisations of one stone: moving with the field, and on its own where that is followed.
#[derive(Clone, Copy)]
pub(crate) struct StoneSurface<'a> {
    pub with_field: &'a Linearisation,
    pub on_own: Option<&'a Linearisation>,
    /// How many unknowns the stone's own points determine.
    pub effective_freedom: f64,
}

/// Factors on the variances of a stone's motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inflation {
    pub all: f64,
    /// Factor for the motion in the face; counts where it is larger.
    pub in_face: f64,
}

impl SurfaceModel {
    /// The model of points with independent noise of 3 mm on stones with a roughness of 1 mm over a cell: the estimate
    /// starts there.
    pub fn start(layout: Layout) -> Self {
        Self {
            noise: SurfaceNoise {
                sigma_m: [0.003; 2],
                tau_m: 0.001,
            },
            layout,
            correlation: Correlation::NONE,
            effort: Effort::Settling,
        }
    }

    /// Whether equations no longer hold at `motion`: they are quadratic, and their error grows with the
    /// square of the distance, in units of the surface's cells.
    pub fn is_due(&self, linearisation: &Linearisation, motion: &StoneVector) -> bool {
        linearisation.is_due(motion, (self.effort.linear_m() * self.layout.cell_m).sqrt())
    }

    /// The equations of a stone at `motion`. `weights`: those with which the fits of its surface start.
    pub fn equations(
        &self,
        pair: &LocalPair,
        motion: &StoneVector,
        window: &StoneVector,
        weights: &PointWeights,
    ) -> Equations {
        let options = FitOptions {
            is_rough: self.effort == Effort::Aligning,
            weights,
        };
        equations(pair, motion, window, &self.noise, &self.layout, &options)
    }

    /// What a stone's points say as a quadratic about `origin`. `error_m`: error of the motion in the face
    /// that no number of points averages away.
    pub fn normal_equations(
        &self,
        linearisation: &Linearisation,
        origin: &StoneVector,
        inflation: Inflation,
        error_m: f64,
    ) -> NormalEquations {
        let equations = linearisation.normal_equations(origin, inflation.all);
        discounted(equations, inflation.in_face / inflation.all, error_m)
    }

    /// Factors on a stone's variances for correlation between its points.
    pub fn inflation(&self, stone: StoneSurface) -> Inflation {
        let slopes = self.correlation.slopes;
        Inflation {
            all: self.inflation_of_all(stone),
            in_face: stone.at_better(|e| stone_slope_factor(e, slopes)),
        }
    }

    /// [`Inflation::all`] alone.
    pub fn inflation_of_all(&self, stone: StoneSurface) -> f64 {
        let survey = &self.correlation;
        survey.factor() * stone.at_better(|e| stone_factor(e, stone.effective_freedom, survey))
    }

    /// Variances of errors that all points of a stone share, beyond what its own cells show: translation,
    /// rotation.
    ///
    /// `octaves` of length, from the size of a stone up, over which they add; `systematic_share`: of a
    /// point's noise that no number of points averages away.
    pub fn shared_variances(&self, stones: &[&Equations], octaves: f64, systematic_share: f64) -> [f64; 6] {
        let shared = shared_variance(stones, &self.correlation);
        let noise = self.noise.sigma_m;
        let bias = systematic_share.powi(2) * 0.5 * (noise[0].powi(2) + noise[1].powi(2));
        let turn = shared / (HALF_STONE_M * HALF_STONE_M);
        let shift = octaves * shared;
        [shift, shift, shift + bias, turn, turn, turn]
    }
}

impl StoneSurface<'_> {
    /// The least of a figure at a stone's motions: at the wrong one the epochs disagree, whatever the noise.
    fn at_better(&self, figure: impl Fn(&Equations) -> f64) -> f64 {
        let least = [Some(self.with_field), self.on_own]
            .into_iter()
            .flatten()
            .filter_map(Linearisation::equations)
            .map(figure)
            .fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 1.0 }
    }
}
