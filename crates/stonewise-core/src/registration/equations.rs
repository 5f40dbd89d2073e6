//! The normal equations of one stone's motion, from its own points of both epochs.
//!
//! Stone frame: origin at the epoch-1 centroid, axes (along, up, out) of the wall around it. Unknowns, nine:
//! translation of the centroid (m), rotation vector (rad) and bending (1/m: second derivatives uu, uv, vv of an
//! out-of-plane distortion; masonry does not bend, but a motion field prescribed for a survey may).

use super::border::Window;
use super::pairs::PairPoints;
use super::patch::{Observation, PatchFit, PatchGrid, SurfaceNoise};
use nalgebra::{Matrix3, Point3, Rotation3, SMatrix, SVector, Vector3};
use std::sync::Arc;

/// Number of unknowns of a stone.
pub(super) const UNKNOWNS: usize = 9;
/// Motion of a stone in its own frame: translation, rotation, bending.
pub(super) type Motion9 = SVector<f64, UNKNOWNS>;
/// A matrix over [`Motion9`].
pub(super) type Matrix9 = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// How the face is cut and how far points are believed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Side of a cell of the surface grid.
    pub cell_m: f64,
    /// Longest side of a patch, in cells.
    pub patch_cells: usize,
    /// Residuals beyond this many sigmas lose weight.
    pub outlier_sigmas: f64,
}

/// Points of both epochs in the stone's frame, the second unmoved.
pub(super) struct LocalPair {
    pub first: Vec<[f64; 3]>,
    /// Those with the stone's label, then those nearby without it.
    second: Vec<[f64; 3]>,
    /// How many of the second have the label.
    labelled: usize,
    /// Where points count, and from the stone's frame to the window's.
    window: Option<(Arc<Window>, Matrix3<f64>)>,
}

impl LocalPair {
    pub fn new(pair: &PairPoints, face_from_world: &Matrix3<f64>) -> Self {
        let local = |cloud: &crate::cloud::Cloud| {
            let shift = cloud.origin() - pair.centroid;
            (0..cloud.len())
                .map(|i| (face_from_world * (cloud.local(i).coords + shift)).into())
                .collect::<Vec<[f64; 3]>>()
        };
        let mut second = local(&pair.points_second);
        let labelled = second.len();
        second.extend(local(&pair.nearby_second));
        Self {
            first: local(&pair.points_first),
            second,
            labelled,
            window: pair
                .window
                .as_ref()
                .map(|w| (w.clone(), w.face_from_world() * face_from_world.transpose())),
        }
    }

    /// The points that count where the window moved by `window`, and no others: of the second epoch those in the window, of both those
    /// whose place in the first epoch `keep` takes.
    pub fn counting(&self, window: &Motion9, keep: impl Fn(&[f64; 3]) -> bool) -> Self {
        let window = Moved::new(window);
        let still = Moved::new(&Motion9::zeros());
        let second: Vec<[f64; 3]> = self
            .second_moved_back(&still, &window)
            .filter(|q| keep(&window.undo(q)))
            .collect();
        Self {
            first: self.first.iter().filter(|p| keep(p)).copied().collect(),
            labelled: second.len(),
            second,
            window: None,
        }
    }

    /// The second epoch's points in the window, where that moved by `window`, moved back by `motion`.
    fn second_moved_back<'a>(
        &'a self,
        motion: &'a Moved,
        window: &'a Moved,
    ) -> impl Iterator<Item = [f64; 3]> + 'a {
        self.second.iter().enumerate().filter_map(move |(i, q)| {
            let counts = self.window.as_ref().is_none_or(|(part, turn)| {
                let at = turn * Vector3::from(window.undo(q));
                part.holds(&Point3::from(at), i < self.labelled)
            });
            counts.then(|| motion.undo(q))
        })
    }
}

