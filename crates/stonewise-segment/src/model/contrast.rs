//! Where an image shows anything at all.

use super::boxes::Bounds;
use stonewise_core::raster::RgbImage;

/// Least difference of a colour between two places of the box of a stone, of 255. 4: 1.5 %, about the least
/// that an eye tells apart; rounding and compression of a plain surface stay below it.
const LEAST_DIFFERENCE: u8 = 4;
/// How far apart the two places are along a row or a column, pixels. 4: a blurred edge lies within, and the
/// slow change of a sky or of a shaded surface does not reach the difference.
const APART_PX: u32 = 4;

/// Whether the part of an image in a box shows an edge or a texture.
///
/// In images that show nothing, stones are reported with scores of up to 1.00. The likely cause, not tested
/// apart from others: the network normalises its features to one spread in every image (group normalisation,
/// Wu & He 2018), and there all spread comes from the zeros with which its layers are padded at the border.
/// Where the box of a stone has neither a joint nor a texture, there is nothing that could be one.
pub(super) fn has_contrast(image: &RgbImage, [left, top, right, bottom]: Bounds) -> bool {
    let range =
        |low: f32, high: f32, size: u32| (low.max(0.0) as u32)..(high.ceil().max(0.0) as u32).min(size);
    let (columns, rows) = (
        range(left, right, image.width()),
        range(top, bottom, image.height()),
    );
    let differs = |x: u32, y: u32, [other_x, other_y]: [u32; 2]| {
        let inside = other_x < columns.end && other_y < rows.end;
        let pair = image
            .get(x, y)
            .zip(image.get(other_x, other_y).filter(|_| inside));
        pair.is_some_and(|(a, b)| (0..3).any(|c| a[c].abs_diff(b[c]) >= LEAST_DIFFERENCE))
    };
    let step = |side: &std::ops::Range<u32>| APART_PX.min((side.len() as u32).saturating_sub(1));
    let (right, down) = (step(&columns), step(&rows));
    rows.clone().any(|y| {
        columns
            .clone()
            .any(|x| differs(x, y, [x + right, y]) || differs(x, y, [x, y + down]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::raster::Raster;

    fn image(value: impl Fn(u32, u32) -> u8) -> RgbImage {
        let pixels = (0..40 * 30).map(|i| [value(i % 40, i / 40); 3]).collect();
        Raster::from_vec(40, 30, pixels).unwrap()
    }

    #[test]
    fn edges_and_textures_are_contrast_and_slow_changes_are_not() {
        let all = [0.0, 0.0, 40.0, 30.0];
        assert!(!has_contrast(&image(|_, _| 0), all));
        assert!(
            !has_contrast(&image(|x, y| 100 + (x + y) as u8 / 2), all),
            "a sky"
        );
        assert!(
            !has_contrast(&image(|x, y| ((x * 7 + y * 5) % 3) as u8), all),
            "rounding"
        );
        assert!(
            has_contrast(&image(|x, _| if x < 20 { 10 } else { 15 }), all),
            "a faint edge"
        );
        assert!(
            has_contrast(&image(|_, y| (2 * y.clamp(10, 14)) as u8), all),
            "a blurred edge"
        );
        // The edge lies outside the box.
        assert!(!has_contrast(
            &image(|x, _| if x < 20 { 10 } else { 90 }),
            [-3.0, -2.0, 19.5, 99.0]
        ));
        assert!(
            has_contrast(
                &image(|x, _| if x < 20 { 10 } else { 90 }),
                [19.0, 5.0, 21.0, 7.0]
            ),
            "a small box"
        );
        assert!(!has_contrast(&image(|_, _| 9), [5.0, 5.0, 5.2, 5.1]));
    }
}
