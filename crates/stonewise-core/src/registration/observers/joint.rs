//! The error of the later epoch at all stones as one joint distribution.

use super::model::Row;
use super::network::Matching;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Error of the later epoch against the reference at the stones: a linear function of a few unknowns, and what is
/// independent from stone to stone. World, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct JointErrors {
    /// Coefficients of each stone: of three unknowns each, by the first of them.
    pub(crate) rows: Vec<Row>,
    /// Covariance of the unknowns; second moments where the error is not taken off the motions.
    pub(crate) covariance: DMatrix<f64>,
    /// Covariance of each stone's independent error, which lies out of its face.
    pub(crate) own: Vec<Matrix3<f64>>,
    /// Expectation of the error of each stone's points where it is taken off the motions; else zero.
    pub(crate) mean: Vec<Vector3<f64>>,
    /// Expectation of the error of each stone's motion, which follows its neighbours, where it is taken off the
    /// motions; else zero.
    pub(crate) mean_of_motions: Vec<Vector3<f64>>,
    /// Errors of matching, where clouds come from photos.
    pub(crate) matching: Option<Matching>,
}

impl JointErrors {
    /// `weighted`: solutions for the unknowns (mean, covariance) with weights that sum to one; `is_taken_off`:
    /// whether motions are less the expectation.
    pub(super) fn new(
        rows: Vec<Row>,
        weighted: &[(f64, &DVector<f64>, &DMatrix<f64>)],
        own: Vec<Matrix3<f64>>,
        is_taken_off: bool,
    ) -> Option<Self> {
        let count = weighted.first()?.1.len();
        let mut mean = DVector::zeros(count);
        if is_taken_off {
            weighted.iter().for_each(|(w, m, _)| mean += *m * *w);
        }
        let mut covariance = DMatrix::zeros(count, count);
        for (w, m, c) in weighted {
            let apart = *m - &mean;
            covariance += (*c + &apart * apart.transpose()) * *w;
        }
        let at = |row: &Row| -> Vector3<f64> {
            row.iter()
                .map(|(first, by)| by * mean.fixed_rows::<3>(*first))
                .sum()
        };
        let mean: Vec<Vector3<f64>> = rows.iter().map(at).collect();
        Some(Self {
            mean_of_motions: mean.clone(),
            mean,
            rows,
            covariance,
            own,
            matching: None,
        })
    }
}
