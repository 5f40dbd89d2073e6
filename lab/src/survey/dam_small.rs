//! Reads the truth of the simulated dam section that lies beside the checkout, made by another simulator.

use super::points::{Points, SurveyPoint};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use std::path::Path;

/// A stone of `truth/stones.csv`.
pub struct StoneRow {
    pub centroid: Point3<f64>,
    pub normal: Vector3<f64>,
    pub rotation: Vector3<f64>,
    pub displacement: Vector3<f64>,
    /// The part of the displacement that neighbours share.
    pub shared: Vector3<f64>,
    pub loose: bool,
    /// 35 % of the face measured in both epochs, and not cut by the section's end.
    pub countable: bool,
}

/// The points of `truth/epochN_cloud_SENSOR_truth.laz` by the number of their stone.
pub fn read_points(path: &Path) -> Points {
    let mut reader = las::Reader::from_path(path).unwrap();
    let data = reader.read_all().unwrap();
    let mut points = Points::new();
    for point in data.points().map(Result::unwrap) {
        // The first extra dimension of this file is the stone.
        let stone = u32::from_le_bytes(point.extra_bytes[..4].try_into().unwrap());
        points.entry(stone).or_default().push(SurveyPoint {
            place: Point3::new(point.x, point.y, point.z),
            source: usize::from(point.point_source_id),
            time_s: point.gps_time.unwrap_or(0.0),
        });
    }
    points
}

/// The stones of `truth/stones.csv` by number; those countable that all of these sensors see.
pub fn read_stones(path: &Path, sensors: &[&str]) -> BTreeMap<u32, StoneRow> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    lines
        .map(|line| {
            let f: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
            let vector = |a: &str, b: &str, c: &str| Vector3::new(f[column(a)], f[column(b)], f[column(c)]);
            let row = StoneRow {
                centroid: vector("cx", "cy", "cz").into(),
                normal: vector("nx", "ny", "nz"),
                rotation: vector("rx", "ry", "rz"),
                displacement: vector("dx", "dy", "dz"),
                shared: vector("bgx", "bgy", "bgz"),
                loose: f[column("loose")] > 0.5,
                countable: sensors.iter().all(|s| f[column(&format!("vis_{s}"))] >= 0.35)
                    && f[column("edge")] < 0.5,
            };
            (f[column("stone_id")] as u32, row)
        })
        .collect()
}
