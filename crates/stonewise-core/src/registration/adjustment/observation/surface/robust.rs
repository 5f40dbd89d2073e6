//! The fit of a patch's surface with less weight for outliers and steep parts.

use super::layout::Layout;
use super::patch_fit::PatchFit;
use super::patch_grid::{PatchGrid, WeightedPoint};
use super::surface_noise::SurfaceNoise;

/// Most rounds of reweighting. A second round moves weights by some percent, a third by none; each costs a
/// factorisation.
const REWEIGHTINGS: usize = 2;
/// A weight that changes by less needs no other fit.
const CHANGED: f64 = 0.05;

/// Factor on a point's weight where the surface has these slopes: noise goes in all directions, so what
/// counts is the distance from the surface and not that along the height (orthogonal distance regression,
/// Boggs, Byrd & Schnabel 1987). At the steep rims of stones, where a surface of cells also fits worst,
/// points say little.
pub(crate) fn steepness([u, v]: [f64; 2]) -> f64 {
    1.0 / (1.0 + u * u + v * v)
}

/// Fits the surface; points on its steep parts and points far off it lose weight and it is fitted again.
pub(crate) fn robust_fit(
    grid: PatchGrid,
    epochs: &mut [Vec<WeightedPoint>; 2],
    noise: &SurfaceNoise,
    layout: &Layout,
) -> Option<PatchFit> {
    let mut fit = PatchFit::new(grid, [&epochs[0], &epochs[1]], noise)?;
    for _ in 0..REWEIGHTINGS {
        let mut changed = false;
        for (observations, sigma) in epochs.iter_mut().zip(noise.sigma_m) {
            let limit = layout.outlier_sigmas * sigma;
            for o in observations {
                let [h, hu, hv] = fit.surface(o.position[0], o.position[1]);
                let steepness = steepness([hu, hv]);
                let r = (o.position[2] - h).abs() * steepness.sqrt();
                let weight = steepness * if r > limit { (limit / r).powi(2) } else { 1.0 };
                changed |= (weight - o.weight).abs() > CHANGED;
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
