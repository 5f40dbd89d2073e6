//! Small square pictures of one size, side by side in a few large ones.

use crate::names::EVIDENCE_DIR;
use std::path::{Path, PathBuf};
use stonewise_base::error::Error;
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_io::image_io::write_jpeg;

/// Edge of a picture that holds small ones, pixels at most.
const ATLAS_PX: u32 = 2048;
const QUALITY: u8 = 76;

/// Where small pictures lie: `evidence/STEM_EPOCH_NNN.jpg`, each with up to `per_row` squared of them.
#[derive(Clone, Copy)]
pub(super) struct Atlas<'a> {
    pub dir: &'a Path,
    pub stem: &'a str,
    pub epoch: usize,
    /// Edge of a small picture, pixels; a multiple of 16, so that JPEG's blocks never join two.
    pub side_px: u32,
    pub per_row: u32,
}

/// How many small pictures of this edge lie in a row of a large one, for `count` of them.
pub(super) fn per_row(side_px: u32, count: usize) -> u32 {
    (ATLAS_PX / side_px).clamp(1, (count as f64).sqrt().ceil().max(1.0) as u32)
}

impl Atlas<'_> {
    /// Writes them; `tiles`: pixels row by row, each tile `side_px` squared.
    pub fn write(&self, tiles: &[Vec<[u8; 3]>]) -> Result<(), Error> {
        for (number, part) in tiles.chunks((self.per_row * self.per_row) as usize).enumerate() {
            let path = self.path(number);
            write_jpeg(&path, &self.assemble(part), QUALITY)
                .map_err(|e| Error::io("writing pictures of stones", &path)(std::io::Error::other(e)))?;
        }
        Ok(())
    }

    /// The JPEG files that hold this many small pictures.
    pub fn read(&self, count: usize) -> Result<Vec<Vec<u8>>, Error> {
        (0..count.div_ceil((self.per_row * self.per_row) as usize))
            .map(|number| {
                let path = self.path(number);
                std::fs::read(&path).map_err(Error::io("reading pictures of stones", &path))
            })
            .collect()
    }

    fn path(&self, number: usize) -> PathBuf {
        let name = format!("{}_{}_{number:03}.jpg", self.stem, self.epoch);
        self.dir.join(EVIDENCE_DIR).join(name)
    }

    fn assemble(&self, tiles: &[Vec<[u8; 3]>]) -> RgbImage {
        let (per_row, side) = (self.per_row as usize, self.side_px as usize);
        let rows = tiles.len().div_ceil(per_row) as u32;
        let mut picture = Raster::filled(self.per_row * self.side_px, rows * self.side_px, [128u8; 3]);
        let width = picture.width() as usize;
        for (i, tile) in tiles.iter().enumerate() {
            let (left, top) = (i % per_row * side, i / per_row * side);
            for (y, row) in tile.chunks_exact(side).enumerate() {
                let start = (top + y) * width + left;
                picture.data_mut()[start..start + side].copy_from_slice(row);
            }
        }
        picture
    }
}
