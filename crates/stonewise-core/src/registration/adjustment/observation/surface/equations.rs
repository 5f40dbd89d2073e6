//! The normal equations of one stone's motion, from its own points of both epochs.
//!
//! Stone frame: origin at the epoch-1 centroid, axes (along, up, out) of the wall around it.

use super::cells::{COMPARE_CELLS, CellSums};
use super::layout::Layout;
use super::local_motion::{LocalMotion, Still};
use super::local_pair::LocalPair;
use super::patch_fit::PatchFit;
use super::patch_grid::{Basis, PatchGrid, WeightedPoint};
use super::patches::{PatchChoice, PatchPoints, pool_into_patches};
use super::point_weights::PointWeights;
use super::robust::{robust_fit, steepness};
use super::slope_scatter::SlopeScatter;
use super::surface_noise::SurfaceNoise;
use crate::linalg::{BandInverse, add_scaled};
use crate::registration::adjustment::stone_vector::StoneVector;
use nalgebra::{Matrix6, Vector6};
use pulp::{Arch, Simd, WithSimd};

/// The normal equations of a stone's points at one of its motions, and figures of how well both epochs agree
/// there.
#[derive(Clone, Debug)]
pub(crate) struct Equations {
    /// Information matrix.
    pub information: Matrix6<f64>,
    /// Gradient of half the squared residuals; the step solves `information * step = -gradient`.
    pub gradient: Vector6<f64>,
    /// Minus twice the log likelihood of the points, one per point taken off; points outside count nothing.
    pub deviance: f64,
    /// Share of the small cells of the larger face that hold points of both epochs.
    pub overlap: f64,
    /// Per small cell seen by both: squared difference of the mean residuals over its expected variance.
    pub differences: Vec<f64>,
    /// Squared differences as in `differences`, for quarters of the patches.
    pub coarse_differences: Vec<f64>,
    /// Expected variances behind `coarse_differences`, m^2.
    pub coarse_variances: Vec<f64>,
    /// Scatter of the motions along u and v that the cells' slopes give.
    pub slopes: [SlopeScatter; 2],
    /// Root mean square of the second epoch's residuals, metres.
    pub rms_m: f64,
    /// Number of points, per epoch.
    pub points: [usize; 2],
    /// Sum of the points' distances from the surface, outliers and all, in units of sigma, per epoch.
    pub distances: [f64; 2],
    /// Weights of the points that were fitted.
    pub weights: PointWeights,
}

impl Equations {
    /// The equations of no points; `overlap` as in the struct.
    pub(super) fn zeros(overlap: f64) -> Self {
        Self {
            information: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            deviance: 0.0,
            overlap,
            differences: Vec::new(),
            coarse_differences: Vec::new(),
            coarse_variances: Vec::new(),
            slopes: [SlopeScatter::default(); 2],
            rms_m: 0.0,
            points: [0; 2],
            distances: [0.0; 2],
            weights: PointWeights::NONE,
        }
    }
}

/// Weight of the points of an epoch that a cell needs: the mean of fewer is not yet normal.
const CELL_POINTS: f64 = 3.0;
/// Sum of weight times squared slope of the points of an epoch that a cell needs at least: ten points with slopes of 1
/// %. Less shows no motion in the face.
const LEAST_SLOPE: f64 = 1e-3;

/// How a stone's surface is fitted.
pub(crate) struct FitOptions<'a> {
    /// Whether an approximate gradient suffices, because the stone is still being aligned: of a face of more than two
    /// patches only every second one is used, as in a chessboard, the gradient of the determinant is left out, and no
    /// weights are stored.
    pub is_rough: bool,
    /// Weights with which the points start.
    pub weights: &'a PointWeights,
}

impl FitOptions<'static> {
    /// Exact, from full weights.
    pub const EXACT: Self = Self {
        is_rough: false,
        weights: &PointWeights::NONE,
    };
}

