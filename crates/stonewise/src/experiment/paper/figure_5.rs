//! Figure 5: a photo with its stones.

use super::outcome::Example;
use crate::error::Result;
use crate::files::read_bytes;
use crate::pipeline::{Context, Run, Until};
use stonewise_core::epoch::EpochId;
use stonewise_core::id::ImageId;
use stonewise_core::raster::{LabelImage, RgbImage};
use stonewise_io::image_io::{read_rgb, write_jpeg};

/// Widest picture, pixels.
const WIDTH_PX: u32 = 1400;
/// Share of a stone's colour over the photo.
const COVER: f64 = 0.45;

/// The photo of the first half with the most instances, each in a colour of its own; `None` where there is no
/// photo. `origin`: where the instances come from.
pub(super) fn example(context: &Context, origin: &str) -> Result<Option<Example>> {
    let segmented = Run::new(context, Until::Segmented).segmented(EpochId::REFERENCE)?;
    let chosen = segmented
        .photos
        .iter()
        .take(segmented.shown_count())
        .enumerate()
        .max_by_key(|(i, p)| (p.instances.len(), usize::MAX - i));
    let Some((index, photo)) = chosen else {
        return Ok(None);
    };
    let labels = segmented.labels(ImageId(index as u32))?;
    let picture = overlay(&read_rgb(&photo.path)?, &labels);
    let path = context.out.join("figure_5.jpg");
    write_jpeg(&path, &picture, 85)?;
    Ok(Some(Example {
        photo: photo
            .path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        instances: photo.instances.len(),
        origin: origin.to_owned(),
        jpeg: read_bytes(&path)?,
    }))
}

/// The photo, smaller by a whole number, with coloured stones and bright outlines.
fn overlay(photo: &RgbImage, labels: &LabelImage) -> RgbImage {
    let step = photo.width().div_ceil(WIDTH_PX).max(1);
    let mut small = RgbImage::filled(photo.width() / step, photo.height() / step, [0; 3]);
    let label = |x: u32, y: u32| labels.get(x, y).copied().unwrap_or(0);
    for y in 0..small.height() {
        for x in 0..small.width() {
            let (px, py) = (x * step, y * step);
            let own = label(px, py);
            let beside = [label(px + step, py), label(px, py + step)];
            let pixel = photo.get(px, py).copied().unwrap_or_default();
            let colour = if own != 0 && beside.iter().any(|b| *b != own) {
                [255, 240, 120]
            } else if own != 0 {
                let tint = tint(own);
                std::array::from_fn(|c| {
                    ((1.0 - COVER) * f64::from(pixel[c]) + COVER * f64::from(tint[c])) as u8
                })
            } else {
                pixel
            };
            if let Some(place) = small.get_mut(x, y) {
                *place = colour;
            }
        }
    }
    small
}

/// A saturated colour whose hue follows the golden angle, so that neighbours in number differ.
fn tint(id: u32) -> [u8; 3] {
    let hue = f64::from(id) * 137.508;
    [0.0, 240.0, 120.0].map(|turn: f64| (127.0 + 120.0 * (hue + turn).to_radians().cos()) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_keep_their_colour_and_stones_are_tinted_and_outlined() {
        let photo = RgbImage::filled(6, 4, [100; 3]);
        let mut labels = LabelImage::filled(6, 4, 0);
        for y in 0..4 {
            for x in 2..6 {
                *labels.get_mut(x, y).unwrap() = if x < 4 { 1 } else { 2 };
            }
        }
        let picture = overlay(&photo, &labels);
        assert_eq!(picture.get(0, 0), Some(&[100; 3]));
        assert_eq!(picture.get(3, 0), Some(&[255, 240, 120]));
        let stone = picture.get(2, 0).unwrap();
        assert!(*stone != [100; 3] && *stone != [255, 240, 120]);
        assert_ne!(tint(1), tint(2));
    }
}
