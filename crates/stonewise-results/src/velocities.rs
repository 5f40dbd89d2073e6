//! Velocities of stones, from `trends.parquet`.

use super::evidence::read_table;
use super::names::TRENDS_TABLE;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_base::error::Error;

/// Reads the velocities by stone, along the wall, up and out, metres a year; empty if there is no file.
///
/// # Errors
/// The file is damaged.
pub fn read_velocities(dir: &Path) -> Result<BTreeMap<u32, Vector3<f64>>, Error> {
    let Some(table) = read_table(&dir.join(TRENDS_TABLE))? else {
        return Ok(BTreeMap::new());
    };
    let stones = table.required::<u32>("stone_id")?;
    let [along, up, out] = [
        table.optional::<f64>("v_along")?,
        table.optional::<f64>("v_up")?,
        table.optional::<f64>("v_out")?,
    ];
    let velocity = |i: usize| Some((stones[i], Vector3::new(along[i]?, up[i]?, out[i]?)));
    Ok((0..stones.len()).filter_map(velocity).collect())
}
