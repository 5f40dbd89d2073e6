//! Symmetric positive definite band matrices: Cholesky factor, solves, log determinant.

use super::fused::{add_scaled, mul_add};
use pulp::{Arch, Simd, WithSimd};

/// Columns that are eliminated together: each later column is then read and written once for all of them.
const PANEL: usize = 4;
/// A multiple of the numbers in a vector of any processor.
const LANES: usize = 8;

/// Columns of the lower triangle; column `j` holds rows `j ..= j + half`, missing ones are zero, then zeros
/// up to the stride, so that whole vectors of a panel's columns can be read.
#[derive(Clone)]
pub(crate) struct Band {
    size: usize,
    half: usize,
    stride: usize,
    columns: Vec<f64>,
}

/// The lower Cholesky factor of a [`Band`]; its diagonal is kept inverted, which is what every solve needs.
pub(crate) struct BandFactor(Band);

impl Band {
    /// A zero matrix with `half` diagonals below the main one.
    pub fn zeros(size: usize, half: usize) -> Self {
        let stride = half + PANEL + LANES - 1;
        Self {
            size,
            half,
            stride,
            columns: vec![0.0; size * stride],
        }
    }

    /// Adds to one entry of the lower triangle.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        let place = self.place(column, row);
        self.columns[place] += value;
    }

    /// Adds `scale * values` to four rows of a column, the first of which must lie in the band and not above
    /// the diagonal. `values` must be zero for rows beyond the band or beyond the last row.
    #[inline(always)]
    pub fn add_run<S: Simd>(&mut self, column: usize, first: usize, scale: f64, values: &[f64; 4]) {
        let start = self.place(column, first);
        if let Some(run) = self.columns[start..].first_chunk_mut::<4>() {
            add_scaled::<S, _>(run, scale, values);
        }
    }

    #[inline(always)]
    fn place(&self, column: usize, row: usize) -> usize {
        column * self.stride + row - column
    }

    /// L L' = A; `None` where A is not positive definite. Cost: size * half^2 / 2 multiplications.
    pub fn factor(mut self) -> Option<BandFactor> {
        Arch::new()
            .dispatch(Elimination(&mut self))
            .then_some(BandFactor(self))
    }

    fn column(&self, j: usize) -> &[f64] {
        let reach = self.half.min(self.size - 1 - j);
        &self.columns[j * self.stride..][..=reach]
    }
}

/// Factors a matrix in place, a panel at a time, right-looking; whether all pivots were positive.
struct Elimination<'a>(&'a mut Band);

impl WithSimd for Elimination<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Band {
            size, half, stride, ..
        } = *self.0;
        for start in (0..size).step_by(PANEL) {
            let end = (start + PANEL).min(size);
            let (done, later) = self.0.columns.split_at_mut(end * stride);
            let panel = &mut done[start * stride..];
            if !eliminate_within::<S>(panel, half, stride) {
                return false;
            }
            for i in end..(end + half).min(size) {
                let length = (half + end - i).next_multiple_of(LANES);
                let target = &mut later[(i - end) * stride..][..length];
                let mut parts = [&panel[..0]; PANEL];
                for (k, part) in parts.iter_mut().enumerate() {
                    *part = &panel[k * stride + i - start - k..][..length];
                }
                subtract(simd, target, parts);
            }
        }
        true
    }
}

/// Factors the columns of a panel, each by those before it; whether all pivots were positive.
#[inline(always)]
fn eliminate_within<S: Simd>(panel: &mut [f64], half: usize, stride: usize) -> bool {
    for j in 0..panel.len() / stride {
        let (before, rest) = panel.split_at_mut(j * stride);
        let column = &mut rest[..=half];
        for k in 0..j {
            let other = &before[k * stride..][(j - k).min(half + 1)..=half];
            let factor = other.first().copied().unwrap_or(0.0);
            for (x, l) in column.iter_mut().zip(other) {
                *x = mul_add::<S>(-factor, *l, *x);
            }
        }
        let pivot = column[0];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let inverse = pivot.sqrt().recip();
        column[0] = inverse;
        for x in &mut column[1..] {
            *x *= inverse;
        }
    }
    true
}

