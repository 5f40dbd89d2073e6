//! Doubts about the scale of an epoch.

use crate::results::records::Datum;
use crate::results::{Status, StoneRow};
use crate::texts::{STRETCHED, Said};
use nalgebra::{Point3, Vector3};
use stonewise_core::geometry::Strain;

/// Mean strain of a wall that nothing but a wrong scale explains. Moisture swells masonry of natural stone by
/// up to 0.7e-3 in the long run, and its thermal expansion is at most 12e-6 per kelvin (EN 1996-1-1:2005,
/// 3.7.4): 0.3e-3 for 25 K. Both together are 1e-3.
const STRAIN: f64 = 1e-3;
/// Strain that temperature alone gives a wall in every direction, see [`STRAIN`]: a wall that opens in one
/// direction and grows by as much in the other may be sound data.
const THERMAL_STRAIN: f64 = 3e-4;
/// Half width of a 95 % interval of a strain, in standard deviations: Student's law with the eight degrees of
/// freedom of [`Strain`]'s nine parts.
const STRAIN_SIGMAS_95: f64 = 2.306;

/// The wall as a whole grew or shrank by more than masonry can.
pub(super) fn stretched(rows: &[StoneRow], datum: &Datum) -> Option<Said> {
    let measured = rows.iter().filter(|r| r.status == Status::Ok);
    let measured = measured.filter_map(|r| Some((r.centroid, r.motion.as_ref()?)));
    let (places, displacements): (Vec<Point3<f64>>, Vec<Vector3<f64>>) = measured
        .filter(|(_, motion)| !motion.loose)
        .map(|(place, motion)| (place, motion.displacement))
        .unzip();
    let strain = Strain::fit(&places, &displacements)?;
    // Errors of the epochs that are smooth over the wall, alike in every direction, give a scale the same
    // variance as the rotation about the normal: one is the sum of a . d over the sum of a . a, with a the
    // arms and d the errors in the plane, the other the same with the arms turned by a right angle.
    let smooth = datum
        .rotation_covariance()
        .map_or(0.0, |c| strain.normal.dot(&(c * strain.normal)));
    let half_width = |sd: f64| STRAIN_SIGMAS_95 * (sd * sd + smooth.max(0.0)).sqrt();
    let sign = strain.mean.signum();
    let is_large = sign * strain.mean - half_width(strain.mean_sd) > STRAIN;
    let is_all_round = sign * strain.lesser - half_width(strain.lesser_sd) > THERMAL_STRAIN;
    (is_large && is_all_round).then(|| {
        let values = [
            ("strain", format!("{:+.1}", 1e3 * strain.mean)),
            ("half_width", format!("{:.1}", 1e3 * half_width(strain.mean_sd))),
            ("lesser", format!("{:+.1}", 1e3 * strain.lesser)),
        ];
        STRETCHED.say(&values.map(|(name, value)| (name, Said::numbers(value))))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::RowMotion;
    use crate::results::records::DatumState;
    use nalgebra::Matrix6;

    /// Stones of a wall of 3.8 x 1.4 m that faces along x, displaced by these gradients along y and z.
    fn strained(gradients: [[f64; 2]; 2], loose: bool) -> Vec<StoneRow> {
        let row = |i: u32| {
            let [y, z] = [f64::from(i % 20), f64::from(i / 20)].map(|k| 0.2 * k);
            let [dy, dz] = gradients.map(|g| g[0] * y + g[1] * z);
            let motion = RowMotion {
                displacement: Vector3::new(0.02, 0.01 + dy, dz),
                loose,
                ..RowMotion::default()
            };
            StoneRow {
                stone_id: i + 1,
                centroid: Point3::new(450_000.0, 5_600_000.0 + y, 300.0 + z),
                matched_id: Some(i + 1),
                motion: Some(motion),
                ..StoneRow::default()
            }
        };
        (0..160).map(row).collect()
    }

    fn datum(rotation_sd: f64) -> Datum {
        let covariance = Matrix6::identity() * rotation_sd.powi(2);
        Datum::known(DatumState::Sources, &Point3::origin(), &covariance, String::new())
    }

    #[test]
    fn a_wall_that_grew_or_shrank_all_round_is_a_doubt() {
        let unknown = Datum::unknown(&Point3::origin(), String::new());
        let grown = strained([[0.003, 0.0], [0.0, 0.003]], false);
        let message = stretched(&grown, &unknown).unwrap();
        assert!(message.english.contains("+3.0 +- 0.0 mm per metre"), "{message}");
        let shrunk = strained([[-0.003, 0.0], [0.0, -0.003]], false);
        assert!(stretched(&shrunk, &unknown).is_some_and(|m| m.english.contains("-3.0 +- 0.0")));
        // A drone whose strips turn against each other by a milliradian may as well have this scale.
        assert!(stretched(&grown, &datum(1e-4)).is_some_and(|m| m.english.contains("+3.0 +- 0.2")));
        assert_eq!(stretched(&grown, &datum(1e-3)), None);
        // The scale beside one end that settles by 2 mm per metre.
        assert!(stretched(&strained([[0.003, 0.0], [0.002, 0.003]], false), &unknown).is_some());
    }

    #[test]
    fn motions_that_masonry_can_have_are_no_doubt() {
        let unknown = Datum::unknown(&Point3::origin(), String::new());
        // Cracks that open all along and a warm day; one end settles; the wall turns; a wet and warm season.
        let sound = [
            [[0.005, 0.0], [0.0, 0.00025]],
            [[0.0, 0.0], [0.005, 0.0]],
            [[0.0, -0.01], [0.01, 0.0]],
            [[0.0009, 0.0], [0.0, 0.0009]],
        ];
        for gradients in sound {
            assert_eq!(
                stretched(&strained(gradients, false), &unknown),
                None,
                "{gradients:?}"
            );
        }
        let grown = [[0.003, 0.0], [0.0, 0.003]];
        assert_eq!(stretched(&strained(grown, true), &unknown), None);
        assert_eq!(stretched(&strained(grown, false)[..17], &unknown), None);
    }
}
