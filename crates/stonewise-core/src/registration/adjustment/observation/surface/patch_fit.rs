//! A patch of a stone's face as a latent height field seen by both epochs.
//!
//! Points of both epochs observe the surface with noise `sigma`; the coefficients are eliminated, which
//! leaves the normal equations of the motion alone.

use super::patch_grid::{Basis, Observed, PatchGrid, WeightedPoint};
use super::surface_noise::SurfaceNoise;
use crate::linalg::{BandFactor, BandInverse};

/// Unknowns that second differences leave free: those of a plane.
const UNPENALISED: f64 = 3.0;

/// The surface that both epochs support, for given weights.
pub(crate) struct PatchFit {
    pub grid: PatchGrid,
    coefficients: Vec<[f64; 1]>,
    pub factor: BandFactor,
    prior_quadratic: f64,
}

impl PatchFit {
    /// The posterior mean of the surface; `None` where the points do not determine one.
    pub fn new(grid: PatchGrid, epochs: [&[WeightedPoint]; 2], noise: &SurfaceNoise) -> Option<Self> {
        Self::of(grid, grid.observed(epochs, noise), noise)
    }

    /// The posterior mean of the surface, from the normal equations of its points.
    pub fn of(grid: PatchGrid, observed: Observed, noise: &SurfaceNoise) -> Option<Self> {
        let Observed {
            mut matrix,
            rhs: mut coefficients,
        } = observed;
        grid.add_prior(&mut matrix, noise.tau_m);
        let factor = matrix.factor()?;
        factor.solve(&mut coefficients);
        let mut prior_quadratic = 0.0;
        grid.each_difference(|taps| {
            let d: f64 = taps.iter().map(|&(i, c)| c * coefficients[i][0]).sum();
            prior_quadratic += d * d;
        });
        prior_quadratic /= noise.tau_m * noise.tau_m;
        Some(Self {
            grid,
            coefficients,
            factor,
            prior_quadratic,
        })
    }

    /// Height and its slopes along u and v.
    #[inline(always)]
    pub fn surface(&self, basis: &Basis) -> [f64; 3] {
        let (s, l) = (self.grid.short, 1 - self.grid.short);
        let mut out = [0.0; 3];
        for a in 0..4 {
            let first = basis.row(a);
            let row = self.coefficients[first..first + 4].as_flattened();
            let along = |b: &[f64; 4]| row.iter().zip(b).map(|(c, b)| c * b).sum::<f64>();
            let (value, slope) = (along(&basis.value[0]), along(&basis.slope[0]));
            out[0] += value * basis.value[1][a];
            out[1 + s] += slope * basis.value[1][a];
            out[1 + l] += value * basis.slope[1][a];
        }
        out
    }

    /// Covariance of the height with its slopes along u and v, given the points: `inverse` is that of
    /// [`Self::factor`].
    #[inline(always)]
    pub fn slope_covariance(&self, basis: &Basis, inverse: &BandInverse) -> [f64; 2] {
        let [short, long] = basis.value;
        // Covariance of each coefficient with the height.
        let mut with_height = [[0.0; 4]; 4];

        for a in 0..4 {
            for b in 0..4 {
                let column = basis.row(a) + b;
                let own = inverse.column_part(column, column, 4 - b);
                for (d, z) in (b..4).zip(own) {
                    with_height[a][b] += z * long[a] * short[d];
                    if d > b {
                        with_height[a][d] += z * long[a] * short[b];
                    }
                }
                for c in a + 1..4 {
                    let part = inverse.column_part(column, basis.row(c), 4);
                    let sum: f64 = part.iter().zip(short).map(|(z, s)| z * s).sum();
                    with_height[a][b] += sum * long[c];
                    let back = long[a] * short[b];
                    for (target, z) in with_height[c].iter_mut().zip(part) {
                        *target += z * back;
                    }
                }
            }
        }

        let (s, l) = (self.grid.short, 1 - self.grid.short);
        let mut out = [0.0; 2];
        for a in 0..4 {
            let along = |b: &[f64; 4]| with_height[a].iter().zip(b).map(|(c, b)| c * b).sum::<f64>();
            out[s] += along(&basis.slope[0]) * long[a];
            out[l] += along(&short) * basis.slope[1][a];
        }

        out
    }

    /// The surface's part of [`Self::deviance`].
    pub fn surface_deviance(&self, noise: &SurfaceNoise) -> f64 {
        let rank = self.grid.coefficient_count() as f64 - UNPENALISED;
        self.factor.log_det() + self.prior_quadratic + rank * 2.0 * noise.tau_m.ln()
    }

    /// Minus twice the log marginal likelihood of the points, up to a constant.
    pub fn deviance(&self, epochs: [&[WeightedPoint]; 2], noise: &SurfaceNoise) -> f64 {
        let mut sum = self.surface_deviance(noise);
        for (observations, sigma) in epochs.into_iter().zip(noise.sigma_m) {
            for square in self.squares(observations, sigma) {
                sum += square + 2.0 * sigma.ln();
            }
        }
        sum
    }