/// What a stone's points say about its motion at a given motion.
#[derive(Clone, Debug)]
pub(super) struct Equations {
    /// Information matrix.
    pub information: Matrix9,
    /// Gradient of half the squared residuals; the step solves `information * step = -gradient`.
    pub gradient: Motion9,
    /// Minus twice the log likelihood of the points, one per point taken off; points outside count nothing.
    pub deviance: f64,
    /// Share of the small cells of the smaller face that hold points of both epochs.
    pub overlap: f64,
    /// Per small cell seen by both: squared difference of the mean residuals over its expected variance.
    pub differences: Vec<f64>,
    /// The same for quarters of the patches.
    pub coarse_differences: Vec<f64>,
    /// Expected variances behind `coarse_differences`, m^2.
    pub coarse_variances: Vec<f64>,
    /// Scatter of what the cells' slopes say of a motion along u and v.
    pub slopes: [SlopeScatter; 2],
    /// Root mean square of the second epoch's residuals, metres.
    pub rms_m: f64,
    /// Sum of weighted squared residuals in units of sigma and number of points, per epoch.
    pub scatter: [(f64, f64); 2],
}

/// Sums over a stone's small cells, each of which tells a motion in the face from its own slopes, with the weight of its points.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SlopeScatter {
    weights: f64,
    squares: f64,
    /// Motion times weight, times the square of the weight, and its square times that.
    products: [f64; 3],
}

impl SlopeScatter {
    fn add(&mut self, motion: f64, weight: f64) {
        self.weights += weight;
        self.squares += weight * weight;
        self.products[0] += weight * motion;
        self.products[1] += weight * weight * motion;
        self.products[2] += (weight * motion).powi(2);
    }

    /// Sum of the squared weighted distances from the mean, and what noise alone would make it.
    pub fn sums(&self) -> [f64; 2] {
        if self.weights <= 0.0 {
            return [0.0; 2];
        }
        let [first, second, third] = self.products;
        let mean = first / self.weights;
        let found = third - 2.0 * mean * second + mean * mean * self.squares;
        [found, self.weights - self.squares / self.weights]
    }

    /// How many cells of equal weight would scatter as reliably, less one for the mean.
    pub fn freedom(&self) -> f64 {
        (self.weights * self.weights / self.squares.max(f64::MIN_POSITIVE) - 1.0).max(0.0)
    }
}

/// Points in each epoch that a patch needs to say anything.
const PATCH_POINTS: usize = 12;
/// Weight of the points of an epoch that a cell needs.
const CELL_POINTS: f64 = 3.0;
/// The same, times the square of the slope: less says nothing of motions in the face.
const LEAST_SLOPE: f64 = 1e-3;
/// Side of the small cells in which the epochs are compared, in cells of the surface.
const COMPARE_CELLS: f64 = 4.0;

/// Normal equations at motion `x`, of the points in the stone's window where that moved by `window`. Cost: points, plus coefficients
/// times patch width squared.
pub(super) fn equations(
    pair: &LocalPair,
    x: &Motion9,
    window: &Motion9,
    noise: &SurfaceNoise,
    layout: &Layout,
) -> Equations {
    let motion = Moved::new(x);
    let patches = cut(pair, &motion, &Moved::new(window), layout);
    let mut sum = Equations {
        information: Matrix9::zeros(),
        gradient: Motion9::zeros(),
        deviance: 0.0,
        overlap: patches.overlap,
        differences: Vec::new(),
        coarse_differences: Vec::new(),
        coarse_variances: Vec::new(),
        slopes: [SlopeScatter::default(); 2],
        rms_m: 0.0,
        scatter: [(0.0, 0.0); 2],
    };
    for patch in &patches.list {
        add_patch(patch, &motion, noise, layout, &mut sum);
    }
    if sum.scatter[1].1 > 0.0 {
        sum.rms_m = noise.sigma_m[1] * (sum.scatter[1].0 / sum.scatter[1].1).sqrt();
    }
    sum
}

/// [`Equations::deviance`] alone, at motion `x`, of all of these points.
pub(super) fn deviance(pair: &LocalPair, x: &Motion9, noise: &SurfaceNoise, layout: &Layout) -> f64 {
    let motion = Moved::new(x);
    let of_patch = |patch: &PatchPoints| {
        let mut epochs = patch.epochs.clone();
        robust_fit(patch.grid, &mut epochs, noise, layout).map_or(0.0, |fit| {
            let of_points = |(observations, sigma): (&Vec<Observation>, f64)| -> f64 {
                let of_point = |o: &Observation| {
                    let r = o.position[2] - fit.surface(o.position[0], o.position[1])[0];
                    o.weight * r * r / (sigma * sigma) - 1.0
                };
                observations.iter().map(of_point).sum()
            };
            fit.surface_deviance(noise) + epochs.iter().zip(noise.sigma_m).map(of_points).sum::<f64>()
        })
    };
    cut(pair, &motion, &motion, layout)
        .list
        .iter()
        .map(of_patch)
        .sum()
}

