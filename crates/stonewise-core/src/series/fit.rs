//! Weighted least squares of one component of one stone.

use nalgebra::{DMatrix, DVector};

/// A fitted model.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub coefficients: DVector<f64>,
    /// Their covariance, for the variances that the observations claim.
    pub covariance: DMatrix<f64>,
    /// Sum of the squared standardised residuals.
    pub residuals: f64,
    /// Observations less unknowns.
    pub freedom: usize,
}

impl Fit {
    /// The fit with a coefficient that is zero at a place of its own.
    pub fn with_zero(self, column: usize) -> Self {
        Self {
            coefficients: self.coefficients.insert_row(column, 0.0),
            covariance: self.covariance.insert_row(column, 0.0).insert_column(column, 0.0),
            ..self
        }
    }
}

/// Fits `values` with independent `variances` by the rows of `design`. `None` where the rows do not determine the
/// unknowns.
pub(super) fn fit(design: &DMatrix<f64>, values: &[f64], variances: &[f64]) -> Option<Fit> {
    let (rows, unknowns) = design.shape();
    if rows < unknowns || variances.iter().any(|v| v.is_nan() || *v <= 0.0) {
        return None;
    }
    let mut a = design.clone();
    let mut y = DVector::from_column_slice(values);

    for (row, variance) in variances.iter().enumerate() {
        let root = 1.0 / variance.sqrt();
        a.row_mut(row).scale_mut(root);
        y[row] *= root;
    }

    // Columns have different units.
    let scale: Vec<f64> = (0..unknowns).map(|c| a.column(c).norm()).collect();
    if scale.contains(&0.0) {
        return None;
    }
    (0..unknowns).for_each(|c| a.column_mut(c).unscale_mut(scale[c]));
    let normal = a.transpose() * &a;
    let eigen = normal.clone().symmetric_eigenvalues();
    if eigen.min() < LEAST_EIGENVALUE {
        return None;
    }
    let inverse = normal.cholesky()?.inverse();
    let mut coefficients = &inverse * (a.transpose() * &y);
    let residuals = (&y - &a * &coefficients).norm_squared();

    coefficients.iter_mut().zip(&scale).for_each(|(c, s)| *c /= s);
    let covariance = inverse.map_with_location(|r, c, v| v / (scale[r] * scale[c]));
    Some(Fit {
        coefficients,
        covariance,
        residuals,
        freedom: rows - unknowns,
    })
}

/// Smallest eigenvalue of the normal matrix of unit columns that counts as determined.
const LEAST_EIGENVALUE: f64 = 1e-9;
