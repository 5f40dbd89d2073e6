//! How the stones moved on the mean, in a sentence.

use crate::results::records::{AdjustmentRecord, Datum};
use crate::texts::Said;
use crate::texts::notices::{MEAN_MOTION, MEAN_MOTION_OF_UNKNOWN_DATUM};

/// The mean motion as measured, with its standard deviations: these hold the error of the registration where
/// it is known, and else the sentence says that they do not.
///
/// Its name differs from that of the common rigid motion, against which stones are tested: that one turns,
/// and weights stones by their own covariances.
pub(super) fn mean_motion(adjustment: &AdjustmentRecord, datum: &Datum) -> Said {
    let of_datum = datum.covariance_at(&datum.centre.into());
    let part = |axis: usize| {
        let shared = of_datum.map_or(0.0, |c| c[(axis, axis)]);
        let variance = adjustment.common_motion_covariance_m2[axis][axis] + shared;
        let (mean, sd) = (adjustment.common_motion_m[axis], variance.max(0.0).sqrt());
        format!("{:.2} +- {:.2}", 1e3 * mean, 1e3 * sd)
    };
    let message = match of_datum.is_some() {
        true => &MEAN_MOTION,
        false => &MEAN_MOTION_OF_UNKNOWN_DATUM,
    };
    let mean = format!("x {}, y {}, z {} mm", part(0), part(1), part(2));
    message.say(&[("mean", Said::numbers(mean))])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::records::{DatumState, EstimatorRecord};
    use crate::testing::registration_record;
    use nalgebra::{Matrix6, Point3};

    #[test]
    fn the_error_of_the_registration_is_in_the_deviations_or_the_sentence_says_that_it_is_not() {
        let EstimatorRecord::Adjustment(adjustment) = registration_record().estimator else {
            panic!("the record is of an adjustment");
        };
        let centre = Point3::new(100.0, 200.0, 50.0);
        // 1 mm of the mean and sqrt(8) mm of the registration: 3 mm. A turn does not move the centre.
        let covariance = Matrix6::from_diagonal(&[8e-6, 8e-6, 8e-6, 1e-6, 1e-6, 1e-6].into());
        let known = Datum::known(DatumState::Stated, &centre, &covariance, String::new());
        assert_eq!(
            mean_motion(&adjustment, &known).english,
            "mean motion of the measured stones that are not loose, as measured: x 1.00 +- 3.00, y 0.00 +- 3.00, \
             z -2.00 +- 3.00 mm (standard deviations with the error of the epochs' registration)"
        );
        let unknown = mean_motion(&adjustment, &Datum::unknown(&centre, String::new())).english;
        assert!(unknown.contains("x 1.00 +- 1.00,"), "{unknown}");
        assert!(unknown.ends_with(
            "(standard deviations without the error of the epochs' registration, which is unknown)"
        ));
    }
}
