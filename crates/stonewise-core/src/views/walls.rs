//! Which parts of a surface are walls.

use crate::geometry::{CellSet, cell_of};
use crate::surface::SurfaceCell;
use nalgebra::Point3;

/// Cosine of the angle to the vertical above which a surface is no wall: ground, roofs, soffits.
const LEVEL: f64 = 0.8;
/// Least part of all cells that stand upright where a survey shows walls; with less it shows a pavement or a
/// pitched slope.
const LEAST_WALLS: f64 = 0.05;

/// The surfaces that views are made of.
pub struct Walls<'a> {
    /// Their cells.
    pub(super) cells: Vec<&'a SurfaceCell>,
    cell_m: f64,
    level: CellSet<[i64; 3]>,
}

impl<'a> Walls<'a> {
    /// Those among the cells of a survey, whose edge is `cell_m`.
    pub fn among(cells: &'a [SurfaceCell], cell_m: f64) -> Self {
        let is_upright = |c: &&SurfaceCell| c.normal.z.abs() < LEVEL;
        let (upright, level): (Vec<_>, Vec<_>) = cells.iter().partition(is_upright);
        if (upright.len() as f64) < LEAST_WALLS * cells.len() as f64 {
            return Self {
                cells: cells.iter().collect(),
                cell_m,
                level: CellSet::default(),
            };
        }
        Self {
            cells: upright,
            cell_m,
            level: level.iter().map(|c| c.cell).collect(),
        }
    }

    /// Whether a point lies on the ground or another level surface, which views leave black.
    pub fn is_level(&self, point: &Point3<f64>) -> bool {
        self.level.contains(&cell_of(point, self.cell_m))
    }
}
