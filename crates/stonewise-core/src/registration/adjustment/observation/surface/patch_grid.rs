//! The cells of a patch of a stone's face: cubic B-splines, their numbers and their normal equations.
//!
//! Heights h(u, v) over a regular grid of cells; the coefficients' second differences have prior variance
//! `tau^2` (Lang & Brezger 2004, Bayesian P-splines).

use super::surface_noise::SurfaceNoise;
use crate::linalg::{Band, add_scaled};
use pulp::{Arch, Simd, WithSimd};

/// Information of every coefficient in units of the prior's: keeps a patch whose points lie on a line
/// solvable; far below any observation's weight.
const RIDGE: f64 = 1e-8;

/// A point in the stone's frame, with the factor by which its weight is reduced as an outlier and the basis
/// functions of its patch there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedPoint {
    pub position: [f64; 3],
    /// Its place among the stone's points of its epoch.
    pub index: u32,
    pub weight: f64,
    pub basis: Basis,
}

/// Where a patch lies and how its coefficients are numbered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatchGrid {
    origin: [f64; 2],
    cell_m: f64,
    cells: [usize; 2],
    /// Axis whose coefficients are contiguous: the shorter one, which keeps the band narrow.
    pub short: usize,
}

/// Normal equations of a patch's coefficients by its points, without the prior.
#[derive(Clone)]
pub(crate) struct Observed {
    pub matrix: Band,
    pub rhs: Vec<[f64; 1]>,
}

/// The basis functions that are not zero at a point: four along each axis of the grid, the short axis first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Basis {
    /// Number of the first coefficient.
    first: usize,
    /// Number of coefficients from one to the next along the long axis.
    stride: usize,
    pub value: [[f64; 4]; 2],
    /// Derivatives with respect to the position along the axis, 1/m.
    pub slope: [[f64; 4]; 2],
}

impl Basis {
    /// Number of the first of the four coefficients that lie `long` steps along the long axis.
    #[inline(always)]
    pub fn row(&self, long: usize) -> usize {
        self.first + long * self.stride
    }

    /// The coefficients of each place along the short axis, summed over the long one with these factors.
    #[inline(always)]
    pub fn over_long<S: Simd>(&self, long: &[f64; 4], coefficients: &[[f64; 1]]) -> [f64; 4] {
        let mut sums = [0.0; 4];
        for (a, factor) in long.iter().enumerate() {
            let row = coefficients[self.row(a)..].as_flattened();
            if let Some(row) = row.first_chunk() {
                add_scaled::<S, _>(&mut sums, *factor, row);
            }
        }
        sums
    }

    /// The sum of the coefficients times the basis.
    #[inline(always)]
    pub fn gather<S: Simd>(&self, coefficients: &[[f64; 1]]) -> f64 {
        dot(&self.over_long::<S>(&self.value[1], coefficients), &self.value[0])
    }

    /// Adds `weight * basis * row` to the right-hand sides of the coefficients.
    #[inline(always)]
    pub fn scatter<S: Simd, const N: usize>(&self, weight: f64, row: &[f64; N], into: &mut [[f64; N]]) {
        let [short, long] = self.value;
        for (a, l) in long.into_iter().enumerate() {
            let first = self.row(a);
            for (target, b) in into[first..first + 4].iter_mut().zip(short) {
                add_scaled::<S, _>(target, weight * l * b, row);
            }
        }
    }
}

/// Sum of products.
#[inline(always)]
pub(crate) fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    (a[0] * b[0] + a[2] * b[2]) + (a[1] * b[1] + a[3] * b[3])
}

impl PatchGrid {
    pub fn new(low: [f64; 2], high: [f64; 2], cell_m: f64) -> Self {
        let cells = [0, 1].map(|a| (((high[a] - low[a]) / cell_m).ceil() as usize).max(1));
        let origin = [0, 1].map(|a| (low[a] + high[a] - cells[a] as f64 * cell_m) / 2.0);
        Self {
            origin,
            cell_m,
            cells,
            short: usize::from(cells[1] < cells[0]),
        }
    }

    /// Lower corner.
    pub fn low(&self) -> [f64; 2] {
        self.origin
    }

    /// Upper corner.
    pub fn high(&self) -> [f64; 2] {
        [0, 1].map(|a| self.origin[a] + self.cells[a] as f64 * self.cell_m)
    }

    fn counts(&self) -> [usize; 2] {
        [self.cells[self.short] + 3, self.cells[1 - self.short] + 3]
    }

    pub fn coefficient_count(&self) -> usize {
        let [short, long] = self.counts();
        short * long
    }

    /// A point with full weight.
    #[inline]
    pub fn point(&self, index: u32, position: [f64; 3]) -> WeightedPoint {
        WeightedPoint {
            position,
            index,
            weight: 1.0,
            basis: self.basis(position[0], position[1]),
        }
    }

