//! Rectangles and masks in the photo's pixels.

use super::grid::Rect;
use crate::Patch;

/// The rectangle of a mask.
pub fn extent(mask: &Patch) -> Rect {
    Rect {
        left: mask.left,
        top: mask.top,
        width: mask.pixels.width(),
        height: mask.pixels.height(),
    }
}

/// Whether two rectangles share a pixel.
pub fn intersects(a: &Rect, b: &Rect) -> bool {
    intersection(a, b).is_some()
}

/// The pixels that two rectangles share.
pub fn intersection(a: &Rect, b: &Rect) -> Option<Rect> {
    let (left, top) = (a.left.max(b.left), a.top.max(b.top));
    let right = (a.left + a.width).min(b.left + b.width);
    let bottom = (a.top + a.height).min(b.top + b.height);
    (left < right && top < bottom).then(|| Rect {
        left,
        top,
        width: right - left,
        height: bottom - top,
    })
}

/// Pixels of a mask inside a rectangle that lies within its extent.
pub fn pixels_in(mask: &Patch, part: &Rect) -> u32 {
    rows(mask, part)
        .map(|row| row.iter().filter(|set| **set).count() as u32)
        .sum()
}

/// Number of pixels that two masks share.
pub fn common_pixels(a: &Patch, b: &Patch) -> u32 {
    let Some(part) = intersection(&extent(a), &extent(b)) else {
        return 0;
    };
    let both = |(a, b): (&[bool], &[bool])| a.iter().zip(b).filter(|(a, b)| **a && **b).count() as u32;
    rows(a, &part).zip(rows(b, &part)).map(both).sum()
}

/// Rows of a mask inside a rectangle that lies within its extent.
fn rows<'a>(mask: &'a Patch, part: &Rect) -> impl Iterator<Item = &'a [bool]> {
    let width = mask.pixels.width() as usize;
    let left = (part.left - mask.left) as usize;
    let (top, columns) = ((part.top - mask.top) as usize, part.width as usize);
    (top..top + part.height as usize).map(move |y| &mask.pixels.data()[y * width + left..][..columns])
}
