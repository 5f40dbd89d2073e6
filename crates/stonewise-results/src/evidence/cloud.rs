//! A thinned cloud for the 3D view.

use super::files::{make_dir, path, read_table};
use nalgebra::Point3;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_io::table::{Table, write_parquet};

/// A point of a thinned cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinPoint {
    /// World.
    pub position: Point3<f64>,
    /// From a photo that shows it.
    pub colour: [u8; 3],
    /// Its stone, 0 for none.
    pub stone: u32,
}

/// Writes `evidence/cloud_E.parquet`.
///
/// # Errors
/// The file cannot be written.
pub fn write_thin_cloud(dir: &Path, epoch: usize, points: &[ThinPoint]) -> Result<(), Error> {
    make_dir(dir)?;
    let mut table = Table::new();
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let values: Vec<f64> = points.iter().map(|p| p.position[k]).collect();
        table.push(axis, "m", &format!("point, world {axis}"), values)?;
    }
    for (k, channel) in ["red", "green", "blue"].into_iter().enumerate() {
        let meaning = format!("{channel} of the photos at the point, 0 to 255");
        let values: Vec<u8> = points.iter().map(|p| p.colour[k]).collect();
        table.push(channel, "", &meaning, values)?;
    }
    let stones: Vec<u32> = points.iter().map(|p| p.stone).collect();
    table.push("stone_id", "", "number of the stone, 0 for none", stones)?;
    Ok(write_parquet(&path(dir, "cloud", epoch, "parquet"), &table)?)
}

/// Reads it back; empty where there is none.
pub(super) fn read_thin_cloud(dir: &Path, epoch: usize) -> Result<Vec<ThinPoint>, Error> {
    let Some(table) = read_table(&path(dir, "cloud", epoch, "parquet"))? else {
        return Ok(Vec::new());
    };
    let [x, y, z] = ["x", "y", "z"].map(|n| table.required::<f64>(n));
    let [r, g, b] = ["red", "green", "blue"].map(|n| table.required::<u8>(n));
    let (x, y, z, r, g, b) = (x?, y?, z?, r?, g?, b?);
    let stone = table.required::<u32>("stone_id")?;
    let point = |i: usize| ThinPoint {
        position: Point3::new(x[i], y[i], z[i]),
        colour: [r[i], g[i], b[i]],
        stone: stone[i],
    };
    Ok((0..table.rows()).map(point).collect())
}