    #[inline]
    pub fn basis(&self, u: f64, v: f64) -> Basis {
        let place = [u, v];
        let mut at = [0; 2];
        let mut value = [[0.0; 4]; 2];
        let mut slope = [[0.0; 4]; 2];

        for (k, axis) in [self.short, 1 - self.short].into_iter().enumerate() {
            let s = ((place[axis] - self.origin[axis]) / self.cell_m).clamp(0.0, self.cells[axis] as f64);
            let cell = (s as usize).min(self.cells[axis] - 1);
            let t = s - cell as f64;
            let r = 1.0 - t;
            value[k] = [
                r * r * r / 6.0,
                (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
                (3.0 * r * r * r - 6.0 * r * r + 4.0) / 6.0,
                t * t * t / 6.0,
            ];
            slope[k] = [
                -r * r / 2.0,
                (3.0 * t * t - 4.0 * t) / 2.0,
                (4.0 * r - 3.0 * r * r) / 2.0,
                t * t / 2.0,
            ]
            .map(|d| d / self.cell_m);
            at[k] = cell;
        }

        let [stride, _] = self.counts();
        Basis {
            first: at[1] * stride + at[0],
            stride,
            value,
            slope,
        }
    }

    /// Normal equations of the coefficients by the points of both epochs, without the prior.
    pub fn observed(&self, epochs: [&[WeightedPoint]; 2], noise: &SurfaceNoise) -> Observed {
        let [short, _] = self.counts();
        let mut matrix = Band::zeros(self.coefficient_count(), 3 * short + 3);
        let mut rhs = vec![[0.0]; self.coefficient_count()];
        for (points, sigma) in epochs.into_iter().zip(noise.sigma_m) {
            Arch::new().dispatch(Observations {
                points,
                variance: sigma * sigma,
                matrix: &mut matrix,
                rhs: &mut rhs,
            });
        }
        Observed { matrix, rhs }
    }

    /// Adds the information of the prior on the coefficients; `tau_m`: standard deviation of their second differences.
    pub fn add_prior(&self, matrix: &mut Band, tau_m: f64) {
        let scale = 1.0 / (tau_m * tau_m);
        self.each_difference(|taps| {
            for &(i, ci) in taps {
                for &(j, cj) in taps {
                    if j <= i {
                        matrix.add(i, j, scale * ci * cj);
                    }
                }
            }
        });
        // Keeps a patch whose points lie on a line solvable; far below any observation's weight.
        for i in 0..self.coefficient_count() {
            matrix.add(i, i, RIDGE / (tau_m * tau_m));
        }
    }

    /// The prior's second differences: along each axis, and mixed (twice, as in a thin plate).
    pub fn each_difference(&self, mut visit: impl FnMut(&[(usize, f64)])) {
        let [short, long] = self.counts();
        let mixed = std::f64::consts::SQRT_2;
        for l in 0..long {
            for s in 0..short {
                let i = l * short + s;
                if s >= 2 {
                    visit(&[(i - 2, 1.0), (i - 1, -2.0), (i, 1.0)]);
                }
                if l >= 2 {
                    visit(&[(i - 2 * short, 1.0), (i - short, -2.0), (i, 1.0)]);
                }
                if s >= 1 && l >= 1 {
                    visit(&[
                        (i - short - 1, mixed),
                        (i - short, -mixed),
                        (i - 1, -mixed),
                        (i, mixed),
                    ]);
                }
            }
        }
    }
}

/// Adds what points of an epoch say to the normal equations of the coefficients.
struct Observations<'a> {
    points: &'a [WeightedPoint],
    /// Variance of a point of full weight, m^2.
    variance: f64,
    matrix: &'a mut Band,
    rhs: &'a mut [[f64; 1]],
}

impl WithSimd for Observations<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for point in self.points {
            let weight = point.weight / self.variance;
            add_observation::<S>(point, weight, self.matrix, self.rhs);
        }
    }
}

/// Adds what a point says: products of its basis along the short axis, times those along the long one.
#[inline(always)]
fn add_observation<S: Simd>(point: &WeightedPoint, weight: f64, matrix: &mut Band, rhs: &mut [[f64; 1]]) {
    let [short, long] = point.basis.value;
    let mut products = [[0.0; 4]; 4];
    // The products from the diagonal on, as columns of the lower triangle hold them.
    let mut below = [[0.0; 4]; 4];
    for b in 0..4 {
        for d in 0..4 {
            products[b][d] = weight * short[b] * short[d];
        }
        below[b][..4 - b].copy_from_slice(&products[b][b..]);
    }
    point.basis.scatter::<S, _>(weight, &[point.position[2]], rhs);
    for a in 0..4 {
        let row = point.basis.row(a);
        for b in 0..4 {
            matrix.add_run::<S>(row + b, row + b, long[a] * long[a], &below[b]);
            for c in a + 1..4 {
                matrix.add_run::<S>(row + b, point.basis.row(c), long[a] * long[c], &products[b]);
            }
        }
    }
}
