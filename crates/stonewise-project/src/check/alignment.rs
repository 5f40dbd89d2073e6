//! By how much the edges of a projected cloud miss those of a photo.

use super::edges::{Edges, Map};
use nalgebra::Point3;
use rayon::prelude::*;
use stonewise_core::geometry::View;
use stonewise_core::raster::RgbImage;

/// Points that a pixel of the depth map holds at least, on average: fewer leave holes.
const POINTS_A_PIXEL: usize = 3;
/// The map is the photo reduced by two to this power at most.
const MOST_HALVINGS: u32 = 5;
/// Shifts that are tried to either side, map pixels.
pub(super) const REACH: i64 = 48;
/// Edges that are compared.
const EDGES: usize = 30_000;
/// Fewer edges show nothing.
const LEAST_EDGES: usize = 800;
/// A peak stands out from this many standard deviations of all shifts' scores. Right cameras reach 6 to 7 on
/// the surveys at hand, other cameras 4.3.
const CLEAR: f64 = 5.0;
/// The edges fit where the camera puts them unless another place stands out from theirs by more than this many
/// standard deviations of all shifts' scores: the two are then told apart (95 %). Shadows beside the edges of
/// relief draw the peak to them by some pixels.
const TOLD_APART: f64 = 2.0;

/// A cloud's edges over a photo.
pub(super) struct Overlay {
    /// Pixels of the photo a pixel of the map.
    pub reduction: f64,
    /// Grey values of the reduced photo.
    pub grey: Map,
    /// The cloud's strongest edges, as pixels of the map.
    edges: Vec<(usize, [f32; 2])>,
}

/// Where the cloud's edges fit the photo's best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shift {
    /// From where the camera puts the cloud to where the photo shows it, pixels of the map.
    pub map_px: [f64; 2],
    /// How far the score of this shift stands out from all others', standard deviations.
    pub clearness: f64,
}

impl Shift {
    /// Whether the edges fit there beyond chance.
    pub fn is_clear(&self) -> bool {
        self.clearness >= CLEAR
    }

    /// Length, pixels of the map.
    pub fn length(&self) -> f64 {
        self.map_px[0].hypot(self.map_px[1])
    }
}

impl Overlay {
    /// Projects points into a photo; `None` where too few of them make an edge in it.
    pub fn new(points: &[Point3<f64>], view: &View, photo: &RgbImage) -> Option<Self> {
        let seen: Vec<([f64; 2], f32)> = points
            .par_iter()
            .filter_map(|p| {
                let seen = view.project(p)?;
                view.is_inside(seen.pixel)
                    .then_some((seen.pixel, seen.depth_m as f32))
            })
            .collect();
        let mut halvings = 0;
        let depth = loop {
            let map = depth_map(&seen, view, f64::from(1 << halvings));
            let filled = map.values.iter().filter(|v| v.is_finite()).count();
            if halvings == MOST_HALVINGS || seen.len() >= POINTS_A_PIXEL * filled.max(1) {
                break map;
            }
            halvings += 1;
        };
        let edges = Edges::of(&spread(&depth)).strongest(EDGES);
        let reduction = f64::from(1 << halvings);
        (edges.len() >= LEAST_EDGES).then(|| Self {
            reduction,
            grey: reduced(photo, [depth.width, depth.height], 1 << halvings),
            edges,
        })
    }

    /// The shift of the cloud's edges that fits the photo best: of every second within the reach, then of the
    /// best one's neighbours. Edges are smoothed over more than that.
    pub fn shift(&self) -> Shift {
        let photo = Edges::of(&self.grey);
        let side = REACH + 1;
        let scores: Vec<f64> = (0..side * side)
            .into_par_iter()
            .map(|k| self.score(&photo, [2 * (k % side) - REACH, 2 * (k / side) - REACH]))
            .collect();
        let mean = scores.iter().sum::<f64>() / scores.len() as f64;
        let variance = scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / scores.len() as f64;
        let best = scores.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let (at, score) = best.map_or((0, mean), |(i, s)| (i as i64, *s));
        let near = (0..9).map(|k| {
            [
                2 * (at % side) - REACH + k % 3 - 1,
                2 * (at / side) - REACH + k / 3 - 1,
            ]
        });
        let near = near.map(|shift| (shift, self.score(&photo, shift)));
        let best = near.max_by(|a, b| a.1.total_cmp(&b.1));
        let (shift, score) = best.unwrap_or(([0; 2], score));
        let clearness = |score: f64| (score - mean) / variance.sqrt().max(1e-12);
        let here = self.score(&photo, [0; 2]);
        let is_elsewhere = clearness(score) - clearness(here) > TOLD_APART;
        Shift {
            map_px: shift.map(|pixels| if is_elsewhere { pixels as f64 } else { 0.0 }),
            clearness: clearness(score),
        }
    }

    /// Mean agreement of edges at a shift, -1 to 1.
    fn score(&self, photo: &Edges, [dx, dy]: [i64; 2]) -> f64 {
        let (w, h) = (photo.width as i64, photo.height as i64);
        let (mut sum, mut own, mut other) = (0.0f64, 0.0f64, 0.0f64);
        for (at, a) in &self.edges {
            let (x, y) = (*at as i64 % w + dx, *at as i64 / w + dy);
            if x < 0 || y < 0 || x >= w || y >= h {
                continue;
            }
            let b = photo.vectors[(y * w + x) as usize];
            sum += f64::from(a[0] * b[0] + a[1] * b[1]);
            own += f64::from(a[0] * a[0] + a[1] * a[1]);
            other += f64::from(b[0] * b[0] + b[1] * b[1]);
        }
        sum / (own * other).sqrt().max(1e-12)
    }

