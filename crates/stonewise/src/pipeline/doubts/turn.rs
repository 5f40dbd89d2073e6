//! Doubts about epochs that are turned against each other.

use super::check::Check;
use super::rules::SMALL_ROTATION;
use crate::results::{Status, StoneRow};
use crate::texts::Said;
use nalgebra::Matrix3;
use stonewise_core::geometry::{DisplacementSample, SmallMotion};
use stonewise_core::statistics::median;

/// The doubt that the wall as a whole turned too far for displacements to be linear in the rotation, as the adjustment
/// and the common rigid motion take them: the term of second order, |w x (w x a)| / 2 for a rotation vector w and an
/// arm a, exceeds the typical standard deviation of a stone.
pub(super) fn turned(rows: &[StoneRow]) -> Option<Check> {
    let measured = rows.iter().filter(|r| r.status == Status::Ok);
    let measured = measured.filter_map(|r| Some((r.centroid, r.motion.as_ref()?)));
    let (samples, mut sds): (Vec<DisplacementSample>, Vec<f64>) = measured
        .filter(|(_, motion)| !motion.loose)
        .map(|(place, motion)| {
            let sample = DisplacementSample {
                place,
                displacement: motion.displacement,
                covariance: Matrix3::identity(),
            };
            (sample, (motion.covariance.trace() / 3.0).max(0.0).sqrt())
        })
        .unzip();
    let sd = median(&mut sds)?;
    let common = SmallMotion::fit(&samples)?;
    let turn = common.motion.fixed_rows::<3>(3).into_owned();
    let second_order =
        |s: &DisplacementSample| turn.cross(&turn.cross(&(s.place - common.centre))).norm() / 2.0;
    let error = samples.iter().map(second_order).fold(0.0, f64::max);
    let values = [
        ("angle", turn.norm().to_degrees()),
        ("error", 1e3 * error),
        ("sd", 1e3 * sd),
    ];
    let values = || values.map(|(name, value)| (name, Said::numbers(format!("{value:.2}"))));
    (sd > 0.0).then(|| SMALL_ROTATION.check(error / sd, values))
}

#[cfg(test)]
mod tests {
    use super::super::check::said;
    use super::*;
    use crate::results::RowMotion;
    use nalgebra::{Point3, Rotation3, Vector3};

    /// Stones of a wall of 3.8 x 1.4 m, turned by this angle about z, with this standard deviation.
    fn wall(degrees: f64, sd_m: f64) -> Vec<StoneRow> {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
        let middle = Point3::new(450_000.0, 5_600_002.0, 300.7);
        let row = |i: u32| {
            let arm = Vector3::new(0.0, 0.2 * f64::from(i % 20) - 1.9, 0.2 * f64::from(i / 20) - 0.7);
            let motion = RowMotion {
                displacement: turn * arm - arm + Vector3::new(0.02, 0.01, 0.0),
                covariance: Matrix3::identity() * sd_m.powi(2),
                ..RowMotion::default()
            };
            StoneRow {
                stone_id: i + 1,
                centroid: middle + arm,
                matched_id: Some(i + 1),
                motion: Some(motion),
                ..StoneRow::default()
            }
        };
        (0..160).map(row).collect()
    }

    #[test]
    fn an_epoch_that_is_turned_by_degrees_is_a_doubt() {
        // 1 - cos 2 degrees = 6.1e-4, at 1.9 m: 1.16 mm.
        let message = said(turned(&wall(2.0, 1e-4))).unwrap();
        assert!(
            message.english.contains("2.00 degrees") && message.english.contains("up to 1.16 mm"),
            "{message}"
        );
        // A millimetre and a half of registration error hides it.
        assert_eq!(said(turned(&wall(2.0, 1.5e-3))), None);
    }

    #[test]
    fn a_wall_that_tilts_is_no_doubt() {
        // 5 mm at its ends.
        assert_eq!(said(turned(&wall(0.15, 1e-4))), None);
        assert_eq!(said(turned(&[])), None);
    }
}
