//! Outlines of the stones of a simulated scan against the true areas of their faces.

use nalgebra::{Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::geometry::{FaceFrame, OutlineParams, face_outline};

#[test]
fn outlines_of_scanned_stones_have_the_true_area() {
    let Some(truth) = stonewise_testing::survey("dam_small/combo/truth") else {
        return;
    };
    let table = std::fs::read_to_string(truth.join("stones.csv")).unwrap();
    let mut points: BTreeMap<u32, Vec<Point3<f64>>> = BTreeMap::new();
    let scan = las::Reader::from_path(truth.join("epoch1_cloud_tls_truth.laz"))
        .unwrap()
        .read_all()
        .unwrap();
    for point in scan.points() {
        let point = point.unwrap();
        // The first extra dimension of this file is the stone.
        let id = u32::from_le_bytes(point.extra_bytes[..4].try_into().unwrap());
        points
            .entry(id)
            .or_default()
            .push(Point3::new(point.x, point.y, point.z));
    }
    let columns: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let (mut ratios, mut vertices) = (Vec::new(), 0);
    for line in table.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        let value = |name| cells[columns.iter().position(|c| *c == name).unwrap()];
        let Some(points) = points.get(&(value("stone_id") as u32)) else {
            continue;
        };
        let outward = Vector3::new(value("nx"), value("ny"), value("nz"));
        // Stones that a shrub or the railing hides in part are left out.
        if covered_m2(points, &outward) < 0.95 * value("area_m2") || value("edge") == 1.0 {
            continue;
        }
        let ring = face_outline(points, &outward, &OutlineParams::default()).unwrap();
        let area: Vector3<f64> = (0..ring.len())
            .map(|i| (ring[i] - ring[0]).cross(&(ring[(i + 1) % ring.len()] - ring[0])))
            .sum();
        ratios.push(area.dot(&outward) / 2.0 / value("area_m2"));
        vertices += ring.len();
    }
    ratios.sort_by(f64::total_cmp);
    let at = |q: f64| ratios[(q * (ratios.len() - 1) as f64) as usize];
    println!(
        "{} stones, area over true area: {:.3} {:.3} {:.3}",
        ratios.len(),
        at(0.1),
        at(0.5),
        at(0.9)
    );
    println!("{} vertices a stone", vertices / ratios.len());
    assert!(ratios.len() > 50 && vertices / ratios.len() < 40);
    assert!((at(0.5) - 1.0).abs() < 0.04 && at(0.1) > 0.9 && at(0.9) < 1.1);
}

/// Area of the 2 cm squares of the face that hold points.
fn covered_m2(points: &[Point3<f64>], outward: &Vector3<f64>) -> f64 {
    let frame = FaceFrame::from_normal(outward);
    let square = |p: &Point3<f64>| {
        let at = |axis: &Vector3<f64>| (p.coords.dot(axis) / 0.02).floor() as i64;
        (at(&frame.along), at(&frame.up))
    };
    points.iter().map(square).collect::<BTreeSet<_>>().len() as f64 * 4e-4
}