/// Normal equations at `motion`, of the points in the stone's window where that moved by `window`, as far as `options`
/// use them. Cost: points, plus coefficients times patch width squared.
pub(crate) fn equations(
    pair: &LocalPair,
    motion: &StoneVector,
    window: &StoneVector,
    noise: &SurfaceNoise,
    layout: &Layout,
    options: &FitOptions,
) -> Equations {
    let noise = &noise.of_stone(&pair.noise);
    let motion = LocalMotion::new(motion);
    let choice = match options.is_rough {
        true => PatchChoice::EverySecond,
        false => PatchChoice::All,
    };
    let patches = pool_into_patches(pair, &motion, &LocalMotion::new(window), noise, layout, choice);
    let mut sum = Equations::zeros(patches.overlap);
    let mut squares = 0.0;
    if !options.is_rough {
        sum.weights = PointWeights::full(pair.counts());
    }
    let setting = Setting {
        motion: &motion,
        still: patches.still,
        noise,
        layout,
        is_rough: options.is_rough,
    };
    for mut patch in patches.list {
        options.weights.apply(&mut patch.epochs);
        squares += setting.add_patch(patch, &mut sum);
    }
    if sum.points[1] > 0 {
        sum.rms_m = noise.sigma_m[1] * (squares / sum.points[1] as f64).sqrt();
    }
    sum
}

/// [`Equations::deviance`] alone, at `motion`, of all of these points.
pub(crate) fn deviance(pair: &LocalPair, motion: &StoneVector, noise: &SurfaceNoise, layout: &Layout) -> f64 {
    let noise = &noise.of_stone(&pair.noise);
    let motion = LocalMotion::new(motion);
    let of_patch = |PatchPoints { grid, mut epochs, .. }| {
        robust_fit(grid, &mut epochs, noise, layout).map_or(0.0, |fit| {
            let of_points = |(points, sigma): (&Vec<WeightedPoint>, f64)| {
                fit.square_sum(points, sigma) - points.len() as f64
            };
            fit.surface_deviance(noise) + epochs.iter().zip(noise.sigma_m).map(of_points).sum::<f64>()
        })
    };
    pool_into_patches(pair, &motion, &motion, noise, layout, PatchChoice::All)
        .list
        .into_iter()
        .map(of_patch)
        .sum()
}

/// At which motion and with which noise the patches of a stone are evaluated.
struct Setting<'a> {
    motion: &'a LocalMotion,
    still: Still,
    noise: &'a SurfaceNoise,
    layout: &'a Layout,
    is_rough: bool,
}

impl Setting<'_> {
    /// Adds what a patch says to the equations; the sum of the second epoch's weighted squared residuals, in units of
    /// sigma.
    fn add_patch(&self, PatchPoints { grid, mut epochs, .. }: PatchPoints, sum: &mut Equations) -> f64 {
        let noise = self.noise;
        let Some(fit) = robust_fit(grid, &mut epochs, noise, self.layout) else {
            return 0.0;
        };
        sum.weights.store(&epochs);
        let shares = Shares::new(&grid, &epochs, noise);
        let mut coupling = vec![[0.0; 6]; grid.coefficient_count()];
        let mut cells = PatchCells::new(&grid, self.layout.cell_m);
        let inverse = (!self.is_rough).then(|| fit.factor.inverse());
        let squares = [0, 1].map(|epoch| {
            Arch::new().dispatch(EpochPoints {
                setting: self,
                epoch,
                points: &epochs[epoch],
                fit: &fit,
                inverse: inverse.as_ref(),
                shares: &shares,
                coupling: &mut coupling,
                cells: &mut cells,
                sum,
            })
        });
        sum.deviance += fit.surface_deviance(noise) - epochs.iter().map(Vec::len).sum::<usize>() as f64;
        take_off_surface(&fit, coupling, &mut sum.information);
        cells.finish(noise, sum);
        squares[1]
    }

    #[inline(always)]
    fn jacobian(&self, point: &WeightedPoint, slopes: [f64; 2]) -> [f64; 6] {
        self.motion.jacobian(self.still, &point.position, slopes)
    }
}

/// The points of an epoch on a patch, and the sums to which they are added. The loop is compiled for the widest vectors
/// of the processor.
struct EpochPoints<'a> {
    setting: &'a Setting<'a>,
    epoch: usize,
    points: &'a [WeightedPoint],
    fit: &'a PatchFit,
    /// Inverse of the fit's factor; `None` in a rough evaluation.
    inverse: Option<&'a BandInverse>,
    shares: &'a Shares,
    coupling: &'a mut [[f64; 6]],
    cells: &'a mut PatchCells,
    sum: &'a mut Equations,
}

