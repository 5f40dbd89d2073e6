//! The points of an epoch as every step after labelling sees them.

use crate::error::Error;
use crate::storage::tiles::DiskTiles;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::evaluate::{MotionField, MovedTiles};
use stonewise_core::geometry::Bounds;

/// An epoch's tiles, moved by the project's known field where it gives one.
pub struct EpochTiles {
    /// The tiles as surveyed.
    pub surveyed: DiskTiles,
    /// The known motion.
    pub motion: Option<MotionField>,
}

impl TileSource for EpochTiles {
    type Error = Error;

    fn tile_count(&self) -> usize {
        self.surveyed.tile_count()
    }

    fn bounds(&self, tile: usize) -> Bounds {
        match &self.motion {
            Some(field) => MovedTiles::new(&self.surveyed, field).bounds(tile),
            None => self.surveyed.bounds(tile),
        }
    }

    fn load(&self, tile: usize) -> Result<Cloud, Error> {
        match &self.motion {
            Some(field) => MovedTiles::new(&self.surveyed, field).load(tile),
            None => self.surveyed.load(tile),
        }
    }
}
