//! A photo at another scale.

use super::grid::Rect;
use super::options::scaled;
use image::imageops::{FilterType, resize};
use stonewise_core::raster::{Raster, RgbImage};

/// The photo at a scale; smaller pixels are weighted means of those they cover. Costs a copy where the scale
/// is not 1.
pub fn at_scale(photo: &RgbImage, scale: f64) -> RgbImage {
    let (width, height) = (scaled(photo.width(), scale), scaled(photo.height(), scale));
    if (width, height) == (photo.width(), photo.height()) {
        return photo.clone();
    }
    let bytes = photo.data().as_flattened().to_vec();
    let source = image::RgbImage::from_raw(photo.width(), photo.height(), bytes).unwrap_or_default();
    let small = resize(&source, width, height, FilterType::Triangle);
    let pixels = small.pixels().map(|p| p.0).collect();
    Raster::from_vec(width, height, pixels).unwrap_or_else(|| Raster::filled(width, height, [0; 3]))
}

/// A part of an image.
pub fn crop(image: &RgbImage, part: &Rect) -> RgbImage {
    let row = |y: u32| {
        let begin = y as usize * image.width() as usize + part.left as usize;
        &image.data()[begin..begin + part.width as usize]
    };
    let pixels = (part.top..part.top + part.height)
        .flat_map(row)
        .copied()
        .collect();
    Raster::from_vec(part.width, part.height, pixels)
        .unwrap_or_else(|| Raster::filled(part.width, part.height, [0; 3]))
}
