//! What JPEG does to pixels.

use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::{DynamicImage, ExtendedColorType, ImageError};
use std::io::Cursor;

/// Pixels of an image of `width` x `height` after compression at a quality of 1 to 100.
///
/// # Errors
/// JPEG cannot hold the image: more than 65,535 pixels along a side.
pub(crate) fn through_jpeg(
    pixels: &[[u8; 3]],
    [width, height]: [u32; 2],
    quality: u8,
) -> Result<Vec<[u8; 3]>, ImageError> {
    let mut file = Vec::new();
    JpegEncoder::new_with_quality(&mut file, quality).encode(
        pixels.as_flattened(),
        width,
        height,
        ExtendedColorType::Rgb8,
    )?;
    let decoded = DynamicImage::from_decoder(JpegDecoder::new(Cursor::new(file))?)?;
    Ok(decoded.to_rgb8().pixels().map(|p| p.0).collect())
}
