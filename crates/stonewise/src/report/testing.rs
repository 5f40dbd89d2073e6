//! Made-up results for the tests of this module.

use super::outlines::StoneOutline;
use super::{RowMotion, Status, StoneRow};
use nalgebra::{Matrix3, Point3, Vector3};

/// A wall of 6 x 4 stones that looks along x: one moved by 2 cm, one loose, some without a motion.
pub(super) fn rows() -> Vec<StoneRow> {
    (1..=24).map(row).collect()
}

/// Their outlines: rectangles of 40 x 25 cm.
pub(super) fn outlines() -> Vec<StoneOutline> {
    let corner = |c: Point3<f64>, y: f64, z: f64| c + Vector3::new(0.0, 0.19 * y, 0.115 * z);
    let outline = |r: StoneRow| StoneOutline {
        stone_id: r.stone_id,
        normal: Vector3::x(),
        ring: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(y, z)| corner(r.centroid, y, z))
            .to_vec(),
    };
    rows().into_iter().map(outline).collect()
}

fn row(stone_id: u32) -> StoneRow {
    let (column, course) = (f64::from((stone_id - 1) % 6), f64::from((stone_id - 1) / 6));
    let status = match stone_id {
        3 => Status::UnmatchedLost,
        4 => Status::UnmatchedAmbiguous,
        10 => Status::FailedPoints,
        17 => Status::Unobservable,
        _ => Status::Ok,
    };
    let matched = !matches!(status, Status::UnmatchedLost | Status::UnmatchedAmbiguous);
    StoneRow {
        stone_id,
        centroid: Point3::new(100.0, 200.0 + 0.4 * column, 50.0 + 0.25 * course),
        area_m2: 0.0874,
        points_1: 2000 + stone_id,
        points_2: matched.then_some(1900),
        photos: 5,
        confidence: 0.875,
        matched_id: matched.then_some(100 + stone_id),
        status,
        motion: (status == Status::Ok).then(|| motion(stone_id)),
    }
}

fn motion(stone_id: u32) -> RowMotion {
    let displacement = match stone_id {
        8 => Vector3::new(0.003, 0.02, -0.001),
        15 => Vector3::new(0.02, 0.0, 0.004),
        _ => Vector3::new(0.0003, -0.0002, 0.0001 * f64::from(stone_id % 5)),
    };
    let covariance = Matrix3::identity() * 0.000_5_f64.powi(2);
    RowMotion {
        displacement,
        face: Vector3::new(displacement.y, displacement.z, displacement.x),
        rotation: Vector3::new(0.001, 0.0, 0.0),
        covariance,
        relative: displacement,
        detection_limit_m: 0.000_5 * 2.795_483,
        significant: displacement.norm() > 0.000_5 * 2.795_483,
        loose: stone_id == 15,
        observability: 0.7,
    }
}