impl WithSimd for EpochPoints<'_> {
    /// Sum of the weighted squared residuals, in units of sigma.
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Self {
            setting,
            epoch,
            fit,
            sum,
            ..
        } = self;
        let sigma = setting.noise.sigma_m[epoch];
        let mut squares = 0.0;
        for o in self.points {
            let [h, hu, hv] = fit.surface::<S>(&o.basis);
            let r = o.position[2] - h;
            self.cells.add(epoch, o, r, [hu, hv]);
            sum.points[epoch] += 1;
            sum.distances[epoch] += r.abs() * steepness([hu, hv]).sqrt() / sigma;
            let square = o.weight * r * r / (sigma * sigma);
            squares += square;
            sum.deviance += square;
            let w = o.weight / (sigma * sigma);
            let share = self.shares.of::<S>(epoch, &o.basis);
            let jacobian = setting.jacobian(o, [hu, hv]);
            let gradient = &mut sum.gradient.data.0[0];
            add_scaled::<S, _>(gradient, share * w * r, &jacobian);
            if let Some(inverse) = self.inverse {
                // The surface follows each point a little, most at the edge of the points, and takes the slope
                // with it: residuals and slopes are correlated by minus this covariance, which the gradient of
                // the determinant makes good. The jacobian is affine in the slopes: what their covariance adds to it
                // is the difference of two.
                let [with_u, with_v] = fit.slope_covariance::<S>(&o.basis, inverse);
                let tilted = setting.jacobian(o, [hu + with_u, hv + with_v]);
                add_scaled::<S, _>(gradient, -(share * w), &tilted);
                add_scaled::<S, _>(gradient, share * w, &jacobian);
            }
            o.basis.scatter::<S, _>(share * w, &jacobian, self.coupling);
            add_square::<S>(&mut sum.information, share * share * w, &jacobian);
        }
        squares
    }
}

/// Adds `weight * row' * row` to the lower triangle of a matrix; what is above the diagonal is set by
/// [`take_off_surface`].
#[inline(always)]
fn add_square<S: Simd>(matrix: &mut Matrix6<f64>, weight: f64, row: &[f64; 6]) {
    for (c, (column, value)) in matrix.data.0.iter_mut().zip(row).enumerate() {
        // From the third column on, the last four entries hold all that is below the diagonal.
        match (column.last_chunk_mut::<4>(), row.last_chunk()) {
            (Some(tail), Some(values)) if c > 1 => add_scaled::<S, _>(tail, weight * value, values),
            _ => add_scaled::<S, _>(column, weight * value, row),
        }
    }
}

/// How the epochs share the stone's motion at each place of a patch: each takes the more of it, the less its
/// points weigh there.
///
/// What matters is the motion of one epoch against the other. Shared like this, what the surface cannot follow
/// and both epochs show alike, at joints and rims, weighs the same in both and drops out, however different
/// their noises and spacings; the surface takes no part in the motion; and where only one epoch has points,
/// they say nothing.
struct Shares {
    /// Sums of the points' weights about each coefficient, per epoch.
    weights: [Vec<[f64; 1]>; 2],
}

impl Shares {
    fn new(grid: &PatchGrid, epochs: &[Vec<WeightedPoint>; 2], noise: &SurfaceNoise) -> Self {
        let weights = [0, 1].map(|epoch| {
            let sums = vec![[0.0]; grid.coefficient_count()];
            let (points, sigma) = (&epochs[epoch], noise.sigma_m[epoch]);
            Arch::new().dispatch(WeightSums { points, sigma, sums })
        });
        Self { weights }
    }

    /// By how much of the motion a point of an epoch moves: the later one with it, the first one against it.
    #[inline(always)]
    fn of<S: Simd>(&self, epoch: usize, basis: &Basis) -> f64 {
        let first = basis.gather::<S>(&self.weights[0]);
        let second = basis.gather::<S>(&self.weights[1]);
        match epoch {
            0 => -second / (first + second),
            _ => first / (first + second),
        }
    }
}

/// Adds up the weights of points about each coefficient.
struct WeightSums<'a> {
    points: &'a [WeightedPoint],
    sigma: f64,
    sums: Vec<[f64; 1]>,
}

impl WithSimd for WeightSums<'_> {
    type Output = Vec<[f64; 1]>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Vec<[f64; 1]> {
        for point in self.points {
            let weight = point.weight / (self.sigma * self.sigma);
            point.basis.scatter::<S, _>(weight, &[1.0], &mut self.sums);
        }
        self.sums
    }
}

