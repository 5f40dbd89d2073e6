//! What hides parts of a surface from a camera.

use crate::geometry::{View, floor};
use crate::surface::SurfaceCell;
use std::collections::BTreeMap;

/// Cells behind the nearest one by less than this many edges are not hidden by it.
const BEHIND_CELLS: f64 = 3.0;

/// The nearest cell of a surface in each direction of a camera.
pub(super) struct Nearest<'a> {
    view: &'a View,
    cell_m: f64,
    /// Depth by direction: tangents in units of the width of a cell at the middle distance.
    depths: BTreeMap<[i64; 2], f64>,
    tangent: f64,
}

impl<'a> Nearest<'a> {
    /// Looks through a camera at all cells; `cell_m`: their edge.
    pub(super) fn of(view: &'a View, cells: &[SurfaceCell], cell_m: f64) -> Self {
        let distances = cells.iter().filter_map(|c| view.project(&c.centroid));
        let inside = distances
            .filter(|seen| view.is_inside(seen.pixel))
            .map(|seen| seen.depth_m);
        let (count, sum) = inside.fold((0.0, 0.0), |(n, sum), depth| (n + 1.0, sum + depth));
        let mut nearest = Self {
            view,
            cell_m,
            depths: BTreeMap::new(),
            tangent: if sum > 0.0 { cell_m * count / sum } else { 1.0 },
        };
        for cell in cells {
            let Some((at, depth_m)) = nearest.place(cell) else {
                continue;
            };
            let half = 0.5 * cell_m / depth_m / nearest.tangent;
            let [x, y] = at.map(|a| floor(a - half)..=floor(a + half));
            for key in x.flat_map(|x| y.clone().map(move |y| [x, y])) {
                let least = nearest.depths.entry(key).or_insert(f64::INFINITY);
                *least = least.min(depth_m);
            }
        }
        nearest
    }

    /// Part of some cells that the camera sees.
    pub(super) fn seen_share(&self, cells: &[&SurfaceCell]) -> f64 {
        cells.iter().filter(|cell| self.sees(cell)).count() as f64 / cells.len().max(1) as f64
    }

    /// Whether the camera sees a cell.
    pub(super) fn sees(&self, cell: &SurfaceCell) -> bool {
        self.place(cell).is_some_and(|(at, depth_m)| {
            let nearest = self.depths.get(&at.map(floor)).copied().unwrap_or(f64::INFINITY);
            depth_m <= nearest + BEHIND_CELLS * self.cell_m
        })
    }

    /// Direction, in units of the keys, and depth of a cell.
    fn place(&self, cell: &SurfaceCell) -> Option<([f64; 2], f64)> {
        let seen = self.view.project(&cell.centroid)?;
        if !self.view.is_inside(seen.pixel) {
            return None;
        }
        let unit_px = self.view.camera.focal_px[0] * self.tangent;
        (seen.depth_m > self.cell_m).then_some((seen.pixel.map(|px| px / unit_px), seen.depth_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;
    use nalgebra::{Point3, Vector3};

    /// Upright cells of a quarter of a metre at a depth before the camera, from one x to another, 3 m high.
    fn cells(x: [i32; 2], depth_m: f64) -> Vec<SurfaceCell> {
        let places = (x[0]..x[1]).flat_map(|i| (0..12).map(move |j| [f64::from(i), f64::from(j)]));
        let cell = |[i, j]: [f64; 2]| SurfaceCell {
            cell: [0; 3],
            centroid: Point3::new(0.25 * i + 0.125, 0.25 * j - 1.4, depth_m),
            normal: -Vector3::z(),
            spacing_m: 0.01,
            skewness: 0.0,
        };
        places.map(cell).collect()
    }

    #[test]
    fn what_stands_before_a_wall_hides_its_part() {
        let view = View {
            image: ImageId(0),
            name: String::new(),
            camera: Camera::pinhole(1200, 800, 1500.0),
            cam_from_world: Rigid3::identity(),
        };
        let wall = cells([-12, 12], 12.0);
        // Seen from the camera, 1 m at a depth of 6 m is as wide as 2 m of the wall: a third of 6 m.
        let all = [wall.clone(), cells([-2, 2], 6.0)].concat();
        let own: Vec<&SurfaceCell> = wall.iter().collect();
        let seen = Nearest::of(&view, &all, 0.25).seen_share(&own);
        assert!((seen - 2.0 / 3.0).abs() < 0.1, "{seen}");
        assert_eq!(Nearest::of(&view, &wall, 0.25).seen_share(&own), 1.0);
    }
}
