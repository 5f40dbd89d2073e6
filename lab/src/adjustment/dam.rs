//! The simulated dam section that lies beside the checkout, made by another simulator.

use super::Case;
use super::trial::{Crack, Trial, Truth};
use crate::survey::{Places, mean, places, read_points, read_stones};
use nalgebra::{Point3, Rotation3, Vector3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_core::evaluate::MotionField;

pub fn folder() -> PathBuf {
    std::env::var_os("STONEWISE_SURVEY").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/dam_small"),
        PathBuf::from,
    )
}

fn read_places(path: &Path) -> Places {
    let points = read_points(path);
    places(&points, &points.keys().copied().collect::<Vec<_>>())
}

/// The sensors of the epochs: `tls-uav` is a scanner, then a drone.
fn sensors_of(sensor: &str) -> [&str; 2] {
    let (first, second) = sensor.split_once('-').unwrap_or((sensor, sensor));
    [first, second]
}

/// `None` for the cases that this survey does not have.
pub fn build(case: Case, sensor: &str) -> Option<Trial> {
    let combo = match case {
        Case::Combo | Case::Datum => true,
        Case::Still | Case::Translation | Case::Bulge | Case::Crack => false,
        Case::Edge | Case::Settlement | Case::Loose => return None,
    };
    let folder = folder().join(if combo { "combo" } else { "split" }).join("truth");
    let of_epochs = sensors_of(sensor);
    let cloud = |epoch: usize| {
        let sensor = of_epochs[epoch];
        read_places(&folder.join(format!("epoch{}_cloud_{sensor}_truth.laz", epoch + 1)))
    };
    let (first, mut second) = (cloud(0), cloud(1));
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
    let rows = read_stones(&folder.join("stones.csv"), &of_epochs);

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
                *p = row.centroid + turn.inverse() * (*p - row.centroid - row.displacement);
            }
            row.displacement = Vector3::zeros();
            row.loose = false;
        } else if combo {
            row.displacement += turn * (c - row.centroid) - (c - row.centroid);
        } else {
            row.displacement = at(&c);
        }
        let of_stone = Truth {
            normal: row.normal,
            displacement: row.displacement,
            shared: row.shared,
            loose: row.loose,
            countable: row.countable,
            spoilt: false,
        };
        truth.insert(id, of_stone);
    }

    Some(Trial {
        stones: [first, second],
        truth,
        crack: (case == Case::Crack).then_some(crack),
        bounds: BTreeMap::new(),
    })
}
