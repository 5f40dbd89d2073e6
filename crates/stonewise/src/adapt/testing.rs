//! Small photos of stones, for tests.

use stonewise_core::raster::{LabelImage, Raster};

/// Rows of pixels: digits are labels, spaces have none.
pub fn labels(rows: [&str; 8]) -> LabelImage {
    let values = rows
        .iter()
        .flat_map(|row| row.chars().map(|c| c.to_digit(10).unwrap_or(0)));
    Raster::from_vec(rows[0].len() as u32, 8, values.collect()).unwrap()
}

/// Each pixel repeated ten times in both directions.
pub fn enlarged<T: Copy>(small: &Raster<T>) -> Raster<T> {
    let (width, height) = (10 * small.width(), 10 * small.height());
    let at = |i: u32| *small.get(i % width / 10, i / width / 10).unwrap();
    Raster::from_vec(width, height, (0..width * height).map(at).collect()).unwrap()
}
