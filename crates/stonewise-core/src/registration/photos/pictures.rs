//! Pictures of what was matched, for reports: a stone's face in one photo of each epoch, and their difference.

use super::matching::{Match, Warp};
use super::patch::Patch;
use super::surface::Surface;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Grey value of what a photo does not show, and of contrast that did not change.
const MIDDLE_GREY: f64 = 128.0;
/// Grey values for a difference of one local standard deviation: two of them, more than photos that correlate
/// by 0.4 mostly differ by, reach black and white.
const GREY_PER_SD: f64 = 63.5;
/// Share of a picture's pixels that are drawn black, and as many white, so that dark faces show their grain.
const CUT_SHARE: f64 = 0.01;
/// Least range of grey values that is stretched to black and white: the noise of a smooth face stays dim.
const LEAST_RANGE: f64 = 24.0;
/// Most samples along an edge of a pixel.
const MOST_SAMPLES: f64 = 4.0;

/// A stone's face as one photo of each epoch shows it, each shifted onto the stone's template as it was
/// matched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FacePictures {
    /// The photo of each epoch that correlates best with the template.
    pub photos: [usize; 2],
    /// Edge of the pictures, pixels.
    pub side_px: usize,
    /// Edge on the face, metres. Right is along the wall, up is up the face.
    pub edge_m: f64,
    /// Grey values in the first and in the second epoch, row by row, each stretched to black and white.
    #[serde(skip)]
    pub grey: [Vec<u8>; 2],
    /// Local contrast, as it is matched, of the second epoch less that of the first, where it was compared:
    /// 128 for equal, 63.5 for each standard deviation.
    #[serde(skip)]
    pub difference: Vec<u8>,
}

/// One photo of a stone.
#[derive(Clone, Copy)]
pub(super) struct Shown<'a> {
    pub photo: usize,
    /// Grey values on the stone's face.
    pub grey: &'a [Option<f32>],
    /// The patch of these values with normalised contrast.
    pub patch: &'a Patch,
    pub found: &'a Match,
}

/// Where the pixels of a picture lie on a face.
struct Frame<'a> {
    surface: &'a Surface,
    side_px: usize,
    edge_m: f64,
    /// Middle of the picture: along, up, metres.
    middle: [f64; 2],
    /// Samples along the edge of a pixel.
    samples: usize,
}

/// Draws the face, with a margin of `rim_m` around what was compared; `None` where nothing was.
pub(super) fn pictures(
    surface: &Surface,
    [first, second]: [Shown; 2],
    side_px: usize,
    rim_m: f64,
) -> Option<FacePictures> {
    let frame = Frame::new(surface, side_px, rim_m)?;
    let grey = [first, second].map(|shown| {
        let values = shown.grey.iter().map(|g| g.unwrap_or(0.0)).collect();
        let valid = shown.grey.iter().map(Option::is_some).collect();
        let patch = Patch::new(values, valid, surface.columns);
        stretched(&frame.drawn(|place| frame.value(&patch, &shown.found.warp, place)))
    });
    let difference = frame.drawn(|place| {
        let compared = surface.cell_at(place).is_some_and(|k| surface.inside[k]);
        let [a, b] = [first, second].map(|s| frame.value(s.patch, &s.found.warp, place));
        compared.then_some(MIDDLE_GREY + GREY_PER_SD * (b? - a?))
    });
    Some(FacePictures {
        photos: [first.photo, second.photo],
        side_px,
        edge_m: frame.edge_m,
        grey,
        difference: difference.into_iter().map(byte).collect(),
    })
}

/// Grey values from black to white but for the darkest and the brightest.
fn stretched(values: &[f64]) -> Vec<u8> {
    let mut sorted = values.to_vec();
    let cut = (CUT_SHARE * values.len() as f64) as usize;
    sorted.sort_by(f64::total_cmp);
    let (low, high) = (sorted[cut], sorted[values.len() - 1 - cut]);
    let gain = 255.0 / (high - low).max(LEAST_RANGE);
    let middle = 0.5 * (low + high);
    let grey = |v: &f64| byte(127.5 + gain * (v - middle));
    values.iter().map(grey).collect()
}

fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

impl<'a> Frame<'a> {
    fn new(surface: &'a Surface, side_px: usize, rim_m: f64) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for k in (0..surface.inside.len()).filter(|&k| surface.inside[k]) {
            let place = surface.place(k);
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        let edge_m = (high[0] - low[0]).max(high[1] - low[1]) + 2.0 * rim_m;
        if side_px == 0 || !(edge_m > 0.0 && edge_m.is_finite()) {
            return None;
        }
        let cells = edge_m / (side_px as f64 * surface.cell_m);
        Some(Self {
            surface,
            side_px,
            edge_m,
            middle: [0, 1].map(|axis| 0.5 * (low[axis] + high[axis])),
            samples: cells.ceil().clamp(1.0, MOST_SAMPLES) as usize,
        })
    }