/// A motion ready to be undone.
pub(super) struct Moved {
    translation: Vector3<f64>,
    rotation: Rotation3<f64>,
    bending: [f64; 3],
}

impl Moved {
    pub fn new(x: &Motion9) -> Self {
        Self {
            translation: Vector3::new(x[0], x[1], x[2]),
            rotation: Rotation3::new(Vector3::new(x[3], x[4], x[5])),
            bending: [x[6], x[7], x[8]],
        }
    }

    /// Where a point of the second epoch was in the first; bending is taken off its height.
    pub fn undo(&self, q: &[f64; 3]) -> [f64; 3] {
        let y = self
            .rotation
            .inverse_transform_vector(&(Vector3::from(*q) - self.translation));
        let [uu, uv, vv] = self.bending;
        [
            y.x,
            y.y,
            y.z - 0.5 * (uu * y.x * y.x + 2.0 * uv * y.x * y.y + vv * y.y * y.y),
        ]
    }

    /// Derivative of the residual of a point now at `p`, where the surface has these slopes.
    fn jacobian(&self, p: &[f64; 3], slopes: [f64; 2]) -> [f64; UNKNOWNS] {
        let [u, v, _] = *p;
        let [uu, uv, vv] = self.bending;
        let m = self.rotation
            * Vector3::new(
                -(slopes[0] + uu * u + uv * v),
                -(slopes[1] + uv * u + vv * v),
                1.0,
            );
        let arm = self.rotation * Vector3::new(u, v, p[2]);
        let r = m.cross(&arm);
        [
            -m.x,
            -m.y,
            -m.z,
            r.x,
            r.y,
            r.z,
            -u * u / 2.0,
            -u * v,
            -v * v / 2.0,
        ]
    }
}

/// A piece of the face with the points of both epochs.
pub(super) struct PatchPoints {
    pub grid: PatchGrid,
    pub epochs: [Vec<Observation>; 2],
}

pub(super) struct Patches {
    pub list: Vec<PatchPoints>,
    pub overlap: f64,
}

/// Cuts the face of the first epoch into patches and gives each its points.
pub(super) fn cut(pair: &LocalPair, motion: &Moved, window: &Moved, layout: &Layout) -> Patches {
    let margin = 2.0 * layout.cell_m;
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for p in &pair.first {
        for a in 0..2 {
            low[a] = low[a].min(p[a] - margin);
            high[a] = high[a].max(p[a] + margin);
        }
    }
    if pair.first.is_empty() {
        return Patches {
            list: Vec::new(),
            overlap: 0.0,
        };
    }
    let side = layout.patch_cells.max(4) as f64 * layout.cell_m;
    let count = [0, 1].map(|a| ((high[a] - low[a]) / side).ceil().max(1.0) as usize);
    let step = [0, 1].map(|a| (high[a] - low[a]) / count[a] as f64);
    let mut epochs = vec![[Vec::new(), Vec::new()]; count[0] * count[1]];
    let mut compare = Compare::new(low, high, COMPARE_CELLS * layout.cell_m);
    let moved = pair.second_moved_back(motion, window).map(|p| (1, p));
    for (epoch, p) in pair.first.iter().map(|p| (0, *p)).chain(moved) {
        let at = [0, 1].map(|a| ((p[a] - low[a]) / step[a]).floor());
        compare.count(epoch, &p);
        if (0..2).all(|a| at[a] >= 0.0 && at[a] < count[a] as f64) {
            epochs[at[1] as usize * count[0] + at[0] as usize][epoch].push(Observation {
                position: p,
                weight: 1.0,
            });
        }
    }
    let list = epochs
        .into_iter()
        .enumerate()
        .filter(|(_, e)| e.iter().all(|o| o.len() >= PATCH_POINTS))
        .map(|(k, epochs)| {
            let corner = [
                low[0] + (k % count[0]) as f64 * step[0],
                low[1] + (k / count[0]) as f64 * step[1],
            ];
            let grid = PatchGrid::new(corner, [corner[0] + step[0], corner[1] + step[1]], layout.cell_m);
            PatchPoints { grid, epochs }
        })
        .collect();
    Patches {
        list,
        overlap: compare.overlap(),
    }
}

