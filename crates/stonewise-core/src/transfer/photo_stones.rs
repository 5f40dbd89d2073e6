//! The stones of a labelled cloud as one photo sees them.

use super::visible::each_visible;
use super::{TileLabels, TransferError, TransferParams};
use crate::cloud::TileSource;
use crate::geometry::View;
use crate::progress::Progress;
use crate::raster::{LabelImage, Raster};

/// Pixels of the photo across a cell in which points are gathered; the relief of photos has the same.
const CELL_PX: u32 = 2;
/// Empty cells between points are filled from their neighbours up to this distance, cells.
const REACH: usize = 2;
/// Neighbours with points of which an empty cell takes the stone, at least: fewer lie along the border of
/// what the photo sees.
const LEAST_NEIGHBOURS: usize = 3;

/// What a labelled cloud says about the pixels of a photo.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoStones {
    /// Stone of every pixel, 0 for none.
    pub stones: LabelImage,
    /// True where points say so; elsewhere nothing is known.
    pub known: Raster<bool>,
}

/// The stones of a labelled cloud where a photo sees them, at the size that its camera states.
///
/// Visible points are gathered in cells of two pixels, whose stone is that of most of their points; empty
/// cells between them take the stone of most of their neighbours. Points on which no photo voted say nothing.
/// `labels`: those of a tile.
///
/// Cost: as of [`super::photo_relief`].
///
/// # Errors
/// A tile or its labels cannot be read, a parameter cannot have its value, or the caller stopped it.
pub fn photo_stones<T, E>(
    tiles: &T,
    mut labels: impl FnMut(usize) -> Result<TileLabels, E>,
    view: &View,
    params: &TransferParams,
    progress: &dyn Progress,
) -> Result<PhotoStones, TransferError>
where
    T: TileSource,
    E: std::error::Error + Send + Sync + 'static,
{
    let [width, height] = [view.camera.width, view.camera.height];
    let mut cells = Raster::filled(width.div_ceil(CELL_PX), height.div_ceil(CELL_PX), Cell::default());
    each_visible(tiles, view, params, progress, |tile, visible| {
        let labels = labels(tile).map_err(|e| TransferError::labels(tile, e))?;
        for seen in visible {
            let point = seen.point as usize;
            let [x, y] = seen.pixel.map(|p| (p / f64::from(CELL_PX)) as u32);
            if labels.seen.get(point) == Some(&true)
                && let (Some(cell), Some(&stone)) = (cells.get_mut(x, y), labels.stone.get(point))
            {
                cell.vote(stone);
            }
        }
        Ok(())
    })?;

    for _ in 0..REACH {
        cells = filled(&cells);
    }
    let mut shown = PhotoStones {
        stones: Raster::filled(width, height, 0),
        known: Raster::filled(width, height, false),
    };
    let pixels = shown.stones.data_mut().iter_mut().zip(shown.known.data_mut());

    for (index, (stone, known)) in pixels.enumerate() {
        let (x, y) = (index as u32 % width, index as u32 / width);
        if let Some(cell) = cells.get(x / CELL_PX, y / CELL_PX).filter(|c| c.lead > 0) {
            (*stone, *known) = (cell.stone, true);
        }
    }

    Ok(shown)
}

/// The stone that leads in a cell, 0 for none, and by how many points (Boyer & Moore 1991: the majority, where
/// there is one). Without a lead, nothing is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cell {
    stone: u32,
    lead: u32,
}

impl Cell {
    fn vote(&mut self, stone: u32) {
        if self.lead == 0 {
            self.stone = stone;
        }
        if self.stone == stone {
            self.lead += 1;
        } else {
            self.lead -= 1;
        }
    }
}

/// Fills empty cells that have enough neighbours with the stone that most of these have.
fn filled(cells: &Raster<Cell>) -> Raster<Cell> {
    let mut filled = cells.clone();
    let (width, height) = (cells.width(), cells.height());
    for (index, cell) in filled
        .data_mut()
        .iter_mut()
        .enumerate()
        .filter(|(_, c)| c.lead == 0)
    {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let around = (y.saturating_sub(1)..(y + 2).min(height))
            .flat_map(|row| columns.clone().map(move |column| cells.get(column, row)))
            .flatten()
            .filter(|c| c.lead > 0);
        let mut stones: Vec<u32> = around.map(|c| c.stone).collect();
        if stones.len() < LEAST_NEIGHBOURS {
            continue;
        }
        stones.sort_unstable();
        let most = stones.chunk_by(|a, b| a == b).max_by_key(|same| same.len());
        if let Some(&[stone, ..]) = most {
            *cell = Cell { stone, lead: 1 };
        }
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, MemoryTiles};
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;
    use crate::progress::Silent;
    use nalgebra::Point3;
    use std::convert::Infallible;

    /// A wall at 10 m whose left half is stone 3 and whose lower right quarter is a joint, with points every
    /// 3 pixels; no photo voted on the upper right quarter. A board of stone 9 lies behind the wall.
    #[test]
    fn pixels_have_the_stone_of_the_points_that_they_show() {
        let mut points = Vec::new();
        let mut labels = TileLabels::default();
        for (i, j) in (0..100).flat_map(|j| (0..134).map(move |i| (i, j))) {
            let (x, y) = (0.03 * f64::from(i) - 2.0, 0.03 * f64::from(j) - 1.5);
            for (depth, stone) in [(10.0, if x < 0.0 { 3 } else { 0 }), (12.0, 9)] {
                points.push(Point3::new(
                    1e-3 + x * depth / 10.0,
                    1e-3 + y * depth / 10.0,
                    depth,
                ));
                labels.stone.push(stone);
                labels.confidence.push(1.0);
                labels.seen.push(x < 0.0 || y > 0.0);
            }
        }
        let tiles = MemoryTiles::new([Cloud::from_world(Point3::origin(), points)]);
        let of_tile = |_: usize| Ok::<_, Infallible>(labels.clone());
        let view = View {
            image: ImageId(0),
            name: "photo".to_owned(),
            camera: Camera::pinhole(400, 300, 1000.0),
            cam_from_world: Rigid3::identity(),
        };
        let shown = photo_stones(&tiles, of_tile, &view, &TransferParams::default(), &Silent).unwrap();
        // A border of pixels along the edges of the wall and of its halves is left out.
        for (x, y) in (6..294).flat_map(|y| (6..394).map(move |x| (x, y))) {
            if (194..206).contains(&x) || (x > 194 && (144..156).contains(&y)) {
                continue;
            }
            let expected = match (x < 200, y < 150) {
                (true, _) => (3, true),
                (false, true) => (0, false),
                (false, false) => (0, true),
            };
            let pixel = (*shown.stones.get(x, y).unwrap(), *shown.known.get(x, y).unwrap());
            assert_eq!(pixel, expected, "({x}, {y})");
        }
    }

    #[test]
    fn the_stone_of_most_points_leads() {
        let mut cell = Cell::default();
        [5, 2, 5, 0, 5, 5, 2]
            .into_iter()
            .for_each(|stone| cell.vote(stone));
        assert_eq!((cell.stone, cell.lead > 0), (5, true));
        let mut even = Cell::default();
        [5, 2].into_iter().for_each(|stone| even.vote(stone));
        assert_eq!(even.lead, 0);
    }
}
