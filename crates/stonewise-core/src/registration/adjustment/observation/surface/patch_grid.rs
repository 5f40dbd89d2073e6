//! The cells of a patch of a stone's face: cubic B-splines, their numbers and their normal equations.
//!
//! Heights h(u, v) over a regular grid of cells; the coefficients' second differences have prior variance
//! `tau^2` (Lang & Brezger 2004, Bayesian P-splines).

use super::surface_noise::SurfaceNoise;
use crate::linalg::Band;

/// Information of every coefficient in units of the prior's: keeps a patch whose points lie on a line
/// solvable; far below any observation's weight.
const RIDGE: f64 = 1e-8;

/// A point in the stone's frame, with the factor by which its weight is reduced as an outlier.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedPoint {
    pub position: [f64; 3],
    pub weight: f64,
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

/// Basis functions at a point: first coefficient along (short, long), values and derivatives per axis u, v.
#[derive(Clone, Copy)]
pub(crate) struct Basis {
    at: [usize; 2],
    pub value: [[f64; 4]; 2],
    pub slope: [[f64; 4]; 2],
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

    pub fn basis(&self, u: f64, v: f64) -> Basis {
        let mut at = [0; 2];
        let mut value = [[0.0; 4]; 2];
        let mut slope = [[0.0; 4]; 2];
        for (axis, x) in [u, v].into_iter().enumerate() {
            let s = ((x - self.origin[axis]) / self.cell_m).clamp(0.0, self.cells[axis] as f64);
            let cell = (s as usize).min(self.cells[axis] - 1);
            let t = s - cell as f64;
            let r = 1.0 - t;
            value[axis] = [
                r * r * r / 6.0,
                (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
                (3.0 * r * r * r - 6.0 * r * r + 4.0) / 6.0,
                t * t * t / 6.0,
            ];
            slope[axis] = [
                -r * r / 2.0,
                (3.0 * t * t - 4.0 * t) / 2.0,
                (4.0 * r - 3.0 * r * r) / 2.0,
                t * t / 2.0,
            ]
            .map(|d| d / self.cell_m);
            at[usize::from(axis != self.short)] = cell;
        }
        Basis { at, value, slope }
    }

    /// Number of the coefficient `long` and `short` steps from the first one that the point touches.
    pub fn index(&self, basis: &Basis, long: usize, short: usize) -> usize {
        (basis.at[1] + long) * (self.cells[self.short] + 3) + basis.at[0] + short
    }

    pub fn assemble(&self, epochs: [&[WeightedPoint]; 2], noise: &SurfaceNoise) -> (Band, Vec<[f64; 1]>) {
        let [short, _] = self.counts();
        let mut matrix = Band::zeros(self.coefficient_count(), 3 * short + 3);
        let mut rhs = vec![[0.0]; self.coefficient_count()];
        for (observations, sigma) in epochs.into_iter().zip(noise.sigma_m) {
            for o in observations {
                self.add_observation(o, o.weight / (sigma * sigma), &mut matrix, &mut rhs);
            }
        }
        self.each_difference(|taps| {
            let scale = 1.0 / (noise.tau_m * noise.tau_m);
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
            matrix.add(i, i, RIDGE / (noise.tau_m * noise.tau_m));
        }
        (matrix, rhs)
    }

    /// Adds what a point says to the normal equations of the coefficients: products of its basis along the
    /// short axis, times those along the long one.
    fn add_observation(&self, o: &WeightedPoint, weight: f64, matrix: &mut Band, rhs: &mut [[f64; 1]]) {
        let basis = self.basis(o.position[0], o.position[1]);
        let (bs, bl) = (basis.value[self.short], basis.value[1 - self.short]);
        let products = bs.map(|x| bs.map(|y| weight * x * y));
        for a in 0..4 {
            for b in 0..4 {
                let column = self.index(&basis, a, b);
                rhs[column][0] += weight * bl[a] * bs[b] * o.position[2];
                let own = matrix.column_part(column, column, 4 - b);
                for (entry, p) in own.iter_mut().zip(&products[b][b..]) {
                    *entry += bl[a] * bl[a] * p;
                }
                for c in a + 1..4 {
                    let along = bl[a] * bl[c];
                    let part = matrix.column_part(column, self.index(&basis, c, 0), 4);
                    for (entry, p) in part.iter_mut().zip(products[b]) {
                        *entry += along * p;
                    }
                }
            }
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
