//! M3C2 and its normals against an independent implementation (testdata/m3c2, made by py4dgeo).

use nalgebra::{Point3, Vector3};
use std::path::Path;
use stonewise_core::change::{CorePoint, M3c2Params, OutwardReference, estimate_normals, m3c2};
use stonewise_core::cloud::GridIndex;

const TOLERANCE_M: f64 = 1e-6;

fn table(name: &str) -> Vec<Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/m3c2")
        .join(name);
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().skip(1);
    rows.map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect()
}

fn cloud(name: &str) -> GridIndex {
    let points: Vec<_> = table(name)
        .iter()
        .map(|r| Point3::new(r[0], r[1], r[2]))
        .collect();
    GridIndex::new(&points, 0.06)
}

fn params(robust: bool) -> M3c2Params {
    M3c2Params {
        normal_radius_m: 0.15,
        cylinder_radius_m: 0.06,
        max_depth_m: 0.3,
        registration_error_m: 0.002,
        min_points: 2,
        robust,
        ..M3c2Params::default()
    }
}

#[test]
fn distances_limits_spreads_and_counts_are_those_of_py4dgeo() {
    let (first, second, expected) = (cloud("first.csv"), cloud("second.csv"), table("py4dgeo.csv"));
    let core_point = |r: &Vec<f64>| CorePoint {
        position: Point3::new(r[0], r[1], r[2]),
        normal: Some(Vector3::new(r[3], r[4], r[5])),
    };
    let core: Vec<_> = expected.iter().map(core_point).collect();
    for (robust, column) in [(false, 6), (true, 12)] {
        let field = m3c2(&first, &second, &core, &params(robust));
        let mut empty = 0;
        for (point, row) in field.points.iter().zip(&expected) {
            let [distance, limit, spread_1, n_1, spread_2, n_2] = std::array::from_fn(|i| row[column + i]);
            assert_eq!(point.counts.map(f64::from), [n_1, n_2]);
            let Some(ours) = point.distance_m else {
                assert!(distance.is_nan());
                empty += 1;
                continue;
            };
            let pairs = [
                (ours, distance),
                (point.detection_limit_m.unwrap(), limit),
                (point.spread_m[0].unwrap(), spread_1),
                (point.spread_m[1].unwrap(), spread_2),
            ];
            for (ours, theirs) in pairs {
                assert!(
                    (ours - theirs).abs() < TOLERANCE_M,
                    "{point:?}: {ours} or {theirs}"
                );
            }
        }
        assert_eq!((field.points.len(), empty), (250, 3));
    }
}

#[test]
fn normals_are_those_of_py4dgeo() {
    let expected = table("py4dgeo.csv");
    let core: Vec<_> = expected.iter().map(|r| Point3::new(r[0], r[1], r[2])).collect();
    let outward = OutwardReference::Direction(Vector3::new(1.0, 0.0, 0.2));
    let normals = estimate_normals(&cloud("first.csv"), &core, 0.15, &outward);
    for (normal, row) in normals.iter().zip(&expected) {
        assert!((normal.unwrap() - Vector3::new(row[3], row[4], row[5])).norm() < 1e-6);
    }
}
