//! Equations of a match, and their robust least squares: the first unknown is an offset, the second the gain of
//! the template, the third and the fourth are a shift.

use nalgebra::{Matrix2, SMatrix, SVector};

/// Residuals beyond this many standard deviations lose weight (Huber 1964).
const HUBER: f64 = 2.0;
/// Cells whose sums are made in single precision before they are added in double precision.
const BLOCK: usize = 64;
/// Cells that are summed side by side.
const LANES: usize = 8;

/// Values of a photo and their equations, in blocks of cells.
#[derive(Default)]
pub(super) struct Observed<const N: usize> {
    blocks: Vec<Block<N>>,
    /// Cells.
    pub count: usize,
}

/// Cells side by side, zero where there are none.
struct Block<const N: usize> {
    /// What multiplies each unknown; the second is the template.
    rows: [[f32; BLOCK]; N],
    /// The photo.
    values: [f32; BLOCK],
    /// Weights of the cells.
    weights: [f32; BLOCK],
}

impl<const N: usize> Block<N> {
    const EMPTY: Self = Self {
        rows: [[0.0; BLOCK]; N],
        values: [0.0; BLOCK],
        weights: [0.0; BLOCK],
    };

    /// Residuals of the photo's values.
    fn residuals(&self, solution: &SVector<f64, N>) -> [f32; BLOCK] {
        let mut residuals = self.values;
        for (row, x) in self.rows.iter().zip(solution) {
            let x = *x as f32;
            for (r, a) in residuals.iter_mut().zip(row) {
                *r -= a * x;
            }
        }
        residuals
    }
}

impl<const N: usize> Observed<N> {
    /// Takes all cells away.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.count = 0;
    }

    /// Adds a cell: what multiplies each unknown, and the photo's value.
    pub fn push(&mut self, row: [f32; N], value: f32) {
        let at = self.count % BLOCK;
        if at == 0 {
            self.blocks.push(Block::EMPTY);
        }
        if let Some(block) = self.blocks.last_mut() {
            for (column, a) in block.rows.iter_mut().zip(row) {
                column[at] = a;
            }
            (block.values[at], block.weights[at]) = (value, 1.0);
            self.count += 1;
        }
    }

    /// Correlation of template and photo.
    pub fn correlation(&self) -> f64 {
        let ones: [f32; BLOCK] = [1.0; BLOCK];
        let [mut t, mut p, mut tt, mut tp, mut pp] = [0.0; 5];
        for block in &self.blocks {
            let (template, photo) = (&block.rows[1], &block.values);
            t += dot(template, &ones);
            p += dot(photo, &ones);
            tt += dot(template, template);
            tp += dot(template, photo);
            pp += dot(photo, photo);
        }
        let n = self.count as f64;
        let (tt, tp, pp) = (tt - t * t / n, tp - t * p / n, pp - p * p / n);
        if tt > 0.0 && pp > 0.0 {
            tp / (tt * pp).sqrt()
        } else {
            0.0
        }
    }

    /// Robust least squares of the photo's values; the unknowns, and the covariance of the shift.
    ///
    /// Cells are weighted by their residuals from an unweighted solution.
    pub fn least_squares(&mut self) -> Option<(SVector<f64, N>, Matrix2<f64>)> {
        let (unweighted, _) = self.solution()?;
        self.weigh(&unweighted, self.sigma(&unweighted));
        let (solution, inverse) = self.solution()?;
        let sigma = self.sigma(&solution);
        let shift = inverse.fixed_view::<2, 2>(2, 2).into_owned();
        Some((solution, shift * (sigma * sigma)))
    }

    /// The unknowns, and the inverse of their normal equations.
    fn solution(&self) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
        let (normal, right) = self.normal_equations();
        let inverse = normal.cholesky()?.inverse();
        Some((inverse * right, inverse))
    }

    fn normal_equations(&self) -> (SMatrix<f64, N, N>, SVector<f64, N>) {
        let (mut normal, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        for block in &self.blocks {
            for i in 0..N {
                let mut weighted = block.rows[i];
                for (a, w) in weighted.iter_mut().zip(&block.weights) {
                    *a *= w;
                }
                right[i] += dot(&weighted, &block.values);
                for j in i..N {
                    normal[(j, i)] += dot(&weighted, &block.rows[j]);
                }
            }
        }
        normal.fill_upper_triangle_with_lower_triangle();
        (normal, right)
    }

    /// Standard deviation of unit weight.
    fn sigma(&self, solution: &SVector<f64, N>) -> f64 {
        let (mut total, mut square) = (0.0, 0.0);
        for block in &self.blocks {
            let residuals = block.residuals(solution);
            let mut weighted = residuals;
            for (r, w) in weighted.iter_mut().zip(&block.weights) {
                *r *= w;
            }
            total += dot(&block.weights, &[1.0; BLOCK]);
            square += dot(&weighted, &residuals);
        }
        (square / (total - N as f64).max(1.0)).sqrt()
    }

    /// Weights the cells by their residuals from a solution.
    fn weigh(&mut self, solution: &SVector<f64, N>, sigma: f64) {
        let limit = (HUBER * sigma) as f32;
        for block in &mut self.blocks {
            let residuals = block.residuals(solution);
            for (w, r) in block.weights.iter_mut().zip(residuals) {
                let weight = (limit / r.abs().max(f32::MIN_POSITIVE)).min(1.0);
                *w = if *w > 0.0 { weight } else { 0.0 };
            }
        }
    }
}

/// Sum of products.
fn dot(a: &[f32; BLOCK], b: &[f32; BLOCK]) -> f64 {
    let mut sums = [0.0_f32; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    f64::from(sums.iter().sum::<f32>())
}
