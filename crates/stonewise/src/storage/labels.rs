//! Labels of points on disk.

use crate::error::{Error, Result};
use crate::storage::tiles::DiskTiles;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use stonewise_core::cloud::TileSource;
use stonewise_core::transfer::{LabelStore, TileLabels};
use stonewise_io::table::{Table, read_columns, write_parquet};

/// Labels beside the tiles, one Parquet file each: stone (u32), confidence (f32), seen (bool).
#[derive(Clone)]
pub struct DiskLabels {
    files: Vec<PathBuf>,
}

impl DiskLabels {
    /// The labels of tiles in a folder.
    pub fn new(dir: &Path, tiles: &DiskTiles) -> Self {
        let file = |tile| dir.join(format!("{}.parquet", tiles.name(tile)));
        Self {
            files: (0..tiles.tile_count()).map(file).collect(),
        }
    }

    /// Takes these tiles from another store.
    pub fn replace(&mut self, tiles: &BTreeSet<usize>, from: &Self) {
        for &tile in tiles {
            self.files[tile].clone_from(&from.files[tile]);
        }
    }
}

impl LabelStore for DiskLabels {
    type Error = Error;

    fn write(&mut self, tile: usize, labels: &TileLabels) -> Result<()> {
        let mut table = Table::new();
        table.push(
            "stone",
            "",
            "stone of the point, 0 for none",
            labels.stone.clone(),
        )?;
        let meaning = "share of the photos' votes for this stone, or for none, 0 to 1";
        table.push("confidence", "", meaning, labels.confidence.clone())?;
        table.push(
            "seen",
            "",
            "whether any photo voted on the point",
            labels.seen.clone(),
        )?;
        Ok(write_parquet(&self.files[tile], &table)?)
    }

    fn read(&self, tile: usize) -> Result<TileLabels> {
        let table = read_columns(&self.files[tile], &["stone", "confidence", "seen"])?;
        Ok(TileLabels {
            stone: table.required("stone")?.to_vec(),
            confidence: table.required("confidence")?.to_vec(),
            seen: table.required("seen")?.to_vec(),
        })
    }
}