fn add_patch(
    patch: &PatchPoints,
    motion: &Moved,
    noise: &SurfaceNoise,
    layout: &Layout,
    sum: &mut Equations,
) {
    let mut epochs = patch.epochs.clone();
    let Some(fit) = robust_fit(patch.grid, &mut epochs, noise, layout) else {
        return;
    };
    let mut coupling = vec![[0.0; UNKNOWNS]; patch.grid.coefficient_count()];
    let inverse = fit.factor.inverse();
    let small = || Compare::new(patch.grid.low(), patch.grid.high(), COMPARE_CELLS * layout.cell_m);
    let mut compare = small();
    let mut slopes = [small(), small()];
    let half = 0.5
        * (0..2)
            .map(|a| patch.grid.high()[a] - patch.grid.low()[a])
            .fold(0.0, f64::max);
    let mut coarse = Compare::new(patch.grid.low(), patch.grid.high(), half);
    for (epoch, observations) in epochs.iter().enumerate() {
        let sigma = noise.sigma_m[epoch];
        for o in observations {
            let [u, v, z] = o.position;
            let [h, hu, hv] = fit.surface(u, v);
            let r = z - h;
            let weight = steepness([hu, hv]);
            compare.add(epoch, &o.position, weight * r, weight);
            coarse.add(epoch, &o.position, weight * r, weight);
            for (compare, slope) in slopes.iter_mut().zip([hu, hv]) {
                let w = o.weight * slope;
                compare.add(epoch, &o.position, w * r, w * slope);
            }
            sum.scatter[epoch].0 += o.weight * r * r / (sigma * sigma);
            sum.scatter[epoch].1 += 1.0;
            sum.deviance += o.weight * r * r / (sigma * sigma);
            let w = o.weight / (sigma * sigma);
            let row = motion.jacobian(&o.position, [hu, hv]);
            let j = Motion9::from(row);
            // The surface follows each point a little, most at the edge of the points, and takes the slope with it: residuals and
            // slopes are correlated by minus this covariance, which the gradient of the determinant makes good.
            let bias = motion.jacobian(&o.position, fit.slope_covariance(u, v, &inverse));
            let level = motion.jacobian(&o.position, [0.0; 2]);
            let bias = Motion9::from(bias) - Motion9::from(level);
            // What matters is the motion of one epoch against the other: half a step of each. Where the surface cannot follow the
            // stone, at joints, both epochs' residuals are alike, and that drops out.
            sum.gradient += (j * r - bias) * (w * [-0.5, 0.5][epoch]);
            if epoch == 1 {
                fit.scatter(u, v, w, &row, &mut coupling);
                sum.information.syger(w, &j, &j, 1.0);
            }
        }
    }
    sum.deviance += fit.surface_deviance(noise) - epochs.iter().map(Vec::len).sum::<usize>() as f64;
    // The surface is unknown: what it absorbs is taken off the information (Schur complement).
    fit.factor.forward(&mut coupling);
    for row in &coupling {
        let c = Motion9::from(*row);
        sum.information.syger(-1.0, &c, &c, 1.0);
    }
    sum.information.fill_upper_triangle_with_lower_triangle();
    for (difference, variance) in compare.differences(&noise.sigma_m, CELL_POINTS) {
        sum.differences.push(difference * difference / variance);
    }
    for (difference, variance) in coarse.differences(&noise.sigma_m, CELL_POINTS) {
        sum.coarse_differences.push(difference * difference / variance);
        sum.coarse_variances.push(variance);
    }
    for (scatter, slopes) in sum.slopes.iter_mut().zip(&slopes) {
        for (motion, variance) in slopes.differences(&noise.sigma_m, LEAST_SLOPE) {
            scatter.add(motion, 1.0 / variance);
        }
    }
}

