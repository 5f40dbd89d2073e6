//! Clouds that lie in memory, cut into the tiles that a run would cut them into.

use nalgebra::Point3;
use std::collections::BTreeMap;
use stonewise_core::cloud::{Cloud, MemoryTiles};
use stonewise_core::geometry::cell_of;

/// A cloud in tiles, and where its points are.
pub struct Tiled {
    /// The tiles.
    pub tiles: MemoryTiles,
    /// Indices of each tile's points in the whole cloud.
    pub indices: Vec<Vec<usize>>,
}

impl Tiled {
    /// Cuts a cloud into cubes of `size_m`, as the step `ingest` does: the same offsets in the same order.
    /// Points that are not finite are left out.
    pub fn new(points: &[Point3<f64>], size_m: f64) -> Self {
        let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        for (i, point) in points.iter().enumerate() {
            if point.iter().all(|c| c.is_finite()) {
                cells.entry(cell_of(point, size_m)).or_default().push(i);
            }
        }
        let cloud = |(key, list): (&[i64; 3], &Vec<usize>)| {
            let middle = Point3::from(key.map(|k| (k as f64 + 0.5) * size_m));
            Cloud::from_world(middle, list.iter().map(|&i| points[i]))
        };
        Self {
            tiles: MemoryTiles::new(cells.iter().map(cloud)),
            indices: cells.into_values().collect(),
        }
    }

    /// Values of the whole cloud, tile by tile.
    pub fn split<T: Copy>(&self, values: &[T]) -> Vec<Vec<T>> {
        let of_tile = |list: &Vec<usize>| list.iter().filter_map(|&i| values.get(i).copied()).collect();
        self.indices.iter().map(of_tile).collect()
    }
}