/// The surface is unknown: what it absorbs is taken off the information (Schur complement).
fn take_off_surface(fit: &PatchFit, mut coupling: Vec<[f64; 6]>, information: &mut Matrix6<f64>) {
    fit.factor.forward(&mut coupling);
    for row in &coupling {
        let c = Vector6::from(*row);
        information.syger(-1.0, &c, &c, 1.0);
    }
    information.fill_upper_triangle_with_lower_triangle();
}

/// The cells of a patch in which the epochs are compared.
struct PatchCells {
    small: CellSums,
    /// Sums for the slopes along u and v, in the cells of `small`.
    slopes: [CellSums; 2],
    /// Quarters of the patch.
    coarse: CellSums,
}

impl PatchCells {
    fn new(grid: &PatchGrid, cell_m: f64) -> Self {
        let cells = |side_m: f64| CellSums::new(grid.low(), grid.high(), side_m);
        let longest = (0..2).map(|a| grid.high()[a] - grid.low()[a]).fold(0.0, f64::max);
        let small = COMPARE_CELLS * cell_m;
        Self {
            small: cells(small),
            slopes: [cells(small), cells(small)],
            coarse: cells(0.5 * longest),
        }
    }

    #[inline(always)]
    fn add(&mut self, epoch: usize, point: &WeightedPoint, residual: f64, slopes: [f64; 2]) {
        let (at, weight) = (&point.position, steepness(slopes));
        if let Some(cell) = self.coarse.cell(at) {
            self.coarse.add(cell, epoch, weight * residual, weight);
        }
        if let Some(cell) = self.small.cell(at) {
            self.small.add(cell, epoch, weight * residual, weight);
            for (cells, slope) in self.slopes.iter_mut().zip(slopes) {
                let w = point.weight * slope;
                cells.add(cell, epoch, w * residual, w * slope);
            }
        }
    }