/// Factor on a point's weight where the surface has these slopes: noise goes in all directions, so what counts is the distance from
/// the surface and not that along the height (orthogonal distance regression, Boggs, Byrd & Schnabel 1987). At the steep rims of
/// stones, where a surface of cells also fits worst, points say little.
fn steepness([u, v]: [f64; 2]) -> f64 {
    1.0 / (1.0 + u * u + v * v)
}

/// Fits the surface; points on its steep parts and points far off it lose weight and it is fitted again.
pub(super) fn robust_fit(
    grid: PatchGrid,
    epochs: &mut [Vec<Observation>; 2],
    noise: &SurfaceNoise,
    layout: &Layout,
) -> Option<PatchFit> {
    let mut fit = PatchFit::new(grid, [&epochs[0], &epochs[1]], noise)?;
    for _ in 0..2 {
        let mut changed = false;
        for (observations, sigma) in epochs.iter_mut().zip(noise.sigma_m) {
            let limit = layout.outlier_sigmas * sigma;
            for o in observations {
                let [h, hu, hv] = fit.surface(o.position[0], o.position[1]);
                let steepness = steepness([hu, hv]);
                let r = (o.position[2] - h).abs() * steepness.sqrt();
                let weight = steepness * if r > limit { (limit / r).powi(2) } else { 1.0 };
                changed |= (weight - o.weight).abs() > 0.05;
                o.weight = weight;
            }
        }
        if !changed {
            break;
        }
        fit = PatchFit::new(grid, [&epochs[0], &epochs[1]], noise)?;
    }
    Some(fit)
}

/// Weighted residuals of both epochs in small cells, and the sums of their weights.
struct Compare {
    low: [f64; 2],
    cell_m: f64,
    counts: [usize; 2],
    sums: Vec<[(f64, f64); 2]>,
}

impl Compare {
    fn new(low: [f64; 2], high: [f64; 2], cell_m: f64) -> Self {
        let counts = [0, 1].map(|a| ((high[a] - low[a]) / cell_m).ceil().max(1.0) as usize);
        Self {
            low,
            cell_m,
            counts,
            sums: vec![[(0.0, 0.0); 2]; counts[0] * counts[1]],
        }
    }

    fn add(&mut self, epoch: usize, p: &[f64; 3], product: f64, weight: f64) {
        let at = [0, 1].map(|a| ((p[a] - self.low[a]) / self.cell_m).floor());
        if (0..2).all(|a| at[a] >= 0.0 && at[a] < self.counts[a] as f64) {
            let cell = &mut self.sums[at[1] as usize * self.counts[0] + at[0] as usize][epoch];
            cell.0 += product;
            cell.1 += weight;
        }
    }

    fn count(&mut self, epoch: usize, p: &[f64; 3]) {
        self.add(epoch, p, 0.0, 1.0);
    }

    fn overlap(&self) -> f64 {
        let held = |test: fn(&[(f64, f64); 2]) -> bool| self.sums.iter().filter(|c| test(c)).count() as f64;
        let both = held(|c| c[0].1 > 0.0 && c[1].1 > 0.0);
        both / held(|c| c[0].1 > 0.0).max(1.0)
    }

    /// Per cell to which both give at least this weight: difference of the means, and its expected variance.
    fn differences<'a>(&'a self, sigma_m: &'a [f64; 2], least: f64) -> impl Iterator<Item = (f64, f64)> + 'a {
        self.sums
            .iter()
            .filter(move |c| c.iter().all(|e| e.1 >= least))
            .map(|c| {
                let d = c[1].0 / c[1].1 - c[0].0 / c[0].1;
                let variance = sigma_m[0].powi(2) / c[0].1 + sigma_m[1].powi(2) / c[1].1;
                (d, variance)
            })
    }
}

#[cfg(test)]
mod tests {
    use super::super::border::{NearPoint, stone_points};
    use super::*;
    use crate::cloud::Cloud;
    use crate::geometry::FaceFrame;
    use crate::id::StoneId;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const NOISE: SurfaceNoise = SurfaceNoise {
        sigma_m: [0.004, 0.005],
        tau_m: 0.01,
    };
    const LAYOUT: Layout = Layout {
        cell_m: 0.02,
        patch_cells: 24,
        outlier_sigmas: 1e9,
    };