/// Takes each part, times its first entry, off the target. All have the same length, a multiple of [`LANES`].
#[inline(always)]
fn subtract<S: Simd>(simd: S, target: &mut [f64], [a, b, c, d]: [&[f64]; PANEL]) {
    let (fa, fb) = (simd.splat_f64s(-a[0]), simd.splat_f64s(-b[0]));
    let (fc, fd) = (simd.splat_f64s(-c[0]), simd.splat_f64s(-d[0]));
    let (a, b) = (S::as_simd_f64s(a).0, S::as_simd_f64s(b).0);
    let (c, d) = (S::as_simd_f64s(c).0, S::as_simd_f64s(d).0);
    let target = S::as_mut_simd_f64s(target).0;
    for ((((t, a), b), c), d) in target.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        let two = simd.mul_add_e_f64s(fb, *b, simd.mul_add_e_f64s(fa, *a, *t));
        *t = simd.mul_add_e_f64s(fd, *d, simd.mul_add_e_f64s(fc, *c, two));
    }
}

/// The entries of an inverse that lie in the band of the matrix.
pub(crate) struct BandInverse(Band);

impl BandInverse {
    /// Four rows of a column from `first` on, which must be in the band and not above the diagonal. Rows beyond the
    /// band or the last row are zero.
    #[inline(always)]
    pub fn run(&self, column: usize, first: usize) -> &[f64; 4] {
        self.0.columns[self.0.place(column, first)..]
            .first_chunk()
            .unwrap_or(&[0.0; 4])
    }
}

impl BandFactor {
    /// log |A|.
    pub fn log_det(&self) -> f64 {
        -2.0 * (0..self.0.size).map(|j| self.0.column(j)[0].ln()).sum::<f64>()
    }

    /// Replaces the right-hand sides by L^-1 times them.
    pub fn forward<const N: usize>(&self, rhs: &mut [[f64; N]]) {
        Arch::new().dispatch(Forward { factor: &self.0, rhs });
    }

    /// Replaces the right-hand side by A^-1 times it.
    pub fn solve(&self, rhs: &mut [[f64; 1]]) {
        self.forward(rhs);
        Arch::new().dispatch(Backward { factor: &self.0, rhs });
    }

    /// The inverse within the band, column by column from the last (Takahashi, Fagan & Chen 1973). Cost: size
    /// * half^2 multiplications.
    pub fn inverse(&self) -> BandInverse {
        Arch::new().dispatch(Inversion(&self.0))
    }
}

/// Forward substitution with a factor.
struct Forward<'a, const N: usize> {
    factor: &'a Band,
    rhs: &'a mut [[f64; N]],
}

impl<const N: usize> WithSimd for Forward<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for j in 0..self.factor.size {
            let column = self.factor.column(j);
            let mut known = self.rhs[j];
            for y in &mut known {
                *y *= column[0];
            }
            self.rhs[j] = known;
            for (l, y) in column[1..].iter().zip(&mut self.rhs[j + 1..]) {
                add_scaled::<S, _>(y, -l, &known);
            }
        }
    }
}

/// Back substitution with the transpose of a factor.
struct Backward<'a> {
    factor: &'a Band,
    rhs: &'a mut [[f64; 1]],
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for j in (0..self.factor.size).rev() {
            let column = self.factor.column(j);
            let known = self.rhs[j + 1..].as_flattened();
            self.rhs[j][0] = (self.rhs[j][0] - dot::<S>(&column[1..], known)) * column[0];
        }
    }
}

/// Inverts a factored matrix within its band.
struct Inversion<'a>(&'a Band);

impl WithSimd for Inversion<'_> {
    type Output = BandInverse;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> BandInverse {
        let Band {
            size, half, stride, ..
        } = *self.0;
        let mut inverse = Band::zeros(size, half);
        let mut sums = vec![0.0; half];
        for j in (0..size).rev() {
            let [pivot, below @ ..] = self.0.column(j) else {
                continue;
            };
            let sums = &mut sums[..below.len()];
            sums.fill(0.0);
            let (before, known) = inverse.columns.split_at_mut((j + 1) * stride);
            for (k, l) in below.iter().enumerate() {
                let column = &known[k * stride..][..below.len() - k];
                let (here, after) = sums[k..].split_at_mut(1);
                here[0] += l * column[0] + dot_and_add::<S>(&column[1..], &below[k + 1..], *l, after);
            }
            let target = &mut before[j * stride..];
            for (entry, sum) in target[1..].iter_mut().zip(&*sums) {
                *entry = -pivot * sum;
            }
            target[0] = pivot * (pivot - dot::<S>(below, &target[1..]));
        }
        BandInverse(inverse)
    }
}