    fn finish(&self, noise: &SurfaceNoise, sum: &mut Equations) {
        for (difference, variance) in self.small.differences(&noise.sigma_m, CELL_POINTS) {
            sum.differences.push(difference * difference / variance);
        }
        for (difference, variance) in self.coarse.differences(&noise.sigma_m, CELL_POINTS) {
            sum.coarse_differences.push(difference * difference / variance);
            sum.coarse_variances.push(variance);
        }
        for (scatter, cells) in sum.slopes.iter_mut().zip(&self.slopes) {
            for (motion, variance) in cells.differences(&noise.sigma_m, LEAST_SLOPE) {
                scatter.add(motion, 1.0 / variance);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use pulp::Scalar;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::array::from_fn;

    const NOISE: SurfaceNoise = SurfaceNoise {
        sigma_m: [0.004, 0.005],
        tau_m: 0.01,
    };
    const ROUGH: FitOptions = FitOptions {
        is_rough: true,
        ..FitOptions::EXACT
    };
    const LAYOUT: Layout = Layout {
        cell_m: 0.02,
        patch_cells: 24,
        outlier_sigmas: 1e9,
    };

    const WITH_OUTLIERS: Layout = Layout {
        outlier_sigmas: 3.0,
        ..LAYOUT
    };

    /// Two scans of a bumpy face; the second shows another part of it, `beside` metres farther along.
    fn scans(beside: f64) -> LocalPair {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut scan = |sigma: f64, from: f64| {
            (0..400)
                .map(|_| {
                    let (u, v) = (from + rng.random_range(-0.1..0.1), rng.random_range(-0.08..0.08));
                    let noise = sigma * stonewise_testing::normal(&mut rng);
                    [u, v, 0.002 * (40.0 * u).sin() + 0.001 * (55.0 * v).cos() + noise]
                })
                .collect::<Vec<_>>()
        };
        let (first, second) = (scan(NOISE.sigma_m[0], 0.0), scan(NOISE.sigma_m[1], beside));
        LocalPair::of_points(first, second)
    }

    #[test]
    fn the_gradient_is_that_of_the_marginal_likelihood() {
        for beside in [0.0, 0.02] {
            let pair = scans(beside);
            let at = |x: &StoneVector| equations(&pair, x, x, &NOISE, &LAYOUT, &FitOptions::EXACT);
            let here = at(&StoneVector::zeros());
            for k in 0..6 {
                let step = 1e-3 * here.information[(k, k)].sqrt().recip();
                let moved = |by: f64| {
                    let mut x = Vector6::zeros();
                    x[k] = by * step;
                    at(&x.into()).deviance
                };
                let slope = (moved(1.0) - moved(-1.0)) / (4.0 * step);
                let scale = here.information[(k, k)].sqrt();
                // The rotation in the face is seen by steep points most, whose weights are held. Where each
                // epoch shows another part, only the gradient of the part that both show counts.
                let allowed = match (k, beside > 0.0) {
                    (5, _) => 0.35,
                    (_, true) => 0.3,
                    (_, false) => 0.12,
                };
                let difference = (slope - here.gradient[k]).abs() / scale;
                assert!(difference < allowed, "{beside} {k}: {difference}");
            }
        }
    }

    #[test]
    fn no_information_is_negative_however_little_the_epochs_share() {
        for beside in [0.05, 0.1, 0.15, 0.19, 0.3] {
            let pair = scans(beside);
            let x = StoneVector::zeros();
            let information =
                equations(&pair, &x, &x, &NOISE, &WITH_OUTLIERS, &FitOptions::EXACT).information;
            let eigenvalues = information.symmetric_eigenvalues();
            let scale = information.diagonal().max();
            assert!(eigenvalues.min() >= -1e-9 * scale, "{beside}: {eigenvalues}");
        }
    }

    #[test]
    fn exchanged_epochs_of_different_noise_say_the_same_of_the_opposite_motion() {
        let noise = |sigma_m: [f64; 2]| SurfaceNoise { sigma_m, tau_m: 0.01 };
        let pair = scans(0.0);
        let unmoved = LocalMotion::new(&StoneVector::zeros());
        let second = pair.second_in(&unmoved).into_iter().map(|(_, q)| q).collect();
        let exchanged = LocalPair::of_points(second, pair.first.clone());
        let moved = StoneVector::from_translation(Vector3::new(0.004, -0.003, 0.002));
        let back = StoneVector::zeros() - moved;
        let of_pair = equations(
            &pair,
            &moved,
            &moved,
            &noise([0.001, 0.005]),
            &LAYOUT,
            &FitOptions::EXACT,
        );
        let of_exchanged = equations(
            &exchanged,
            &back,
            &back,
            &noise([0.005, 0.001]),
            &LAYOUT,
            &FitOptions::EXACT,
        );

        let apart = (of_pair.deviance - of_exchanged.deviance).abs();
        assert!(apart < 1e-6 * of_pair.deviance.abs(), "{apart}");
        let [one, other] =
            [&of_pair, &of_exchanged].map(|e| e.information.fixed_view::<3, 3>(0, 0).into_owned());
        assert!((one - other).norm() < 1e-6 * one.norm(), "{one} {other}");
        let [one, other] = [&of_pair, &of_exchanged].map(|e| e.gradient.fixed_rows::<3>(0).into_owned());
        assert!((one + other).norm() < 1e-6 * one.norm(), "{one} {other}");
    }

    /// Every tenth point of the second epoch stands out by 0.1 m, as leaves do.
    fn scans_with_outliers() -> LocalPair {
        let pair = scans(0.0);
        let unmoved = LocalMotion::new(&StoneVector::zeros());
        let second = pair.second_in(&unmoved).into_iter();
        let second = second.map(|(i, [u, v, z])| [u, v, if i % 10 == 0 { z + 0.1 } else { z }]);
        LocalPair::of_points(pair.first.clone(), second.collect())
    }

    #[test]
    fn fits_from_stored_weights_say_what_fits_from_full_weights_say() {
        let pair = scans_with_outliers();
        let x = StoneVector::zeros();
        let before = equations(&pair, &x, &x, &NOISE, &WITH_OUTLIERS, &FitOptions::EXACT);
        let x = StoneVector::from_translation(Vector3::new(1e-4, -1e-4, 1e-4));
        let anew = equations(&pair, &x, &x, &NOISE, &WITH_OUTLIERS, &FitOptions::EXACT);
        let options = FitOptions {
            weights: &before.weights,
            ..FitOptions::EXACT
        };
        let from_stored = equations(&pair, &x, &x, &NOISE, &WITH_OUTLIERS, &options);

        let factor = anew.information.cholesky().unwrap();
        let apart = factor.solve(&(from_stored.gradient - anew.gradient));
        for k in 0..6 {
            let sd = factor.inverse()[(k, k)].sqrt();
            assert!(apart[k].abs() < 0.05 * sd, "{k}: {} of {sd}", apart[k]);
        }
        let relative = (from_stored.information - anew.information).norm() / anew.information.norm();
        assert!(relative < 0.02, "{relative}");
        assert_ne!(from_stored.gradient, anew.gradient);
    }

    #[test]
    fn the_lower_triangle_gets_the_square_of_a_row() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let start = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let row: [f64; 6] = from_fn(|_| rng.random_range(-1.0..1.0));
        let mut matrix = start;
        add_square::<Scalar>(&mut matrix, 0.3, &row);
        for r in 0..6 {
            for c in 0..=r {
                assert!((matrix[(r, c)] - start[(r, c)] - 0.3 * row[r] * row[c]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn outliers_keep_their_small_weights() {
        let pair = scans_with_outliers();
        let x = StoneVector::zeros();
        let stored = equations(&pair, &x, &x, &NOISE, &WITH_OUTLIERS, &FitOptions::EXACT).weights;
        let motion = LocalMotion::new(&x);
        let mut patch = pool_into_patches(&pair, &motion, &motion, &NOISE, &WITH_OUTLIERS, PatchChoice::All)
            .list
            .remove(0);
        stored.apply(&mut patch.epochs);
        for point in &patch.epochs[1] {
            let is_outlier = point.index % 10 == 0;
            assert_eq!(
                point.weight < 0.2,
                is_outlier,
                "{}: {}",
                point.index,
                point.weight
            );
        }
    }

    #[test]
    fn half_of_the_patches_lead_to_the_same_motion() {
        let layout = Layout {
            patch_cells: 5,
            ..LAYOUT
        };
        let pair = scans(0.0);
        // The epochs did not move against each other, and the start is half a standard deviation off.
        let x = StoneVector::from_translation(Vector3::new(0.0, 0.0, 2e-4));
        let [exactly, roughly] =
            [FitOptions::EXACT, ROUGH].map(|options| equations(&pair, &x, &x, &NOISE, &layout, &options));
        for epoch in 0..2 {
            let share = roughly.points[epoch] as f64 / exactly.points[epoch] as f64;
            assert!((0.3..0.7).contains(&share), "{share}");
        }
        // Half of the points: half the information out of the face.
        for k in [2, 3, 4] {
            let ratio = exactly.information[(k, k)] / roughly.information[(k, k)];
            assert!((1.3..3.0).contains(&ratio), "{k}: {ratio}");
        }
        let error = |e: &Equations| {
            let step = e.information.cholesky().unwrap().solve(&e.gradient);
            let error = *x.unknowns() - step;
            error.dot(&(e.information * error))
        };
        for square in [&exactly, &roughly].map(error) {
            assert!(square < 25.0, "chi-square of 9: {square}");
        }
        assert_eq!(roughly.weights, PointWeights::NONE);
    }

    #[test]
    fn the_gradient_of_the_determinant_is_all_that_small_faces_lack() {
        let pair = scans(0.0);
        let x = StoneVector::zeros();
        let [exactly, roughly] =
            [FitOptions::EXACT, ROUGH].map(|options| equations(&pair, &x, &x, &NOISE, &LAYOUT, &options));
        assert_eq!(exactly.points, roughly.points);
        assert_eq!(exactly.information, roughly.information);
        assert_ne!(exactly.gradient, roughly.gradient);
    }

    #[test]
    fn points_far_from_all_others_leave_the_equations_finite() {
        let pair = scans(0.0);
        let unmoved = LocalMotion::new(&StoneVector::zeros());
        let mut second: Vec<[f64; 3]> = pair.second_in(&unmoved).into_iter().map(|(_, q)| q).collect();
        // A clump of leaves in front of the face, beyond the reach of the splines of the others.
        second.extend((0..20).map(|k| [0.3, 0.001 * f64::from(k), 0.5 + 0.1 * f64::from(k % 2)]));
        let mut first = pair.first.clone();
        first.push([0.3, 0.0, 0.0]);
        let pair = LocalPair::of_points(first, second);
        let x = StoneVector::zeros();
        let mut weights = PointWeights::NONE;
        for _ in 0..4 {
            let options = FitOptions {
                weights: &weights,
                ..FitOptions::EXACT
            };
            let e = equations(&pair, &x, &x, &NOISE, &WITH_OUTLIERS, &options);
            assert!(
                e.gradient
                    .iter()
                    .chain(e.information.iter())
                    .all(|v| v.is_finite())
            );
            weights = e.weights;
        }
    }
}
