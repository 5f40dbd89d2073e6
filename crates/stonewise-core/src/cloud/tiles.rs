//! Clouds larger than memory, one tile at a time.

use crate::cloud::Cloud;
use crate::geometry::Bounds;

/// A cloud cut into tiles; only the tiles in use are in memory.
pub trait TileSource: Sync {
    /// Why a tile could not be read.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Number of tiles; none of them is empty.
    fn tile_count(&self) -> usize;
    /// Box around the points of a tile, world frame.
    fn bounds(&self, tile: usize) -> Bounds;
    /// The points of a tile, always in the same order.
    ///
    /// # Errors
    /// The tile cannot be read.
    fn load(&self, tile: usize) -> Result<Cloud, Self::Error>;

    /// All points inside a box, tile by tile, relative to the middle of the box.
    ///
    /// # Errors
    /// A tile cannot be read.
    fn load_region(&self, region: &Bounds) -> Result<Cloud, Self::Error> {
        let mut found = Cloud::new(region.centre(), Vec::new());
        for tile in (0..self.tile_count()).filter(|&t| self.bounds(t).intersects(region)) {
            let cloud = self.load(tile)?;
            let inside = (0..cloud.len())
                .map(|i| cloud.world(i))
                .filter(|p| region.contains(p));
            found.append(&Cloud::from_world(found.origin(), inside));
        }
        Ok(found)
    }
}

/// Tiles that are all in memory: for tests and for small surveys.
pub struct MemoryTiles {
    tiles: Vec<(Bounds, Cloud)>,
}

impl MemoryTiles {
    /// Keeps the clouds that hold points, in order.
    pub fn new(clouds: impl IntoIterator<Item = Cloud>) -> Self {
        let tiles = clouds
            .into_iter()
            .filter_map(|c| Some((Bounds::of((0..c.len()).map(|i| c.world(i)))?, c)))
            .collect();
        Self { tiles }
    }
}

impl TileSource for MemoryTiles {
    type Error = std::convert::Infallible;

    fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    fn bounds(&self, tile: usize) -> Bounds {
        self.tiles[tile].0
    }

    fn load(&self, tile: usize) -> Result<Cloud, Self::Error> {
        Ok(self.tiles[tile].1.clone())
    }
}
