//! Symmetric positive definite band matrices: Cholesky factor, solves, log determinant.

/// Rows of the lower triangle; row `i` holds columns `i - half ..= i`, missing ones are zero.
pub(super) struct Band {
    size: usize,
    half: usize,
    rows: Vec<f64>,
}

/// The lower Cholesky factor of a [`Band`].
pub(super) struct BandFactor(Band);

impl Band {
    /// A zero matrix with `half` diagonals below the main one.
    pub fn zeros(size: usize, half: usize) -> Self {
        Self {
            size,
            half,
            rows: vec![0.0; size * (half + 1)],
        }
    }

    /// Columns `first ..= first + count - 1` of row `row`; all must lie in the band and not right of the diagonal.
    pub fn row_part(&mut self, row: usize, first: usize, count: usize) -> &mut [f64] {
        let start = row * (self.half + 1) + first + self.half - row;
        &mut self.rows[start..start + count]
    }

    /// Adds to one entry of the lower triangle.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.row_part(row, column, 1)[0] += value;
    }

    /// L L' = A; `None` where A is not positive definite. Cost: size * half^2 multiplications.
    pub fn factor(mut self) -> Option<BandFactor> {
        let width = self.half + 1;
        for i in 0..self.size {
            let (above, current) = self.rows.split_at_mut(i * width);
            let row = &mut current[..width];
            let first = i.saturating_sub(self.half);
            for j in first..i {
                let start = first.max(j.saturating_sub(self.half));
                let other = &above[j * width..(j + 1) * width];
                let sum = dot(
                    &row[start + self.half - i..j + self.half - i],
                    &other[start + self.half - j..self.half],
                );
                let at = j + self.half - i;
                row[at] = (row[at] - sum) * other[self.half];
            }
            let head = &row[first + self.half - i..self.half];
            let pivot = row[self.half] - dot(head, head);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            // The inverse of the diagonal is what every later step needs.
            row[self.half] = pivot.sqrt().recip();
        }
        Some(BandFactor(self))
    }
}

impl BandFactor {
    /// log |A|.
    pub fn log_det(&self) -> f64 {
        let Band { size, half, rows } = &self.0;
        -2.0 * (0..*size).map(|i| rows[i * (half + 1) + half].ln()).sum::<f64>()
    }

    /// Replaces the right-hand sides by L^-1 times them.
    pub fn forward<const N: usize>(&self, rhs: &mut [[f64; N]]) {
        let Band { size, half, rows } = &self.0;
        for i in 0..*size {
            let row = &rows[i * (half + 1)..(i + 1) * (half + 1)];
            let first = i.saturating_sub(*half);
            let (known, rest) = rhs.split_at_mut(i);
            let mut sum = rest[0];
            for (l, y) in row[first + half - i..*half].iter().zip(&known[first..]) {
                for c in 0..N {
                    sum[c] -= l * y[c];
                }
            }
            rest[0] = sum.map(|s| s * row[*half]);
        }
    }

    /// Replaces the right-hand side by A^-1 times it.
    pub fn solve(&self, rhs: &mut [[f64; 1]]) {
        self.forward(rhs);
        let Band { size, half, rows } = &self.0;
        for i in (0..*size).rev() {
            let row = &rows[i * (half + 1)..(i + 1) * (half + 1)];
            let first = i.saturating_sub(*half);
            let value = rhs[i][0] * row[*half];
            rhs[i][0] = value;
            for (l, y) in row[first + half - i..*half].iter().zip(&mut rhs[first..i]) {
                y[0] -= l * value;
            }
        }
    }
}

/// Sum of products in eight lanes, which the compiler turns into vector instructions.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    let pairs = [
        lanes[0] + lanes[4],
        lanes[1] + lanes[5],
        lanes[2] + lanes[6],
        lanes[3] + lanes[7],
    ];
    (pairs[0] + pairs[2]) + (pairs[1] + pairs[3]) + tail
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
