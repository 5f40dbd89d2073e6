//! Differences between epochs, taken apart into looks of single epochs.

use crate::id::StoneId;
use nalgebra::{Matrix3, Vector3};

/// What a pair of epochs shows of a stone: a later epoch less the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairLook {
    /// Along the wall, up and out, metres.
    pub value: Vector3<f64>,
    /// Its variances, m^2.
    pub variance: Vector3<f64>,
    /// The part of the variances that the reference brings in, 0 to 1.
    pub reference_share: f64,
}

/// Where an epoch saw a stone: along the wall, up and out, from where the reference saw it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Metres; zero in the reference.
    pub value: Vector3<f64>,
    /// Variances of the epoch's own error, m^2, which is independent of that of other epochs.
    pub variance: Vector3<f64>,
}

/// A stone over all epochs.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneSeries {
    /// Stone of the reference.
    pub stone: StoneId,
    /// One for each epoch; `None`: not measured.
    pub looks: Vec<Option<Look>>,
    /// Standard deviations of the velocity that no look shows, as all epochs smooth it alike: along the wall, up and
    /// out, metres a year.
    pub smoothed: Vector3<f64>,
}

impl StoneSeries {
    /// The looks behind pairs, one for each epoch and `None` at the reference and where nothing was measured.
    ///
    /// The variance of the reference's look is the mean of what the pairs say of it. So the joint covariance of the
    /// differences, that variance between two of them and the sum of two variances on the diagonal, is positive
    /// definite whatever the pairs say.
    pub fn of_pairs(stone: StoneId, reference: usize, pairs: &[Option<PairLook>]) -> Self {
        let measured: Vec<&PairLook> = pairs.iter().flatten().collect();
        let of_reference: Vector3<f64> = measured.iter().map(|p| p.variance * p.reference_share).sum();
        let look = |(epoch, pair): (usize, &Option<PairLook>)| match pair {
            _ if epoch == reference => (!measured.is_empty()).then(|| Look {
                value: Vector3::zeros(),
                variance: of_reference / measured.len() as f64,
            }),
            Some(pair) => Some(Look {
                value: pair.value,
                variance: pair.variance * (1.0 - pair.reference_share),
            }),
            None => None,
        };
        Self {
            stone,
            looks: pairs.iter().enumerate().map(look).collect(),
            smoothed: Vector3::zeros(),
        }
    }
}

/// Covariance of the difference of two motions that count from the same reference, of each its covariance and the
/// part of it that the reference brings in: what the reference brings in drops out.
pub fn covariance_between(one: (&Matrix3<f64>, f64), other: (&Matrix3<f64>, f64)) -> Matrix3<f64> {
    one.0 * (1.0 - one.1) + other.0 * (1.0 - other.1)
}
