//! Which side of a real or simulated wall is outside, without cameras (../shared/data; skipped where it is absent).

use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::cloud::{Cloud, MemoryTiles};
use stonewise_core::geometry::cell_of;
use stonewise_core::progress::Silent;
use stonewise_core::surface::{Orientation, oriented_surface};

/// Edge of a surface cell, metres.
const CELL_M: f64 = 0.25;

/// The outside of a cloud as its surface shows it; `None` where the file is absent.
fn found(file: &str) -> Option<Orientation> {
    let path = stonewise_testing::survey(file)?;
    let mut tiles: BTreeMap<[i64; 3], Vec<Point3<f64>>> = BTreeMap::new();
    let points = las::Reader::from_path(&path).unwrap().read_all().unwrap();
    for ((x, y), z) in points.x().zip(points.y()).zip(points.z()) {
        let place = Point3::new(x, y, z);
        tiles.entry(cell_of(&place, 4.0)).or_default().push(place);
    }
    let clouds = tiles
        .into_values()
        .map(|points| Cloud::from_world(points[0], points));
    let found = oriented_surface::<_, Box<dyn std::error::Error + Send + Sync>>(
        &MemoryTiles::new(clouds),
        CELL_M,
        &[],
        &Silent,
    );
    Some(found.unwrap())
}

/// Most cells that face along the wall's normal or against it must face along it, beyond doubt.
fn assert_outside(file: &str, normal: Vector3<f64>) {
    let Some(found) = found(file) else { return };
    let normal = normal.normalize();
    let cosines = found.cells.iter().map(|c| c.normal.dot(&normal));
    let facing: Vec<f64> = cosines.filter(|c| c.abs() > 0.7).collect();
    let right = facing.iter().filter(|c| **c > 0.0).count();
    println!(
        "{file}: {right} of {} cells, {:?}, log-odds of the side {:.1}",
        facing.len(),
        found.evidence,
        found.odds
    );
    assert!(facing.len() > 200);
    assert!(right as f64 > 0.95 * facing.len() as f64 && found.is_sure());
}

#[test]
fn terrestrial_scans_of_a_dam() {
    assert_outside(
        "dam_small/combo/epoch1/cloud_tls.laz",
        Vector3::new(1.0, 0.0, 0.2),
    );
    assert_outside(
        "dam_small/combo/epoch2/cloud_tls.laz",
        Vector3::new(1.0, 0.0, 0.2),
    );
}

#[test]
fn lidar_of_a_dam() {
    assert_outside(
        "dam_small/combo/epoch1/cloud_uav.laz",
        Vector3::new(1.0, 0.0, 0.2),
    );
    assert_outside(
        "dam_small/combo/epoch2/cloud_uav.laz",
        Vector3::new(1.0, 0.0, 0.2),
    );
}

#[test]
fn stereo_cloud_of_a_facade() {
    assert_outside(
        "fountain/epoch1/cloud.laz",
        Vector3::new(0.297_93, -0.954_56, 0.006_87),
    );
    assert_outside(
        "fountain/epoch2/cloud.laz",
        Vector3::new(0.297_93, -0.954_56, 0.006_87),
    );
}

/// Recesses, soffits and carvings, treads before them.
#[test]
fn stereo_cloud_of_a_portal() {
    let (sin, cos) = 205f64.to_radians().sin_cos();
    assert_outside("portal/epoch1/cloud.laz", Vector3::new(cos, sin, 0.0));
    assert_outside("portal/epoch2/cloud.laz", Vector3::new(cos, sin, 0.0));
}
