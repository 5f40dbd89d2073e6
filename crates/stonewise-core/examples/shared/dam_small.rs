//! Reads the truth of the simulated dam section that lies beside the checkout, made by another simulator.

use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use std::path::Path;

/// A point with the stone's number, from `truth/epochN_cloud_SENSOR_truth.laz`.
pub struct SurveyPoint {
    pub stone: u32,
    pub place: Point3<f64>,
    pub source: u16,
    pub time_s: f64,
}

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

pub fn read_points(path: &Path) -> Vec<SurveyPoint> {
    let mut reader = las::Reader::from_path(path).unwrap();
    let data = reader.read_all().unwrap();
    let point = |p: las::Point| SurveyPoint {
        stone: u32::from_le_bytes(p.extra_bytes[..4].try_into().unwrap()),
        place: Point3::new(p.x, p.y, p.z),
        source: p.point_source_id,
        time_s: p.gps_time.unwrap_or(0.0),
    };
    data.points().map(|p| point(p.unwrap())).collect()
}

pub fn read_stones(path: &Path, sensor: &str) -> BTreeMap<u32, StoneRow> {
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
                countable: f[column(&format!("vis_{sensor}"))] >= 0.35 && f[column("edge")] < 0.5,
            };
            (f[column("stone_id")] as u32, row)
        })
        .collect()
}
