//! The paper's two motions, in the directions of the wall at hand.

use crate::error::{Error, Result};
use nalgebra::{Point3, Vector3};
use stonewise_core::evaluate::MotionField;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::stone::Stone;

/// Translation of the whole wall along it and upwards, metres: the paper's 2 cm and 5 cm.
const SHIFT_M: [f64; 2] = [0.02, 0.05];
/// Depth of the bulge, metres, as in the paper.
const DEPTH_M: f64 = 0.05;
/// Diameter of the bulge, metres, as in the paper; on a wall under twice this height it is half the height,
/// and the depth less in proportion.
const DIAMETER_M: f64 = 4.0;

/// A motion that is put into the points of the second half, with its name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct KnownMotion {
    pub name: &'static str,
    pub field: MotionField,
    /// Centre and diameter of the place that moves, metres; `None` where all of the wall does.
    pub region: Option<(Point3<f64>, f64)>,
}

/// The paper's translation in the plane and its bulge out of the plane, for a wall of these stones.
///
/// The translation goes along the wall's horizontal direction and upwards in its mean face; the bulge along
/// the normal of the face at the stone nearest to the middle. Errors: no stones.
pub(super) fn paper_motions(stones: &[Stone]) -> Result<[KnownMotion; 2]> {
    let none = || Error::Survey("there are no stones to put a motion into".to_owned());
    let normal: Vector3<f64> = stones.iter().map(|s| s.normal * s.area_m2.max(1e-6)).sum();
    let frame = FaceFrame::from_normal(&normal);
    let range = |axis: &Vector3<f64>| {
        let along = stones.iter().map(|s| s.centroid.coords.dot(axis));
        along.fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)])
    };
    let (across, high) = (range(&frame.along), range(&frame.up));
    let from_middle = |s: &Stone| {
        let off =
            |axis: &Vector3<f64>, [low, high]: [f64; 2]| s.centroid.coords.dot(axis) - 0.5 * (low + high);
        off(&frame.along, across).hypot(off(&frame.up, high))
    };
    let middle = stones
        .iter()
        .min_by(|a, b| from_middle(a).total_cmp(&from_middle(b)))
        .ok_or_else(none)?;

    let smaller = (across[1] - across[0]).min(high[1] - high[0]);
    let diameter_m = if smaller < 2.0 * DIAMETER_M {
        (0.5 * smaller).max(0.2)
    } else {
        DIAMETER_M
    };
    let depth_m = DEPTH_M * diameter_m / DIAMETER_M;

    // Stones around the middle give the normal there: a single one leans.
    let near: Vector3<f64> = stones
        .iter()
        .filter(|s| (s.centroid - middle.centroid).norm() < diameter_m)
        .map(|s| s.normal)
        .sum();
    let bad = |e: stonewise_core::evaluate::MotionFieldError| Error::Survey(e.to_string());
    let shift = frame.along * SHIFT_M[0] + frame.up * SHIFT_M[1];

    Ok([
        KnownMotion {
            name: "translation",
            field: MotionField::translation(shift).map_err(bad)?,
            region: None,
        },
        KnownMotion {
            name: "bulge",
            field: MotionField::bulge(middle.centroid, depth_m, diameter_m, near).map_err(bad)?,
            region: Some((middle.centroid, diameter_m)),
        },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::id::StoneId;

    /// A wall that looks along -y: along it is +x, to the right of a viewer in front.
    fn wall(width: usize, height: usize) -> Vec<Stone> {
        (0..width * height)
            .map(|i| Stone {
                id: StoneId(i as u32 + 1),
                centroid: Point3::new((i % width) as f64, 3.0, (i / width) as f64),
                normal: -Vector3::y(),
                area_m2: 0.5,
                points: 100,
                photos: 3,
                confidence: 1.0,
            })
            .collect()
    }

    #[test]
    fn motions_follow_the_wall() {
        let [shift, bulge] = paper_motions(&wall(21, 11)).unwrap();
        let at = Point3::new(7.0, 3.0, 2.0);
        assert!((shift.field.displacement_at(&at) - Vector3::new(0.02, 0.0, 0.05)).norm() < 1e-12);
        let (centre, diameter) = bulge.region.unwrap();
        assert_eq!((centre, diameter), (Point3::new(10.0, 3.0, 5.0), 4.0));
        assert!((bulge.field.displacement_at(&centre) - Vector3::new(0.0, -0.05, 0.0)).norm() < 1e-12);
        // A quarter of the diameter from the middle: cos^2(45 degrees).
        let side = bulge.field.displacement_at(&(centre + Vector3::x()));
        assert!((side.norm() - 0.025).abs() < 1e-12);
    }

    #[test]
    fn small_walls_have_small_bulges_and_no_stones_are_an_error() {
        let [_, bulge] = paper_motions(&wall(21, 5)).unwrap();
        assert_eq!(bulge.region.unwrap().1, 2.0);
        assert!((bulge.field.largest_m() - 0.025).abs() < 1e-12);
        assert!(paper_motions(&[]).is_err());
    }
}
