//! The fit of a patch's surface with less weight for outliers and steep parts.

use super::layout::Layout;
use super::patch_fit::PatchFit;
use super::patch_grid::{PatchGrid, WeightedPoint};
use super::surface_noise::SurfaceNoise;
use pulp::{Arch, Simd, WithSimd};

/// Most rounds of reweighting. A second round moves weights by some percent, a third by none; each costs a
/// factorisation.
const REWEIGHTINGS: usize = 2;
/// A weight that changes by less needs no other fit.
const CHANGED: f64 = 0.05;
/// Points whose weights are computed side by side.
const CHUNK: usize = 32;

/// Factor on a point's weight where the surface has these slopes: noise goes in all directions, so what
/// counts is the distance from the surface and not that along the height (orthogonal distance regression,
/// Boggs, Byrd & Schnabel 1987). At the steep rims of stones, where a surface of cells also fits worst,
/// points say little.
#[inline(always)]
pub(crate) fn steepness([u, v]: [f64; 2]) -> f64 {
    1.0 / (1.0 + u * u + v * v)
}

/// Fits the surface with the weights that the points have; points on its steep parts and points far off it lose weight
/// and it is fitted again.
///
/// The weights are those of the fit that is returned: with others, what the surface absorbs of the
/// information could exceed it.
pub(crate) fn robust_fit(
    grid: PatchGrid,
    epochs: &mut [Vec<WeightedPoint>; 2],
    noise: &SurfaceNoise,
    layout: &Layout,
) -> Option<PatchFit> {
    let mut fit = PatchFit::new(grid, [&epochs[0], &epochs[1]], noise)?;
    for _ in 0..REWEIGHTINGS {
        let weights = [0, 1].map(|epoch| {
            Arch::new().dispatch(Weights {
                fit: &fit,
                points: &epochs[epoch],
                limit_m: layout.outlier_sigmas * noise.sigma_m[epoch],
            })
        });
        let points = || epochs.iter().flatten().zip(weights.iter().flatten());
        if points().all(|(o, weight)| (weight - o.weight).abs() <= CHANGED) {
            break;
        }
        for (o, weight) in epochs.iter_mut().flatten().zip(weights.iter().flatten()) {
            o.weight = *weight;
        }
        fit = PatchFit::new(grid, [&epochs[0], &epochs[1]], noise)?;
    }
    Some(fit)
}

/// The weights of an epoch's points; those farther off the surface than a limit lose weight. The loop is compiled for
/// the widest vectors of the processor.
struct Weights<'a> {
    fit: &'a PatchFit,
    points: &'a [WeightedPoint],
    limit_m: f64,
}

impl WithSimd for Weights<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<f64> {
        let mut weights = vec![0.0; self.points.len()];
        for (weights, points) in weights.chunks_mut(CHUNK).zip(self.points.chunks(CHUNK)) {
            let (mut residuals, mut along_u, mut along_v) = ([0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK]);
            for (k, point) in points.iter().enumerate() {
                let [h, hu, hv] = self.fit.surface::<S>(&point.basis);
                (residuals[k], along_u[k], along_v[k]) = (point.position[2] - h, hu, hv);
            }
            // A loop of its own, without branches, so that it is compiled to vectors.
            let mut all = [0.0; CHUNK];
            for (k, weight) in all.iter_mut().enumerate() {
                *weight = weight_of(residuals[k], [along_u[k], along_v[k]], self.limit_m);
            }
            weights.copy_from_slice(&all[..weights.len()]);
        }
        weights
    }
}

/// Weight of a point by its height above the surface and the slopes of the surface there; a point farther than
/// `limit_m` from the surface weighs less.
#[inline(always)]
fn weight_of(residual: f64, slopes: [f64; 2], limit_m: f64) -> f64 {
    let steepness = steepness(slopes);
    let square = residual * residual * steepness;
    steepness * (limit_m * limit_m / square).min(1.0)
}
