//! A photo with the outlines of its stones.

use stonewise_core::raster::{LabelImage, RgbImage};

/// Outlines get wider by a pixel each time the photo's shorter side grows by this many pixels.
const WIDTH_STEP_PX: u32 = 1000;
/// Colours that differ from masonry and from each other.
const COLOURS: [[u8; 3]; 8] = [
    [255, 40, 40],
    [40, 220, 60],
    [60, 130, 255],
    [255, 210, 0],
    [255, 60, 220],
    [0, 225, 225],
    [255, 130, 0],
    [170, 90, 255],
];

/// The photo with a coloured line along the inner border of every stone.
pub fn outlined(photo: &RgbImage, labels: &LabelImage) -> RgbImage {
    let mut picture = photo.clone();
    let reach = 1 + photo.width().min(photo.height()) / WIDTH_STEP_PX;
    let (width, height) = (labels.width(), labels.height());
    for y in 0..height {
        for x in 0..width {
            let Some(&label) = labels.get(x, y).filter(|label| **label != 0) else {
                continue;
            };
            let differs = |x: Option<u32>, y: Option<u32>| match (x, y) {
                (Some(x), Some(y)) => labels.get(x, y) != Some(&label),
                _ => true,
            };
            let is_border = differs(x.checked_sub(reach), Some(y))
                || differs(Some(x + reach), Some(y))
                || differs(Some(x), y.checked_sub(reach))
                || differs(Some(x), Some(y + reach));
            if is_border && let Some(pixel) = picture.get_mut(x, y) {
                // Neighbours tend to have consecutive numbers; a step that shares no factor with the colours
                // tells them apart.
                *pixel = COLOURS[(label as usize * 3) % COLOURS.len()];
            }
        }
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::raster::Raster;

    #[test]
    fn only_the_border_of_a_stone_is_painted() {
        let photo = Raster::filled(20, 20, [7; 3]);
        let mut labels = Raster::filled(20, 20, 0);
        for i in 0..100 {
            *labels.get_mut(5 + i % 10, 5 + i / 10).unwrap() = 2;
        }
        let painted = |x: u32, y: u32| outlined(&photo, &labels).get(x, y) != Some(&[7; 3]);
        assert!(painted(5, 9) && painted(14, 14) && painted(9, 5));
        assert!(!painted(4, 9) && !painted(7, 9) && !painted(15, 15));
    }
}
