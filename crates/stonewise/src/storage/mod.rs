//! What lies on disk between steps: their folders, tiles of clouds, records sorted into bins.

pub mod epoch_tiles;
pub mod labels;
pub mod spill;
pub mod step;
pub mod store;
pub mod tiles;
