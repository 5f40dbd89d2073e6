//! Points of a stone along two lines through its middle, in both epochs.

use super::files::{make_dir, path, read_table};
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_io::table::{Table, write_parquet};

/// Which way a section runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Along the wall.
    Level,
    /// Up the face.
    Upright,
}

/// A point in a section, in the face frame about the stone's centroid in the first epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionPoint {
    /// Stone of the first epoch.
    pub stone_id: u32,
    /// Whether the point is one of the later epoch.
    pub is_later: bool,
    /// The section it belongs to.
    pub cut: Cut,
    /// Along the section (along the wall, or up the face), metres.
    pub place_m: f32,
    /// Out of the face, metres.
    pub out_m: f32,
}

/// Writes `evidence/sections_E.parquet`: points of the first epoch and of epoch `later`, sorted by stone.
///
/// # Errors
/// The file cannot be written.
pub fn write_sections(dir: &Path, later: usize, points: &[SectionPoint]) -> Result<(), Error> {
    make_dir(dir)?;
    let mut table = Table::new();
    let stones: Vec<u32> = points.iter().map(|p| p.stone_id).collect();
    table.push("stone_id", "", "number of the stone", stones)?;
    let is_later: Vec<bool> = points.iter().map(|p| p.is_later).collect();
    table.push("later", "", "whether the point is of the later epoch", is_later)?;
    let upright: Vec<bool> = points.iter().map(|p| p.cut == Cut::Upright).collect();
    table.push(
        "upright",
        "",
        "whether the section is upright, else level",
        upright,
    )?;
    table.push(
        "place",
        "m",
        "along the section, from the stone's centroid in the first epoch",
        points.iter().map(|p| p.place_m).collect::<Vec<f32>>(),
    )?;
    table.push(
        "out",
        "m",
        "out of the face, from the stone's centroid in the first epoch",
        points.iter().map(|p| p.out_m).collect::<Vec<f32>>(),
    )?;
    Ok(write_parquet(&path(dir, "sections", later, "parquet"), &table)?)
}

/// Reads it back; empty where there is none.
pub(super) fn read_sections(dir: &Path, later: usize) -> Result<Vec<SectionPoint>, Error> {
    let Some(table) = read_table(&path(dir, "sections", later, "parquet"))? else {
        return Ok(Vec::new());
    };
    let stone = table.required::<u32>("stone_id")?;
    let (is_later, upright) = (
        table.required::<bool>("later")?,
        table.required::<bool>("upright")?,
    );
    let (place, out) = (table.required::<f32>("place")?, table.required::<f32>("out")?);
    let point = |i: usize| SectionPoint {
        stone_id: stone[i],
        is_later: is_later[i],
        cut: if upright[i] { Cut::Upright } else { Cut::Level },
        place_m: place[i],
        out_m: out[i],
    };
    Ok((0..table.rows()).map(point).collect())
}
