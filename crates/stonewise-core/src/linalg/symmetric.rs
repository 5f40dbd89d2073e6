//! Symmetric matrices whose eigenvalues rounding or a difference made negative.

use nalgebra::Matrix3;

/// Symmetric, and without the negative eigenvalues that rounding or a difference of covariances leaves.
pub fn without_negative(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = (0.5 * (covariance + covariance.transpose())).symmetric_eigen();
    let values = eigen.eigenvalues.map(|v| v.max(0.0));
    eigen.eigenvectors * Matrix3::from_diagonal(&values) * eigen.eigenvectors.transpose()
}

/// Symmetric root; negative eigenvalues count as zero.
pub(crate) fn root(symmetric: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = symmetric.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    eigen.eigenvectors * Matrix3::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}