    /// Weighted squared residual of each point of an epoch, in units of its variance.
    pub fn squares(&self, observations: &[WeightedPoint], sigma: f64) -> impl Iterator<Item = f64> {
        observations.iter().map(move |o| {
            let r = o.position[2] - self.surface(&o.basis)[0];
            o.weight * r * r / (sigma * sigma)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const NOISE: SurfaceNoise = SurfaceNoise {
        sigma_m: [0.002, 0.003],
        tau_m: 0.004,
    };

    fn points(seed: u64, count: usize, height: impl Fn(f64, f64) -> f64) -> Vec<WeightedPoint> {
        let grid = grid();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count)
            .map(|_| {
                let (u, v) = (rng.random_range(0.0..0.10), rng.random_range(0.0..0.06));
                WeightedPoint {
                    weight: rng.random_range(0.5..1.0),
                    ..grid.point(0, [u, v, height(u, v)])
                }
            })
            .collect()
    }

    fn grid() -> PatchGrid {
        PatchGrid::new([0.0, 0.0], [0.10, 0.06], 0.02)
    }

    /// The cubic B-spline with knots at the integers, centred at zero (de Boor 1978).
    fn spline(t: f64) -> f64 {
        let t = t.abs();
        match t {
            t if t < 1.0 => 2.0 / 3.0 - t * t + t.powi(3) / 2.0,
            t if t < 2.0 => (2.0 - t).powi(3) / 6.0,
            _ => 0.0,
        }
    }

    /// Values of all coefficients' basis functions at a point; those along v are contiguous (v is the shorter
    /// axis).
    fn dense_basis(u: f64, v: f64) -> DVector<f64> {
        let along = |x: f64, k: usize| spline(x / 0.02 - (k as f64 - 1.0));
        DVector::from_fn(8 * 6, |i, _| along(u, i / 6) * along(v, i % 6))
    }

    #[test]
    fn the_fit_is_the_penalised_least_squares_solution() {
        let wave = |u: f64, v: f64| 0.004 * (60.0 * u).sin() + 0.003 * (80.0 * v).cos();
        let epochs = [points(1, 150, wave), points(2, 120, wave)];
        let fit = PatchFit::new(grid(), [&epochs[0], &epochs[1]], &NOISE).unwrap();
        let mut normal = DMatrix::<f64>::identity(48, 48) * (RIDGE_OF_GRID / NOISE.tau_m.powi(2));
        let mut rhs = DVector::<f64>::zeros(48);
        for (points, sigma) in epochs.iter().zip(NOISE.sigma_m) {
            for p in points {
                let b = dense_basis(p.position[0], p.position[1]);
                let w = p.weight / (sigma * sigma);
                normal += &b * b.transpose() * w;
                rhs += b * (w * p.position[2]);
            }
        }
        let information = normal.clone();
        grid().each_difference(|taps| {
            let mut d = DVector::<f64>::zeros(48);
            taps.iter().for_each(|&(i, c)| d[i] = c);
            normal += &d * d.transpose() / NOISE.tau_m.powi(2);
        });
        assert!(information.norm() < normal.norm());
        let solution = normal.clone().cholesky().unwrap().solve(&rhs);
        let inverse = normal.clone().try_inverse().unwrap();
        let log_det = 2.0
            * normal
                .cholesky()
                .unwrap()
                .l()
                .diagonal()
                .iter()
                .map(|d| d.ln())
                .sum::<f64>();
        assert!((fit.factor.log_det() - log_det).abs() < 1e-8 * log_det.abs());
        let band = fit.factor.inverse();
        for (u, v) in [(0.013, 0.021), (0.05, 0.03), (0.099, 0.001), (0.0, 0.06)] {
            let basis = dense_basis(u, v);
            let [h, hu, hv] = fit.surface(&grid().basis(u, v));
            assert!((h - basis.dot(&solution)).abs() < 1e-10, "{u} {v}");
            // One-sided where the patch ends: evaluation outside is clamped to the border.
            let step = 1e-6;
            let slope = |du: f64, dv: f64| {
                let back = dense_basis(u - du * step, v - dv * step);
                (dense_basis(u + du * step, v + dv * step) - back) / (2.0 * step)
            };
            let slopes = [slope(1.0, 0.0), slope(0.0, 1.0)];
            let covariance = fit.slope_covariance(&grid().basis(u, v), &band);
            for ((slope, found), with_height) in slopes.iter().zip([hu, hv]).zip(covariance) {
                assert!((found - slope.dot(&solution)).abs() < 1e-6, "{u} {v}");
                let expected = (slope.transpose() * &inverse * &basis)[0];
                assert!((with_height - expected).abs() < 1e-6 * NOISE.tau_m, "{u} {v}");
            }
        }
    }

    /// The ridge of the grid, repeated here so that a change shows.
    const RIDGE_OF_GRID: f64 = 1e-8;

    #[test]
    fn a_plane_costs_the_prior_nothing_and_is_reproduced() {
        let plane = |u: f64, v: f64| 0.3 * u - 0.2 * v + 0.01;
        let epochs = [points(3, 60, plane), points(4, 60, plane)];
        let fit = PatchFit::new(grid(), [&epochs[0], &epochs[1]], &NOISE).unwrap();
        assert!(fit.prior_quadratic < 1e-6, "{}", fit.prior_quadratic);
        let [h, hu, hv] = fit.surface(&grid().basis(0.04, 0.03));
        assert!((h - plane(0.04, 0.03)).abs() < 1e-7);
        assert!((hu - 0.3).abs() < 1e-5 && (hv + 0.2).abs() < 1e-5, "{hu} {hv}");
    }
}
