//! Factors of dense symmetric matrices with thousands of rows.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, inverse, solve};
use faer::{Mat, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};

/// The Cholesky factor of a symmetric positive definite matrix. It is computed by one thread, block by block, so that
/// callers may factor several matrices side by side and get the same bits for any number of threads.
pub(crate) struct DenseFactor(Mat<f64>);

impl DenseFactor {
    /// The factor, from the lower triangle; `None` where the matrix is not positive definite.
    pub fn of(matrix: &DMatrix<f64>) -> Option<Self> {
        let (rows, columns) = matrix.shape();
        let mut lower = MatRef::from_column_major_slice(matrix.as_slice(), rows, columns).to_owned();
        let scratch = factor::cholesky_in_place_scratch::<f64>(rows, Par::Seq, Default::default());
        factor::cholesky_in_place(
            lower.as_mut(),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .ok()?;
        Some(Self(lower))
    }

    /// Logarithm of the determinant of the matrix.
    pub fn log_det(&self) -> f64 {
        let diagonal = (0..self.0.nrows()).map(|i| self.0[(i, i)].ln());
        2.0 * diagonal.sum::<f64>()
    }

    /// Solves for one right-hand side.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut solution = right.clone();
        let rows = solution.len();
        let columns = MatMut::from_column_major_slice_mut(solution.as_mut_slice(), rows, 1);
        let mut none = MemBuffer::new(solve::solve_in_place_scratch::<f64>(rows, 1, Par::Seq));
        solve::solve_in_place(self.0.as_ref(), columns, Par::Seq, MemStack::new(&mut none));
        solution
    }

    /// The inverse of the matrix.
    pub fn inverse(&self) -> DMatrix<f64> {
        let rows = self.0.nrows();
        let mut inverse = DMatrix::zeros(rows, rows);
        let lower = MatMut::from_column_major_slice_mut(inverse.as_mut_slice(), rows, rows);
        let mut scratch = MemBuffer::new(inverse::inverse_scratch::<f64>(rows, Par::Seq));
        inverse::inverse(lower, self.0.as_ref(), Par::Seq, MemStack::new(&mut scratch));
        inverse.fill_upper_triangle_with_lower_triangle();
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Cholesky;

    #[test]
    fn factors_are_those_of_another_library() {
        for rows in [1, 7, 300] {
            let wave = DMatrix::from_fn(rows, rows, |r, c| ((3 * r + 7 * c * c) as f64).sin());
            let matrix = &wave * wave.transpose() + DMatrix::identity(rows, rows);
            let right = DVector::from_fn(rows, |r, _| (r as f64).cos());
            let (found, expected) = (
                DenseFactor::of(&matrix.lower_triangle()).unwrap(),
                Cholesky::new(matrix.clone()).unwrap(),
            );
            assert!((found.log_det() - expected.ln_determinant()).abs() < 1e-9 * rows as f64);
            assert!((found.solve(&right) - expected.solve(&right)).amax() < 1e-9);
            assert!((found.inverse() - expected.inverse()).amax() < 1e-9);
        }
        assert!(DenseFactor::of(&-DMatrix::identity(5, 5)).is_none());
    }
}
