//! A mask found in one tile, in the photo's pixels.

use super::grid::Rect;
use crate::{Detection, Patch};
use stonewise_core::raster::Raster;

/// A mask that reaches this close to the border of a tile inside the photo is taken to be cut, pixels of the
/// tile: masks are uncertain by about as much.
const BORDER_PX: u32 = 2;

/// What one tile says about one stone.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Its pixels in the photo.
    pub mask: Patch,
    /// Number of them.
    pub area: u32,
    /// Score of the detector.
    pub score: f32,
    /// Place of the scale in the list.
    pub scale: usize,
    /// What the tile covers of the photo.
    pub tile: Rect,
    /// The tile's border cuts it.
    pub is_cut: bool,
}

/// The size of a photo, and of it at the scale of a tile.
#[derive(Clone, Copy, Debug)]
pub struct Scaling {
    /// Place of the scale in the list.
    pub index: usize,
    /// Width and height of the photo, pixels.
    pub photo: [u32; 2],
    /// Width and height of the photo at the scale, pixels.
    pub scaled: [u32; 2],
}

impl Scaling {
    /// The photo's pixels whose centres lie in these of the scale, along one side; end is exclusive.
    fn span(&self, side: usize, begin: u32, end: u32) -> [u32; 2] {
        let factor = f64::from(self.photo[side]) / f64::from(self.scaled[side]);
        [begin, end].map(|at| ((f64::from(at) * factor).round() as u32).min(self.photo[side]))
    }

    /// The part of the photo that a part of the scaled photo shows.
    pub fn rect(&self, part: &Rect) -> Rect {
        let [left, right] = self.span(0, part.left, part.left + part.width);
        let [top, bottom] = self.span(1, part.top, part.top + part.height);
        Rect {
            left,
            top,
            width: right - left,
            height: bottom - top,
        }
    }
}

/// Brings a detection in a tile to the photo; `None` where no pixel is left.
pub fn candidate(detection: &Detection, tile: &Rect, scaling: &Scaling) -> Option<Candidate> {
    let patch = &detection.mask;
    let inside = Rect {
        left: tile.left + patch.left,
        top: tile.top + patch.top,
        width: patch.pixels.width(),
        height: patch.pixels.height(),
    };
    let target = scaling.rect(&inside);
    let mut pixels = Raster::filled(target.width, target.height, false);
    let mut area = 0;
    let factor = |side: usize| f64::from(scaling.scaled[side]) / f64::from(scaling.photo[side]);
    let (fx, fy) = (factor(0), factor(1));

    for y in 0..target.height {
        let v = (f64::from(target.top + y) + 0.5) * fy - f64::from(inside.top);
        for x in 0..target.width {
            let u = (f64::from(target.left + x) + 0.5) * fx - f64::from(inside.left);
            if is_inside(&patch.pixels, u, v)
                && let Some(pixel) = pixels.get_mut(x, y)
            {
                *pixel = true;
                area += 1;
            }
        }
    }

    (area > 0).then(|| Candidate {
        mask: Patch {
            left: target.left,
            top: target.top,
            pixels,
        },
        area,
        score: detection.score,
        scale: scaling.index,
        tile: scaling.rect(tile),
        is_cut: is_cut(patch, tile, scaling.scaled),
    })
}

/// Whether a mask, interpolated linearly between the centres of its pixels, reaches one half at a place.
fn is_inside(pixels: &Raster<bool>, u: f64, v: f64) -> bool {
    let (u, v) = (u - 0.5, v - 0.5);
    let (x, y) = (u.floor(), v.floor());
    let value = |dx: f64, dy: f64| {
        let (x, y) = (x + dx, y + dy);
        let is_set = x >= 0.0 && y >= 0.0 && pixels.get(x as u32, y as u32) == Some(&true);
        f64::from(u8::from(is_set))
    };
    let (a, b) = (u - x, v - y);
    let upper = value(0.0, 0.0) * (1.0 - a) + value(1.0, 0.0) * a;
    let lower = value(0.0, 1.0) * (1.0 - a) + value(1.0, 1.0) * a;
    upper * (1.0 - b) + lower * b >= 0.5
}

/// Whether a mask reaches a border of the tile that is not a border of the photo.
fn is_cut(patch: &Patch, tile: &Rect, scaled: [u32; 2]) -> bool {
    let columns = inner(tile.left, tile.width, scaled[0]);
    let rows = inner(tile.top, tile.height, scaled[1]);
    let (width, height) = (patch.pixels.width(), patch.pixels.height());
    let reaches = |x: u32, y: u32| {
        let (x, y) = (patch.left + x, patch.top + y);
        x < columns[0] || x >= columns[1] || y < rows[0] || y >= rows[1]
    };
    let set = |x: u32, y: u32| patch.pixels.get(x, y) == Some(&true);
    (0..height).any(|y| (0..width).any(|x| set(x, y) && reaches(x, y)))
}

/// Pixels of a tile, from and to, that are far enough from its borders inside the photo.
fn inner(origin: u32, size: u32, whole: u32) -> [u32; 2] {
    let begin = if origin > 0 { BORDER_PX } else { 0 };
    let end = if origin + size < whole {
        size - BORDER_PX.min(size)
    } else {
        size
    };
    [begin, end]
}
