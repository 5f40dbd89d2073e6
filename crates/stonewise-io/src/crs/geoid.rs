//! Heights of a geoid above the ellipsoid, on a grid.

use super::ellipsoid::Geodetic;

/// No geoid is farther from the ellipsoid, metres.
const MOST_M: f32 = 200.0;

/// A grid of heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Geoid {
    /// South-west node: latitude, longitude, degrees.
    corner: [f64; 2],
    /// From row to row and from column to column, degrees.
    step: [f64; 2],
    columns: usize,
    rows: usize,
    /// From south to north, metres; NaN where a node has no height.
    heights: Vec<f32>,
}

impl Geoid {
    /// A grid of rows and columns; `None` where it cannot lie on the earth, or if the number of heights is not rows times
    /// columns.
    pub(super) fn of(
        corner: [f64; 2],
        step: [f64; 2],
        [rows, columns]: [usize; 2],
        heights: Vec<f32>,
    ) -> Option<Self> {
        let is_on_earth = corner[0].abs() <= 90.0 && corner[1].abs() <= 360.0;
        let has_steps = step.iter().all(|step| *step > 0.0 && *step < 90.0);
        let has_cells = rows >= 2 && columns >= 2 && rows.checked_mul(columns) == Some(heights.len());
        (is_on_earth && has_steps && has_cells).then_some(Self {
            corner,
            step,
            columns,
            rows,
            heights,
        })
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
            (height.abs() < MOST_M).then(|| f64::from(height))
        };
        let (u, v) = (row - r as f64, column - c as f64);
        let south = node(r, c)? * (1.0 - v) + node(r, c + 1)? * v;
        let north = node(r + 1, c)? * (1.0 - v) + node(r + 1, c + 1)? * v;
        Some(south * (1.0 - u) + north * u)
    }
}
