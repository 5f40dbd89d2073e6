//! Heights of a geoid above the ellipsoid, on a grid.
//!
//! Format: NOAA's VDatum grid shift (GTX), as PROJ reads it: big-endian, corner in the south-west, steps, rows and
//! columns, then single-precision heights in metres from south to north.

use super::ellipsoid::Geodetic;
use std::fs;
use std::path::{Path, PathBuf};

const HEAD_BYTES: usize = 40;
/// Stands for a node without a height.
const NO_HEIGHT: f32 = -88.8888;
/// No geoid is farther from the ellipsoid, metres.
const MOST_M: f32 = 200.0;

/// A grid of heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Geoid {
    /// South-west corner: latitude, longitude, degrees.
    corner: [f64; 2],
    /// From row to row and from column to column, degrees.
    step: [f64; 2],
    columns: usize,
    rows: usize,
    heights: Vec<f32>,
}

/// Why a grid cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{reason}: {}", path.display())]
pub struct GeoidError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong, and the fix.
    pub reason: String,
}

impl Geoid {
    /// Reads a GTX file.
    ///
    /// # Errors
    /// The file cannot be read, or is no such grid.
    pub fn read(path: &Path) -> Result<Self, GeoidError> {
        let failed = |reason: String| GeoidError {
            path: path.to_owned(),
            reason,
        };
        let bytes = fs::read(path).map_err(|e| failed(format!("cannot read the geoid: {e}")))?;
        Self::of(&bytes).ok_or_else(|| {
            let fix =
                "not a grid of a geoid: give a GTX file (gdal_translate -of GTX makes one of a GeoTIFF)";
            failed(fix.to_owned())
        })
    }

    fn of(bytes: &[u8]) -> Option<Self> {
        let (head, body) = bytes.split_at_checked(HEAD_BYTES)?;
        let number = |place: usize| Some(f64::from_be_bytes(*head.get(8 * place..)?.first_chunk()?));
        let count = |place: usize| {
            let count = i32::from_be_bytes(*head.get(place..)?.first_chunk()?);
            usize::try_from(count).ok().filter(|count| *count >= 2)
        };
        let (rows, columns) = (count(32)?, count(36)?);
        if body.len() != rows.checked_mul(columns)?.checked_mul(4)? {
            return None;
        }
        let grid = Self {
            corner: [number(0)?, number(1)?],
            step: [number(2)?, number(3)?],
            columns,
            rows,
            heights: body
                .chunks_exact(4)
                .map(|c| f32::from_be_bytes([c[0], c[1], c[2], c[3]]))
                .collect(),
        };
        let is_on_earth = grid.corner[0].abs() <= 90.0 && grid.corner[1].abs() <= 360.0;
        let has_steps = grid.step.iter().all(|step| *step > 0.0 && *step < 90.0);
        (is_on_earth && has_steps).then_some(grid)
    }

    /// Height of the geoid above the ellipsoid, metres, linear between the nodes; `None` off the grid.
    pub fn height_m(&self, at: &Geodetic) -> Option<f64> {
        let row = (at.latitude.to_degrees() - self.corner[0]) / self.step[0];
        // Grids may count from 0 or from -180 degrees.
        let east = (at.longitude.to_degrees() - self.corner[1]).rem_euclid(360.0);
        let column = east / self.step[1];
        let within = |place: f64, count: usize| (0.0..=(count - 1) as f64).contains(&place);
        if !within(row, self.rows) || !within(column, self.columns) {
            return None;
        }
        let (r, c) = (
            (row as usize).min(self.rows - 2),
            (column as usize).min(self.columns - 2),
        );
        let node = |r: usize, c: usize| {
            let height = self.heights[r * self.columns + c];
            let is_height = height.abs() < MOST_M && (height - NO_HEIGHT).abs() > 1e-4;
            is_height.then(|| f64::from(height))
        };
        let (u, v) = (row - r as f64, column - c as f64);
        let south = node(r, c)? * (1.0 - v) + node(r, c + 1)? * v;
        let north = node(r + 1, c)? * (1.0 - v) + node(r + 1, c + 1)? * v;
        Some(south * (1.0 - u) + north * u)
    }
}
