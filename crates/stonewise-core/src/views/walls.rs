//! Which parts of a surface are walls.

use crate::geometry::{CellMap, cell_of};
use crate::surface::SurfaceCell;
use nalgebra::Point3;

/// Cosine of the angle to the vertical above which a surface is no wall: ground, roofs, soffits.
const LEVEL: f64 = 0.8;
/// Least part of all cells that stand upright where a survey shows walls; with less it shows a pavement or a
/// pitched slope.
const LEAST_WALLS: f64 = 0.05;

/// Distance from the plane of the ground within which points belong to it, metres: the foot of a wall stands
/// in cells of the ground.
const GROUND_M: f64 = 0.05;

/// The surfaces that views are made of.
pub struct Walls<'a> {
    /// Their cells.
    pub(super) cells: Vec<&'a SurfaceCell>,
    cell_m: f64,
    level: CellMap<[i64; 3], &'a SurfaceCell>,
}

impl<'a> Walls<'a> {
    /// The walls among the cells of a survey, whose edge is `cell_m`.
    pub fn among(cells: &'a [SurfaceCell], cell_m: f64) -> Self {
        let is_upright = |c: &&SurfaceCell| c.normal.z.abs() < LEVEL;
        let (upright, level): (Vec<_>, Vec<_>) = cells.iter().partition(is_upright);
        if (upright.len() as f64) < LEAST_WALLS * cells.len() as f64 {
            return Self {
                cells: cells.iter().collect(),
                cell_m,
                level: CellMap::default(),
            };
        }
        Self {
            cells: upright,
            cell_m,
            level: level.into_iter().map(|c| (c.cell, c)).collect(),
        }
    }

    /// Their area, square metres: each cell holds a piece of a plane.
    pub fn area_m2(&self) -> f64 {
        let share = |cell: &&SurfaceCell| 1.0 / cell.normal.amax().max(f64::MIN_POSITIVE);
        self.cell_m * self.cell_m * self.cells.iter().map(share).sum::<f64>()
    }

    /// Whether a point lies on the ground or another level surface, which views leave black.
    pub fn is_level(&self, point: &Point3<f64>) -> bool {
        let cell = cell_of(point, self.cell_m);
        match self.level.get(&cell) {
            Some(own) => lies_on(own, point),
            None => self.is_between_level(cell, point),
        }
    }

    /// Whether level cells on two opposite sides continue under a point, so that what else its cell shows, as the
    /// foot of a railing, stands on the same ground.
    fn is_between_level(&self, [x, y, z]: [i64; 3], point: &Point3<f64>) -> bool {
        let continues = |dx: i64, dy: i64| {
            let column = [z, z - 1, z + 1].map(|z| self.level.get(&[x + dx, y + dy, z]));
            column.into_iter().flatten().any(|cell| lies_on(cell, point))
        };
        [[1, 0], [0, 1]]
            .into_iter()
            .any(|[dx, dy]| continues(dx, dy) && continues(-dx, -dy))
    }
}

/// Whether a point lies on the plane of a cell.
fn lies_on(cell: &SurfaceCell, point: &Point3<f64>) -> bool {
    (point - cell.centroid).dot(&cell.normal).abs() < GROUND_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn cell(x: f64, z: f64, normal: Vector3<f64>) -> SurfaceCell {
        let centroid = Point3::new(x, 0.1, z);
        SurfaceCell {
            cell: cell_of(&centroid, 0.25),
            centroid,
            normal,
            spacing_m: 0.01,
            skewness: 0.0,
        }
    }

    #[test]
    fn what_stands_on_the_ground_leaves_the_ground_around_it_level() {
        // The foot of a railing from 0.25 to 0.5 m: its cell is upright.
        let cells = [
            cell(0.1, 0.02, Vector3::z()),
            cell(0.4, 0.15, Vector3::x()),
            cell(0.6, -0.01, Vector3::z()),
            cell(0.9, 0.15, Vector3::x()),
        ];
        let walls = Walls::among(&cells, 0.25);
        let is_level = |x: f64, z: f64| walls.is_level(&Point3::new(x, 0.1, z));
        assert!(is_level(0.3, 0.01) && is_level(0.45, -0.01));
        assert!(!is_level(0.4, 0.2), "the railing");
        assert!(!is_level(0.9, 0.01), "ground on one side alone");
        assert!(!is_level(0.3, 0.7));
    }

    #[test]
    fn the_foot_of_a_wall_is_no_ground() {
        let cells = [
            cell(0.1, 0.02, Vector3::z()),
            cell(0.4, 0.02, Vector3::z()),
            cell(0.1, 0.4, -Vector3::y()),
        ];
        let walls = Walls::among(&cells, 0.25);
        assert_eq!(walls.cells.len(), 1);
        assert!(walls.is_level(&Point3::new(0.2, 0.2, 0.03)));
        assert!(
            !walls.is_level(&Point3::new(0.2, 0.2, 0.2)),
            "the foot of the wall"
        );
        assert!(!walls.is_level(&Point3::new(0.1, 0.1, 0.41)));
        // A pavement alone is what the survey shows.
        let pavement = Walls::among(&cells[..2], 0.25);
        assert!(pavement.cells.len() == 2 && !pavement.is_level(&Point3::new(0.2, 0.2, 0.03)));
    }
}
