//! What stones do over time, from `trends.parquet`.

use super::evidence::read_table;
use super::names::TRENDS_TABLE;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_base::error::Error;

/// What a stone does over time: along the wall, up and out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoneCourse {
    /// Velocity, metres a year.
    pub velocity: Vector3<f64>,
    /// Its standard deviations.
    pub velocity_sd: Vector3<f64>,
    /// The smallest false discovery rate at which it counts as moving in proportion to time.
    pub velocity_q: f64,
    /// How far the newest epoch is from what the others predict, metres, and its standard deviations; `None` where they
    /// predict nothing.
    pub departure: Option<[Vector3<f64>; 2]>,
}

/// Reads the courses by stone; empty if there is no file.
///
/// # Errors
/// The file is damaged.
pub fn read_courses(dir: &Path) -> Result<BTreeMap<u32, StoneCourse>, Error> {
    let Some(table) = read_table(&dir.join(TRENDS_TABLE))? else {
        return Ok(BTreeMap::new());
    };
    let stones = table.required::<u32>("stone_id")?;
    let q = table.optional::<f64>("q_v")?;
    let columns = |name: &str| -> Result<[Vec<Option<f64>>; 3], Error> {
        let axis = |axis: &str| table.optional::<f64>(&format!("{name}_{axis}"));
        Ok([axis("along")?, axis("up")?, axis("out")?])
    };
    let [v, sd_v] = [columns("v")?, columns("sd_v")?];
    let [departure, sd_departure] = [columns("departure")?, columns("sd_departure")?];
    let vector =
        |[along, up, out]: &[Vec<Option<f64>>; 3], i: usize| Some(Vector3::new(along[i]?, up[i]?, out[i]?));
    let course = |i: usize| {
        let course = StoneCourse {
            velocity: vector(&v, i)?,
            velocity_sd: vector(&sd_v, i)?,
            velocity_q: q[i]?,
            departure: vector(&departure, i)
                .zip(vector(&sd_departure, i))
                .map(|(value, sd)| [value, sd]),
        };
        Some((stones[i], course))
    };
    Ok((0..stones.len()).filter_map(course).collect())
}
