//! Where an image shows anything at all.

use super::boxes::Bounds;
use stonewise_core::raster::RgbImage;

/// Least difference between the brightest and the darkest value of a colour in the box of a stone, of 255. 4: 1.5 %, about the least
/// that an eye tells apart, and less than the noise of any photo; rounding and compression of a plain surface stay below it.
const LEAST_RANGE: u8 = 4;

/// Whether the part of an image in a box differs from a plain surface.
///
/// The network has learnt from photos full of stones, and pads its layers with zeros: within a plain black, white or grey image the
/// border looks to it like the edge of a wall, and it reports stones of the sizes that it saw most. A stone without any joint, edge
/// or texture in its box cannot be told from that, so none is reported.
pub(super) fn has_contrast(image: &RgbImage, [left, top, right, bottom]: Bounds) -> bool {
    let columns = (left.max(0.0) as u32)..(right.ceil().max(0.0) as u32).min(image.width());
    let rows = (top.max(0.0) as u32)..(bottom.ceil().max(0.0) as u32).min(image.height());
    let (mut low, mut high) = ([u8::MAX; 3], [u8::MIN; 3]);
    for row in rows {
        for column in columns.clone() {
            let Some(pixel) = image.get(column, row) else { continue };
            for (channel, &value) in pixel.iter().enumerate() {
                low[channel] = low[channel].min(value);
                high[channel] = high[channel].max(value);
            }
            if (0..3).any(|c| high[c].saturating_sub(low[c]) >= LEAST_RANGE) {
                return true;
            }
        }
    }
    false
}