    /// The photo in grey with the cloud's edges in orange.
    pub fn picture(&self) -> Vec<u8> {
        let value = |v: &f32| v.clamp(0.0, 255.0) as u8;
        let mut rgb: Vec<u8> = self.grey.values.iter().flat_map(|v| [value(v); 3]).collect();
        for (at, _) in &self.edges {
            rgb[3 * at..3 * at + 3].copy_from_slice(&[255, 120, 0]);
        }
        rgb
    }
}

/// Nearest depth in every pixel of the reduced photo.
fn depth_map(seen: &[([f64; 2], f32)], view: &View, reduction: f64) -> Map {
    let side = |pixels: u32| (f64::from(pixels) / reduction).ceil().max(1.0) as usize;
    let (width, height) = (side(view.camera.width), side(view.camera.height));
    let mut values = vec![f32::NAN; width * height];
    for (pixel, depth) in seen {
        let (x, y) = ((pixel[0] / reduction) as usize, (pixel[1] / reduction) as usize);
        if x < width && y < height {
            let value = &mut values[y * width + x];
            *value = value.min(*depth);
        }
    }
    Map {
        width,
        height,
        values,
    }
}

/// Every point covers its neighbouring pixels too, the nearest first.
fn spread(map: &Map) -> Map {
    let (w, h) = (map.width as i64, map.height as i64);
    let nearest = |i: i64| {
        let (x, y) = (i % w, i / w);
        let mut least = f32::NAN;
        for yy in (y - 1).max(0)..=(y + 1).min(h - 1) {
            for xx in (x - 1).max(0)..=(x + 1).min(w - 1) {
                least = least.min(map.values[(yy * w + xx) as usize]);
            }
        }
        least
    };
    Map {
        values: (0..w * h).map(nearest).collect(),
        ..*map
    }
}

/// The photo's grey values, means of squares of pixels, in a map of this width and height.
pub(super) fn reduced(photo: &RgbImage, [width, height]: [usize; 2], by: u32) -> Map {
    let grey = |x: usize, y: usize| {
        let (mut sum, mut n) = (0.0f32, 0.0f32);
        for yy in y as u32 * by..(y as u32 + 1) * by {
            for xx in x as u32 * by..(x as u32 + 1) * by {
                if let Some(p) = photo.get(xx, yy) {
                    sum += 0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2]);
                    n += 1.0;
                }
            }
        }
        if n > 0.0 { sum / n } else { f32::NAN }
    };
    Map {
        width,
        height,
        values: (0..width * height).map(|i| grey(i % width, i / width)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::geometry::{Camera, Rigid3};
    use stonewise_core::id::ImageId;
    use stonewise_core::raster::Raster;

    /// Depth of a wall of irregular stones with joints 3 cm deep, metres behind its face.
    fn joint(x: f64, y: f64) -> f64 {
        let row = (y / 0.25).floor();
        let wavy = 0.03 * (9.0 * x + row).sin() + y;
        let length = 0.35 + 0.1 * (row * 2.4).sin();
        let course = (wavy / 0.25).fract().abs();
        let head = ((x + 0.17 * row * row) / length).fract().abs();
        if course < 0.1 || head < 0.07 { 0.03 } else { 0.0 }
    }

    /// A photo of the wall, straight on from 5 m; the points, moved by `offset` along the wall.
    fn survey(offset: [f64; 2]) -> (Vec<Point3<f64>>, View, RgbImage) {
        let (width, height, f) = (800, 600, 1000.0);
        let view = View {
            image: ImageId(0),
            name: "a".to_owned(),
            camera: Camera::pinhole(width, height, f),
            cam_from_world: Rigid3::identity(),
        };
        let pixels = (0..width * height).map(|i| {
            let (x, y) = (f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
            let place = [(x - 400.0) * 5.0 / f, (y - 300.0) * 5.0 / f];
            // Mortar is brighter than stone here, and nothing is even.
            let noise = (f64::from(i).sin() * 43_758.5).fract() * 20.0;
            let grey = if joint(place[0], place[1]) > 0.0 {
                170.0
            } else {
                110.0
            };
            [(grey + noise) as u8; 3]
        });
        let photo = Raster::from_vec(width, height, pixels.collect()).unwrap();
        let grid = (0..800)
            .flat_map(|i| (0..600).map(move |j| (f64::from(i) * 0.005 - 2.0, f64::from(j) * 0.005 - 1.5)));
        let points = grid.map(|(x, y)| Point3::new(x + offset[0], y + offset[1], 5.0 + joint(x, y)));
        (points.collect(), view, photo)
    }

    #[test]
    fn the_shift_between_cloud_and_photo_is_found() {
        for offset in [[0.0, 0.0], [0.12, 0.0], [-0.2, 0.15]] {
            let (points, view, photo) = survey(offset);
            let overlay = Overlay::new(&points, &view, &photo).unwrap();
            let shift = overlay.shift();
            assert!(shift.is_clear(), "{offset:?}: {shift:?}");
            for axis in 0..2 {
                let found = shift.map_px[axis] * overlay.reduction * 5.0 / 1000.0;
                assert!((found + offset[axis]).abs() < 0.025, "{offset:?}: {found} m");
            }
        }
    }

    #[test]
    fn a_photo_of_something_else_fits_nowhere() {
        let (points, view, _) = survey([0.0, 0.0]);
        let noise = (0..800 * 600)
            .map(|i| [((f64::from(i) * 12.9898).sin() * 43_758.5).fract().abs() as f32 * 200.0; 1]);
        let photo = Raster::from_vec(800, 600, noise.map(|v| [v[0] as u8; 3]).collect()).unwrap();
        let shift = Overlay::new(&points, &view, &photo).unwrap().shift();
        assert!(!shift.is_clear(), "{shift:?}");
    }
}
