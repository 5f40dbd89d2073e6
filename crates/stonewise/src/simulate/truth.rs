//! The truth of a simulated survey as files; never an input of the method.

use crate::simulate::SimulateError;
use std::path::Path;
use stonewise_core::raster::LabelImage;
use stonewise_core::simulate::{EpochScans, Scan, StoneTruth, World, photo_counts, point_counts, seen_share};
use stonewise_io::table::{Table, TableError, write_csv};

/// What was measured of each stone in one epoch, in the wall's order.
pub struct Seen {
    tls: (Vec<u32>, Vec<f64>),
    uav: (Vec<u32>, Vec<f64>),
    images: Vec<u32>,
}

/// A stone counts as shown in a photo from this many pixels on.
const SHOWN_PIXELS: u32 = 150;

/// Counts what one epoch (0 or 1) shows of each stone.
pub fn count_seen(
    world: &World,
    truths: &[StoneTruth],
    scans: &EpochScans,
    labels: &[LabelImage],
    epoch: usize,
) -> Seen {
    let stones = truths.len();
    let of = |scan: &Option<Scan>| {
        scan.as_ref().map_or((vec![0; stones], vec![0.0; stones]), |s| {
            (point_counts(s, stones), seen_share(world, truths, s, epoch))
        })
    };
    Seen {
        tls: of(&scans.tls),
        uav: of(&scans.uav),
        images: photo_counts(labels, stones, SHOWN_PIXELS),
    }
}

/// Writes truth/stones.csv, one row a stone.
pub fn write_stone_table(path: &Path, truths: &[StoneTruth], seen: &[Seen; 2]) -> Result<(), SimulateError> {
    Ok(write_csv(path, &stone_table(truths, seen)?)?)
}

fn stone_table(truths: &[StoneTruth], seen: &[Seen; 2]) -> Result<Table, TableError> {
    let mut table = Table::new();
    table.push("stone_id", truths.iter().map(|t| t.id.0).collect::<Vec<_>>())?;
    let real = |get: &dyn Fn(&StoneTruth) -> f64| truths.iter().map(get).collect::<Vec<f64>>();
    let flag =
        |get: &dyn Fn(&StoneTruth) -> bool| truths.iter().map(|t| u32::from(get(t))).collect::<Vec<_>>();
    for (axis, name) in ["cx", "cy", "cz"].iter().enumerate() {
        table.push(name, real(&|t| t.centroid[axis]))?;
    }
    table.push("u", real(&|t| t.middle[0]))?;
    table.push("v", real(&|t| t.middle[1]))?;
    table.push("area_m2", real(&|t| t.area_m2))?;
    table.push("width", real(&|t| t.size_m[0]))?;
    table.push("height", real(&|t| t.size_m[1]))?;
    for (axis, name) in ["dx", "dy", "dz"].iter().enumerate() {
        table.push(name, real(&|t| t.displacement[axis]))?;
    }
    for (axis, name) in ["rx", "ry", "rz"].iter().enumerate() {
        table.push(name, real(&|t| t.rotation[axis]))?;
    }
    table.push("loose", flag(&|t| t.loose))?;
    for (axis, name) in ["bgx", "bgy", "bgz"].iter().enumerate() {
        table.push(name, real(&|t| t.shared[axis]))?;
    }
    table.push("edge", flag(&|t| t.edge))?;
    for (axis, name) in ["nx", "ny", "nz"].iter().enumerate() {
        table.push(name, real(&|t| t.normal[axis]))?;
    }
    for (number, epoch) in (1..).zip(seen) {
        table.push(&format!("n_tls_{number}"), epoch.tls.0.clone())?;
    }
    for (number, epoch) in (1..).zip(seen) {
        table.push(&format!("n_uav_{number}"), epoch.uav.0.clone())?;
    }
    for (number, epoch) in (1..).zip(seen) {
        table.push(&format!("n_img_{number}"), epoch.images.clone())?;
    }
    let both = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p.min(*q)).collect::<Vec<f64>>();
    table.push("vis_tls", both(&seen[0].tls.1, &seen[1].tls.1))?;
    table.push("vis_uav", both(&seen[0].uav.1, &seen[1].uav.1))?;
    Ok(table)
}
