//! A patch of a stone's face as a latent height field seen by both epochs.
//!
//! Points of both epochs observe the surface with noise `sigma`; the coefficients are eliminated, which
//! leaves the normal equations of the motion alone.

use super::patch_grid::{Basis, Observed, PatchGrid, WeightedPoint, dot};
use super::surface_noise::SurfaceNoise;
use crate::linalg::{BandFactor, BandInverse, add_scaled, mul_add};
use pulp::{Arch, Simd, WithSimd};

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
    pub fn surface<S: Simd>(&self, basis: &Basis) -> [f64; 3] {
        let value = basis.over_long::<S>(&basis.value[1], &self.coefficients);
        let slope = basis.over_long::<S>(&basis.slope[1], &self.coefficients);
        let (s, l) = (self.grid.short, 1 - self.grid.short);
        let mut out = [0.0; 3];
        out[0] = dot(&value, &basis.value[0]);
        out[1 + s] = dot(&value, &basis.slope[0]);
        out[1 + l] = dot(&slope, &basis.value[0]);
        out
    }

    /// Covariance of the height with its slopes along u and v, given the points: `inverse` is that of
    /// [`Self::factor`].
    ///
    /// Block Z_ac of the inverse belongs to the places a and c along the long axis and to all four along the short one.
    /// The covariance with the slope along the short axis is the sum over a and c of long_a long_c short_slope' Z_ac
    /// short; with that along the long axis, of long_slope_a long_c short' Z_ac short.
    #[inline(always)]
    pub fn slope_covariance<S: Simd>(&self, basis: &Basis, inverse: &BandInverse) -> [f64; 2] {
        let ([short, long], [short_slope, long_slope]) = (&basis.value, &basis.slope);
        // Sums over the blocks below the diagonal of Z_ca short and Z_ca short_slope, weighted with long_a long_c, and
        // of Z_ca short, weighted with long_slope_a long_c + long_a long_slope_c.
        let mut below = [[0.0; 4]; 3];
        // Columns of the blocks on the diagonal, from the diagonal down, weighted with long_a long_a and long_slope_a
        // long_a.
        let (mut diagonal, mut diagonal_slope) = ([[0.0; 4]; 4], [[0.0; 4]; 4]);
        for a in 0..4 {
            for (b, (with_value, with_slope)) in diagonal.iter_mut().zip(&mut diagonal_slope).enumerate() {
                let own = inverse.run(basis.row(a) + b, basis.row(a) + b);
                add_scaled::<S, _>(with_value, long[a] * long[a], own);
                add_scaled::<S, _>(with_slope, long[a] * long_slope[a], own);
            }
            for c in a + 1..4 {
                let (mut with_value, mut with_slope) = ([0.0; 4], [0.0; 4]);
                for b in 0..4 {
                    let part = inverse.run(basis.row(a) + b, basis.row(c));
                    add_scaled::<S, _>(&mut with_value, short[b], part);
                    add_scaled::<S, _>(&mut with_slope, short_slope[b], part);
                }
                add_scaled::<S, _>(&mut below[0], long[a] * long[c], &with_value);
                add_scaled::<S, _>(&mut below[1], long[a] * long[c], &with_slope);
                let once = long_slope[a] * long[c] + long[a] * long_slope[c];
                add_scaled::<S, _>(&mut below[2], once, &with_value);
            }
        }
        let mut along_short = dot(&below[0], short_slope) + dot(&below[1], short);
        let mut along_long = dot(&below[2], short);
        for b in 0..4 {
            for (k, d) in (b..4).enumerate() {
                // An entry off the diagonal also stands for its mirror image.
                let (cross, square) = match k {
                    0 => (short[b] * short_slope[b], short[b] * short[b]),
                    _ => (
                        short_slope[b] * short[d] + short[b] * short_slope[d],
                        2.0 * short[b] * short[d],
                    ),
                };
                along_short = mul_add::<S>(diagonal[b][k], cross, along_short);
                along_long = mul_add::<S>(diagonal_slope[b][k], square, along_long);
            }
        }
        let mut out = [0.0; 2];
        out[self.grid.short] = along_short;
        out[1 - self.grid.short] = along_long;
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
        for (points, sigma) in epochs.into_iter().zip(noise.sigma_m) {
            sum += self.square_sum(points, sigma) + points.len() as f64 * 2.0 * sigma.ln();
        }
        sum
    }

    /// Sum of the weighted squared residuals of the points of an epoch, in units of their variance.
    pub fn square_sum(&self, points: &[WeightedPoint], sigma: f64) -> f64 {
        let residuals = self.residuals(points).into_iter().zip(points);
        residuals.map(|(r, point)| point.weight * r * r).sum::<f64>() / (sigma * sigma)
    }

    /// Heights of points above the surface, metres.
    pub fn residuals(&self, points: &[WeightedPoint]) -> Vec<f64> {
        Arch::new().dispatch(Residuals { fit: self, points })
    }
}

/// The residuals of points. The loop is compiled for the widest vectors of the processor.
struct Residuals<'a> {
    fit: &'a PatchFit,
    points: &'a [WeightedPoint],
}

impl WithSimd for Residuals<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<f64> {
        let mut residuals = vec![0.0; self.points.len()];
        for (residual, point) in residuals.iter_mut().zip(self.points) {
            *residual = point.position[2] - point.basis.gather::<S>(&self.fit.coefficients);
        }
        residuals
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use pulp::Scalar;
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

    /// The surface at a place, to be computed with any vectors.
    #[derive(Clone, Copy)]
    struct At<'a> {
        fit: &'a PatchFit,
        inverse: &'a BandInverse,
        basis: Basis,
    }

    impl WithSimd for At<'_> {
        type Output = ([f64; 3], [f64; 2]);

        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) -> Self::Output {
            let surface = self.fit.surface::<S>(&self.basis);
            (surface, self.fit.slope_covariance::<S>(&self.basis, self.inverse))
        }
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
            let at = At {
                fit: &fit,
                inverse: &band,
                basis: grid().basis(u, v),
            };
            let plain = at.with_simd(Scalar::new());
            let ([h, hu, hv], covariance) = Arch::new().dispatch(at);
            assert!(
                (plain.0[0] - h).abs() < 1e-12 && (plain.1[0] - covariance[0]).abs() < 1e-9 * NOISE.tau_m
            );
            assert!((h - basis.dot(&solution)).abs() < 1e-10, "{u} {v}");
            // One-sided where the patch ends: evaluation outside is clamped to the border.
            let step = 1e-6;
            let slope = |du: f64, dv: f64| {
                let back = dense_basis(u - du * step, v - dv * step);
                (dense_basis(u + du * step, v + dv * step) - back) / (2.0 * step)
            };
            let slopes = [slope(1.0, 0.0), slope(0.0, 1.0)];
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
        let [h, hu, hv] = fit.surface::<Scalar>(&grid().basis(0.04, 0.03));
        assert!((h - plane(0.04, 0.03)).abs() < 1e-7);
        assert!((hu - 0.3).abs() < 1e-5 && (hv + 0.2).abs() < 1e-5, "{hu} {hv}");
    }
}
