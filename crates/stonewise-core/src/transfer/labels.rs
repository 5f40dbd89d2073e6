//! Labels of points, tile by tile, apart from the points.

/// What the photos say about each point of a tile, in the tile's order; all columns are equally long.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileLabels {
    /// Stone of each point, 0 for none.
    pub stone: Vec<u32>,
    /// Share of the votes that the outcome (stone or background) got, 0..1; 0 where no photo voted.
    pub confidence: Vec<f32>,
    /// Whether any photo voted: distinguishes background (joints, building) from places that no photo sees.
    pub seen: Vec<bool>,
}

/// Keeps the labels of each tile and gives them back: files in a survey, memory in tests.
pub trait LabelStore: Sync {
    /// Why labels could not be kept or found.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Keeps the labels of a tile in place of earlier ones.
    ///
    /// # Errors
    /// They cannot be kept.
    fn write(&mut self, tile: usize, labels: &TileLabels) -> Result<(), Self::Error>;
    /// The labels that were written for a tile.
    ///
    /// # Errors
    /// They cannot be read.
    fn read(&self, tile: usize) -> Result<TileLabels, Self::Error>;
}

/// Labels in memory; a tile that was never written has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MemoryLabels {
    /// Labels of each tile.
    pub tiles: Vec<TileLabels>,
}

impl LabelStore for MemoryLabels {
    type Error = std::convert::Infallible;

    fn write(&mut self, tile: usize, labels: &TileLabels) -> Result<(), Self::Error> {
        if self.tiles.len() <= tile {
            self.tiles.resize(tile + 1, TileLabels::default());
        }
        self.tiles[tile] = labels.clone();
        Ok(())
    }

    fn read(&self, tile: usize) -> Result<TileLabels, Self::Error> {
        Ok(self.tiles.get(tile).cloned().unwrap_or_default())
    }
}
