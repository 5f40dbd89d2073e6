//! What stands before a wall: railings, cars, sheds.

use crate::components::components;
use crate::geometry::{CellMap, cells_between, floor};
use crate::surface::SurfaceCell;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// What stands farther before a wall does not belong to it, metres: more than the relief of rubble.
pub(super) const BEFORE_M: f64 = 0.2;
/// Gaps of up to one cell do not part what lies in one plane.
const REACH: i64 = 2;
/// A body with fewer cells than this part of the largest in a target may be an obstacle.
const SMALL: f64 = 0.25;
/// Part of a body that must stand before others.
const MOSTLY: f64 = 0.5;

/// Which cells hang together: those that touch, or that lie in one plane with a gap of one cell between them.
pub(super) struct Bodies(CellMap<[i64; 3], usize>);

impl Bodies {
    pub(super) fn of(cells: &[&SurfaceCell]) -> Self {
        let mut at: CellMap<[i64; 3], usize> = CellMap::default();
        for (i, cell) in cells.iter().enumerate() {
            at.entry(cell.cell).or_insert(i);
        }
        let joined = |i: usize| {
            let (at, cell) = (&at, cells[i]);
            let [low, high] = [-REACH, REACH].map(|step| cell.cell.map(|c| c + step));
            let around = cells_between(low, high).filter_map(|key| at.get(&key).copied());
            around.filter(move |j| *j != i && are_joined(cell, cells[*j]))
        };
        let bodies = components(cells.len(), joined).into_iter().enumerate();
        let of_body = bodies.flat_map(|(body, members)| members.into_iter().map(move |i| (i, body)));
        Self(of_body.map(|(i, body)| (cells[i].cell, body)).collect())
    }

    /// The cells of a target that are no obstacles: small bodies most of which others continue behind.
    ///
    /// `places`: of the cells, metres along, up and out.
    pub(super) fn without_obstacles<'a>(
        &self,
        cells: &[&'a SurfaceCell],
        places: &[Vector3<f64>],
        cell_m: f64,
    ) -> Vec<&'a SurfaceCell> {
        let body = |cell: &SurfaceCell| self.0.get(&cell.cell).copied();
        let mut counts: BTreeMap<Option<usize>, usize> = BTreeMap::new();
        for cell in cells {
            *counts.entry(body(cell)).or_default() += 1;
        }
        let most = counts.values().copied().max().unwrap_or(0) as f64;
        let is_small = |cell: &SurfaceCell| (counts[&body(cell)] as f64) < SMALL * most;
        let key = |place: &Vector3<f64>| [place.x, place.y].map(|v| floor(v / cell_m));

        // How far out the large bodies reach in each direction.
        let mut deepest: CellMap<[i64; 2], f64> = CellMap::default();
        for (_, place) in cells.iter().zip(places).filter(|(cell, _)| !is_small(cell)) {
            let out_m = deepest.entry(key(place)).or_insert(f64::INFINITY);
            *out_m = out_m.min(place.z);
        }

        let is_before = |place: &Vector3<f64>| {
            let [x, y] = key(place);
            let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [x + dx, y + dy]));
            let mut behind = around.filter_map(|key| deepest.get(&key));
            behind.any(|out_m| *out_m < place.z - BEFORE_M)
        };

        let mut before: BTreeMap<Option<usize>, usize> = BTreeMap::new();
        for (cell, place) in cells.iter().zip(places) {
            *before.entry(body(cell)).or_default() += usize::from(is_small(cell) && is_before(place));
        }
        let is_obstacle =
            |cell: &SurfaceCell| before[&body(cell)] as f64 > MOSTLY * counts[&body(cell)] as f64;
        cells.iter().copied().filter(|cell| !is_obstacle(cell)).collect()
    }
}

fn are_joined(a: &SurfaceCell, b: &SurfaceCell) -> bool {
    let apart = b.centroid - a.centroid;
    (0..3).all(|axis| (a.cell[axis] - b.cell[axis]).abs() <= 1)
        || [a, b].iter().all(|cell| cell.normal.dot(&apart).abs() < BEFORE_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cell_of;
    use nalgebra::Point3;

    /// Cells of a quarter of a metre that face -y, from one x to another and up to a height, at one y.
    fn upright(x: [i32; 2], high: i32, y: f64) -> Vec<SurfaceCell> {
        let places = (x[0]..x[1]).flat_map(|i| (0..high).map(move |j| [i, j].map(f64::from)));
        let cell = |[i, j]: [f64; 2]| {
            let centroid = Point3::new(0.25 * i + 0.1, y, 0.25 * j + 0.1);
            SurfaceCell {
                cell: cell_of(&centroid, 0.25),
                centroid,
                normal: -Vector3::y(),
                spacing_m: 0.01,
                skewness: 0.0,
            }
        };
        places.map(cell).collect()
    }

    /// How many of some cells remain before a wall of 6 x 3 m at y = 0.
    fn remaining(others: Vec<SurfaceCell>) -> usize {
        let all = [upright([0, 24], 12, 0.1), others].concat();
        let cells: Vec<&SurfaceCell> = all.iter().collect();
        let of_face = |p: &Point3<f64>| Vector3::new(p.x, p.z, -p.y);
        let places: Vec<Vector3<f64>> = all.iter().map(|c| of_face(&c.centroid)).collect();
        let left = Bodies::of(&cells).without_obstacles(&cells, &places, 0.25);
        assert!(left.len() >= 24 * 12, "the wall itself");
        left.len() - 24 * 12
    }

    #[test]
    fn a_railing_is_an_obstacle_and_a_gatehouse_a_parapet_and_a_buttress_are_none() {
        assert_eq!(remaining(upright([2, 20], 3, -0.9)), 0, "a railing");
        assert_eq!(remaining(upright([2, 18], 6, -1.9)), 96, "as large as a wall");
        let mut parapet = upright([0, 24], 2, -0.65);
        for cell in &mut parapet {
            cell.centroid.z += 3.25;
            cell.cell[2] += 13;
        }
        assert_eq!(remaining(parapet), 48, "nothing is behind");
        assert_eq!(
            remaining(upright([8, 12], 12, -0.15)),
            48,
            "its front touches the wall"
        );
    }
}