    /// The mean values in the pixels of a picture.
    fn drawn(&self, value: impl Fn([f64; 2]) -> Option<f64>) -> Vec<f64> {
        let n = self.samples;
        let of_pixel = |k: usize| -> f64 {
            let (column, row) = (k % self.side_px, k / self.side_px);
            let (mut sum, mut count) = (0.0, 0.0);
            for s in 0..n * n {
                let part = |whole: usize, s: usize| whole as f64 + (s as f64 + 0.5) / n as f64;
                let place = self.place(part(column, s % n), part(row, s / n));
                if let Some(v) = value(place) {
                    sum += v;
                    count += 1.0;
                }
            }
            if count > 0.0 { sum / count } else { MIDDLE_GREY }
        };
        (0..self.side_px * self.side_px).map(of_pixel).collect()
    }

    /// Place on the face of a point of the picture, whose rows run down.
    fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let share = |v: f64| v / self.side_px as f64 - 0.5;
        [
            self.middle[0] + share(x) * self.edge_m,
            self.middle[1] - share(y) * self.edge_m,
        ]
    }

    /// Value of a photo that lies on the template by a warp.
    fn value(&self, patch: &Patch, warp: &Warp, place: [f64; 2]) -> Option<f64> {
        let cells =
            |place: &[f64; 2], axis: usize| (place[axis] - self.surface.first[axis]) / self.surface.cell_m;
        let middle = Vector2::from_fn(|axis, _| cells(&self.surface.middle, axis));
        let at = Vector2::from_fn(|axis, _| cells(&place, axis));
        let to = middle + warp.at(at - middle);
        patch.sample(self.surface, to.x, to.y).map(f64::from)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{SIDE, face, grained};
    use super::*;
    use nalgebra::Matrix2;

    fn found(shift: [f64; 2]) -> Match {
        Match {
            is_affine: true,
            warp: Warp::shift(Vector2::from(shift)),
            covariance: Matrix2::identity(),
            correlation: 0.9,
        }
    }

    /// Pictures of two photos whose grain lies apart by `moved` cells, matched at `at`.
    fn drawn(moved: [f64; 2], at: [f64; 2]) -> FacePictures {
        let surface = &face(0.5).surface;
        let patches = [[0.0; 2], moved].map(|shift| grained(4, 4.0, shift));
        let grey = [0, 1].map(|k| -> Vec<Option<f32>> {
            patches[k]
                .values
                .iter()
                .map(|v| Some(100.0 + 100.0 * v))
                .collect()
        });
        let founds = [[0.0; 2], at].map(found);
        let shown = [0, 1].map(|k| Shown {
            photo: 3 + k,
            grey: &grey[k],
            patch: &patches[k],
            found: &founds[k],
        });
        pictures(surface, shown, 24, 0.006).unwrap()
    }

    #[test]
    fn a_photo_matched_where_it_lies_shows_the_same_face_without_difference() {
        let moved = [3.0, -2.0];
        let right = drawn(moved, moved);
        assert_eq!((right.photos, right.side_px), ([3, 4], 24));
        let apart = |p: &FacePictures| -> i32 {
            let pairs = p.grey[0].iter().zip(&p.grey[1]);
            pairs.map(|(a, b)| i32::from(a.abs_diff(*b))).max().unwrap()
        };
        let changed = |p: &FacePictures| p.difference.iter().map(|d| d.abs_diff(128)).max().unwrap();
        assert!(apart(&right) <= 1 && changed(&right) <= 1);
        let wrong = drawn(moved, [0.0; 2]);
        assert!(apart(&wrong) > 20 && changed(&wrong) > 20);
    }

    #[test]
    fn up_the_face_is_up_in_the_picture() {
        let surface = &face(0.5).surface;
        // Brighter along, and darker up.
        let value = |k: usize| ((k % SIDE) as f32, (k / SIDE) as f32);
        let grey: Vec<Option<f32>> = (0..SIDE * SIDE)
            .map(|k| Some(100.0 + 0.5 * value(k).0 - 1.5 * value(k).1))
            .collect();
        let patch = grained(1, 3.0, [0.0; 2]);
        let still = found([0.0; 2]);
        let shown = Shown {
            photo: 0,
            grey: &grey,
            patch: &patch,
            found: &still,
        };
        let p = pictures(surface, [shown; 2], 16, 0.006).unwrap();
        let at = |x: usize, y: usize| i32::from(p.grey[0][16 * y + x]);
        assert!(at(12, 8) > at(3, 8) && at(8, 12) > at(8, 3) + 40);
        let darkest = p.grey[0].iter().min();
        assert!(darkest == Some(&0) && p.grey[0].iter().max() == Some(&255));
        // What was compared is 24 cells of 3 mm wide, 23 from middle to middle, and the margin.
        assert!((p.edge_m - (23.0 * 0.003 + 0.012)).abs() < 1e-12);
        assert_eq!(p.difference[0], 128, "the margin is not compared");
    }
}