/// The sum of products of a column and a row, in lanes as in [`dot`]; also adds `factor * column` to `sums`.
#[inline(always)]
fn dot_and_add<S: Simd>(column: &[f64], row: &[f64], factor: f64, sums: &mut [f64]) -> f64 {
    let (columns, columns_rest) = column.as_chunks::<LANES>();
    let (rows, rows_rest) = row.as_chunks::<LANES>();
    let (totals, totals_rest) = sums.as_chunks_mut::<LANES>();
    let mut lanes = [0.0; LANES];
    for ((z, l), total) in columns.iter().zip(rows).zip(totals) {
        for ((lane, z), l) in lanes.iter_mut().zip(z).zip(l) {
            *lane = mul_add::<S>(*z, *l, *lane);
        }
        add_scaled::<S, _>(total, factor, z);
    }
    let mut rest = 0.0;
    for ((z, l), total) in columns_rest.iter().zip(rows_rest).zip(totals_rest) {
        rest = mul_add::<S>(*z, *l, rest);
        *total = mul_add::<S>(factor, *z, *total);
    }
    lanes.iter().sum::<f64>() + rest
}

/// Sum of products in lanes, so that no product waits for the sum before it. The longer of the two is cut.
#[inline(always)]
fn dot<S: Simd>(a: &[f64], b: &[f64]) -> f64 {
    let length = a.len().min(b.len());
    let (a, a_rest) = a[..length].as_chunks::<LANES>();
    let (b, b_rest) = b[..length].as_chunks::<LANES>();
    let mut lanes = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane = mul_add::<S>(*a, *b, *lane);
        }
    }
    let mut rest = 0.0;
    for (a, b) in a_rest.iter().zip(b_rest) {
        rest = mul_add::<S>(*a, *b, rest);
    }
    lanes.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn agrees_with_a_dense_factorisation() {
        let (size, half) = (47, 11);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut dense = DMatrix::<f64>::identity(size, size) * 30.0;
        let mut band = Band::zeros(size, half);
        for i in 0..size {
            band.add(i, i, 30.0);
            for j in i.saturating_sub(half)..i {
                let value = rng.random_range(-1.0..1.0);
                band.add(i, j, value);
                dense[(i, j)] = value;
                dense[(j, i)] = value;
            }
        }
        let mut rhs: Vec<[f64; 1]> = (0..size).map(|_| [rng.random_range(-1.0..1.0)]).collect();
        let expected = dense
            .clone()
            .lu()
            .solve(&DMatrix::from_fn(size, 1, |i, _| rhs[i][0]))
            .unwrap();
        let factor = band.factor().unwrap();
        assert!((factor.log_det() - dense.determinant().ln()).abs() < 1e-9);
        let mut half_solved: Vec<[f64; 2]> = rhs.iter().map(|r| [r[0], 2.0 * r[0]]).collect();
        factor.forward(&mut half_solved);
        let quadratic: f64 = half_solved.iter().map(|r| r[0] * r[1] / 2.0).sum();
        let direct: f64 = rhs.iter().zip(&expected).map(|(r, e)| r[0] * e).sum();
        assert!((quadratic - direct).abs() < 1e-12);
        let inverse = factor.inverse();
        let expected_inverse = dense.try_inverse().unwrap();
        for j in 0..size {
            for k in 0..=half.min(size - 1 - j) {
                for (row, entry) in (j + k..).zip(inverse.run(j, j + k)) {
                    let is_kept = row < size && row <= j + half;
                    let expected = if is_kept { expected_inverse[(row, j)] } else { 0.0 };
                    assert!((entry - expected).abs() < 1e-12);
                }
            }
        }
        factor.solve(&mut rhs);
        assert!(rhs.iter().zip(&expected).all(|(r, e)| (r[0] - e).abs() < 1e-12));
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut band = Band::zeros(2, 1);
        band.add(0, 0, 1.0);
        band.add(1, 1, 1.0);
        band.add(1, 0, 2.0);
        assert!(band.factor().is_none());
    }
}