    /// Two scans of a bumpy face; the second shows another part of it, `beside` metres farther along.
    fn scans(beside: f64) -> LocalPair {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut scan = |sigma: f64, from: f64| {
            (0..400)
                .map(|_| {
                    let (u, v) = (from + rng.random_range(-0.1..0.1), rng.random_range(-0.08..0.08));
                    let noise = sigma * ((0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0);
                    [u, v, 0.002 * (40.0 * u).sin() + 0.001 * (55.0 * v).cos() + noise]
                })
                .collect::<Vec<_>>()
        };
        let (first, second) = (scan(NOISE.sigma_m[0], 0.0), scan(NOISE.sigma_m[1], beside));
        LocalPair {
            first,
            labelled: second.len(),
            second,
            window: None,
        }
    }

    #[test]
    fn the_gradient_is_that_of_the_marginal_likelihood() {
        for beside in [0.0, 0.02] {
            let pair = scans(beside);
            let at = |x: &Motion9| equations(&pair, x, x, &NOISE, &LAYOUT);
            let here = at(&Motion9::zeros());
            for k in 0..6 {
                let step = 1e-3 * here.information[(k, k)].sqrt().recip();
                let moved = |by: f64| {
                    let mut x = Motion9::zeros();
                    x[k] = by * step;
                    at(&x).deviance
                };
                let slope = (moved(1.0) - moved(-1.0)) / (4.0 * step);
                let scale = here.information[(k, k)].sqrt();
                // The rotation in the face is seen by steep points most, whose weights are held.
                let allowed = if k == 5 { 0.35 } else { 0.12 };
                let difference = (slope - here.gradient[k]).abs() / scale;
                assert!(difference < allowed, "{beside} {k}: {difference}");
            }
        }
    }

    #[test]
    fn points_of_the_second_epoch_count_where_the_window_moved_with_the_stone() {
        let normal = Vector3::x();
        let frame = FaceFrame::from_normal(&normal).face_from_world();
        let shift = Vector3::new(0.0, 0.03, -0.02);
        // A plane of 0.4 m, points every 5 mm; the mask takes the middle 0.2 m.
        let plane = |moved: Vector3<f64>| -> Vec<NearPoint> {
            let place = |i: i32| f64::from(i) * 0.005 - 0.2;
            (0..81 * 81)
                .map(|i| Vector3::new(0.0, place(i % 81), place(i / 81)))
                .map(|p| NearPoint {
                    offset: (p + moved).cast::<f32>().into(),
                    labelled: p.y.abs().max(p.z.abs()) < 0.101,
                })
                .collect()
        };
        let near = [plane(Vector3::zeros()), plane(shift)];
        let chosen = stone_points([&near[0], &near[1]], &normal, &shift, 3.0);
        let cloud = |offsets: Vec<[f32; 3]>| Cloud::new(Point3::origin(), offsets);
        let pair = PairPoints {
            first: StoneId(1),
            second: StoneId(1),
            centroid: Point3::origin(),
            centroid_second: Point3::origin() + shift,
            normal,
            points_first: cloud(chosen.first),
            points_second: cloud(chosen.second),
            nearby_second: cloud(chosen.nearby_second),
            window: chosen.window.map(Arc::new),
        };
        let local = LocalPair::new(&pair, &frame);
        let mut there = Motion9::zeros();
        there.fixed_rows_mut::<3>(0).copy_from(&(frame * shift));
        let moved = Moved::new(&there);
        let counted: Vec<[f64; 3]> = local.second_moved_back(&moved, &moved).collect();
        assert_eq!(counted.len(), local.first.len());
        let largest = |points: &[[f64; 3]]| {
            points
                .iter()
                .fold(0.0, |m: f64, p| m.max(p[0].abs()).max(p[1].abs()))
        };
        assert!((largest(&counted) - largest(&local.first)).abs() < 1e-6);
        let still = Moved::new(&Motion9::zeros());
        let left_behind = local.second_moved_back(&moved, &still).count();
        assert!(
            left_behind + 200 < counted.len(),
            "{left_behind} {}",
            counted.len()
        );
    }
}
