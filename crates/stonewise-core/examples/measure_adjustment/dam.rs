//! The simulated dam section that lies beside the checkout, made by another simulator.

use crate::Case;
use crate::trial::{Crack, Stones, Trial, Truth, mean};
use nalgebra::{Point3, Rotation3, Vector3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_core::evaluate::MotionField;

pub fn folder() -> PathBuf {
    std::env::var_os("STONEWISE_SURVEY").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/dam_small"),
        PathBuf::from,
    )
}

fn read_stones(path: &Path) -> Stones {
    let mut reader = las::Reader::from_path(path).unwrap();
    let mut stones = Stones::new();
    for point in reader.read_all().unwrap().points() {
        let point = point.unwrap();
        let id = u32::from_le_bytes(point.extra_bytes[..4].try_into().unwrap());
        stones
            .entry(id)
            .or_default()
            .push(Point3::new(point.x, point.y, point.z));
    }
    stones
}

struct Row {
    truth: Truth,
    centroid: Point3<f64>,
    rotation: Vector3<f64>,
}

fn read_truth(path: &Path, sensor: &str) -> BTreeMap<u32, Row> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    lines
        .map(|line| {
            let f: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
            let vector = |a: &str, b: &str, c: &str| Vector3::new(f[column(a)], f[column(b)], f[column(c)]);
            let row = Row {
                centroid: vector("cx", "cy", "cz").into(),
                rotation: vector("rx", "ry", "rz"),
                truth: Truth {
                    normal: vector("nx", "ny", "nz"),
                    displacement: vector("dx", "dy", "dz"),
                    shared: vector("bgx", "bgy", "bgz"),
                    loose: f[column("loose")] > 0.5,
                    countable: f[column(&format!("vis_{sensor}"))] >= 0.35 && f[column("edge")] < 0.5,
                    spoilt: false,
                },
            };
            (f[column("stone_id")] as u32, row)
        })
        .collect()
}

/// `None` for the cases that this survey does not have.
pub fn build(case: Case, sensor: &str) -> Option<Trial> {
    let combo = match case {
        Case::Combo | Case::Datum => true,
        Case::Still | Case::Translation | Case::Bulge | Case::Crack => false,
        Case::Edge | Case::Settlement | Case::Loose => return None,
    };
    let folder = folder().join(if combo { "combo" } else { "split" }).join("truth");
    let first = read_stones(&folder.join(format!("epoch1_cloud_{sensor}_truth.laz")));
    let mut second = read_stones(&folder.join(format!("epoch2_cloud_{sensor}_truth.laz")));
    let crack = Crack {
        across: Vector3::y(),
        at: 0.2,
    };
    let field = match case {
        Case::Translation => MotionField::translation(Vector3::new(0.0, 0.02, 0.05)).ok(),
        Case::Bulge => {
            let direction = Vector3::new(1.0, 0.0, 0.2);
            MotionField::bulge(Point3::new(-0.2, 0.4, 1.3), 0.05, 2.25, direction).ok()
        }
        _ => None,
    };
    let at = |p: &Point3<f64>| match &field {
        Some(field) => field.displacement_at(p),
        None if case == Case::Crack && crack.distance(p) > 0.0 => Vector3::new(0.003, 0.008, 0.005),
        None => Vector3::zeros(),
    };
    let rows = read_truth(&folder.join("stones.csv"), sensor);
    if !combo {
        // A crack runs along joints: a stone moves as one, what is no stone where it lies.
        for (id, points) in &mut second {
            let of_stone = (case == Case::Crack && rows.contains_key(id))
                .then(|| first.get(id))
                .flatten()
                .map(|points| at(&mean(points)));
            points
                .iter_mut()
                .for_each(|p| *p += of_stone.unwrap_or_else(|| at(p)));
        }
    }
    let mut truth = BTreeMap::new();
    for (id, mut row) in rows {
        let Some(points) = first.get(&id) else { continue };
        let c = mean(points);
        let turn = Rotation3::new(row.rotation);
        if case == Case::Datum {
            for p in second.get_mut(&id).into_iter().flatten() {
                *p = row.centroid + turn.inverse() * (*p - row.centroid - row.truth.displacement);
            }
            row.truth.displacement = Vector3::zeros();
            row.truth.loose = false;
        } else if combo {
            row.truth.displacement += turn * (c - row.centroid) - (c - row.centroid);
        } else {
            row.truth.displacement = at(&c);
        }
        truth.insert(id, row.truth);
    }
    Some(Trial {
        stones: [first, second],
        truth,
        crack: (case == Case::Crack).then_some(crack),
        bounds: BTreeMap::new(),
    })
}
