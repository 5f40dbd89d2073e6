//! A cloud moved by a known field.

use crate::cloud::{Cloud, TileSource};
use crate::evaluate::MotionField;
use crate::geometry::Bounds;

/// Tiles of another source with every point moved; point order is kept.
///
/// Tile bounds grow by the largest motion on every side, so they hold the points but are not tight.
pub struct MovedTiles<'a, S> {
    source: &'a S,
    field: &'a MotionField,
}

impl<'a, S: TileSource> MovedTiles<'a, S> {
    /// The points of `source`, each moved by what `field` says for the place where it was.
    pub fn new(source: &'a S, field: &'a MotionField) -> Self {
        Self { source, field }
    }
}

impl<S: TileSource> TileSource for MovedTiles<'_, S> {
    type Error = S::Error;

    fn tile_count(&self) -> usize {
        self.source.tile_count()
    }

    fn bounds(&self, tile: usize) -> Bounds {
        self.source.bounds(tile).grown(self.field.largest_m())
    }

    fn load(&self, tile: usize) -> Result<Cloud, S::Error> {
        let cloud = self.source.load(tile)?;
        let moved = (0..cloud.len()).map(|i| self.field.apply(&cloud.world(i)));
        Ok(Cloud::from_world(cloud.origin(), moved))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::MemoryTiles;
    use nalgebra::{Point3, Vector3};

    #[test]
    fn points_move_and_stay_inside_their_bounds() {
        let points: Vec<_> = (0..50)
            .map(|i| Point3::new(0.1 * f64::from(i), 2.0, -1.0))
            .collect();
        let still = MemoryTiles::new([Cloud::from_world(Point3::origin(), points.clone())]);
        let field = MotionField::translation(Vector3::new(0.02, -0.5, 0.0)).unwrap();
        let moved = MovedTiles::new(&still, &field);
        let cloud = moved.load(0).unwrap();
        for (i, p) in points.iter().enumerate() {
            assert!((cloud.world(i) - field.apply(p)).norm() < 1e-6);
            assert!(moved.bounds(0).contains(&cloud.world(i)));
        }
    }
}
