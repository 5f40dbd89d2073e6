//! What a camera sees of a cloud.

use super::PlannedView;
use super::fill::fill_gaps;
use super::shade::{Side, relief_shade};
use crate::cloud::Cloud;
use crate::geometry::{Bounds, View};
use crate::raster::{DepthMap, Raster, RgbImage};
use nalgebra::Point3;

/// Standard deviation of the spot of a point, in distances between points: spots of neighbouring points overlap
/// and stay sharp.
const SPOT: f64 = 0.6;
/// Half the side of the square that a spot covers, in its standard deviations.
const SPOT_SIDE: f64 = 2.5;
/// Gaps up to twice as wide are filled, in distances between points: holes of stereo clouds on smooth stones, no
/// windows.
const HALF_GAP: f64 = 8.0;
/// Half the side of the window of a slope of the relief, in distances between points.
const HALF_SLOPE: f64 = 2.0;
/// How far behind the nearest surface a point still belongs to it, metres.
const TOLERANCE_M: f64 = 0.03;
/// Shortest distance of a point from the camera, metres.
const NEAREST_M: f64 = 0.5;

/// A picture that grows while points pass by, twice: first for the depth of the nearest surface, then for the
/// mean of the points on it.
pub struct Picture<'a> {
    view: &'a View,
    spacing_px: f64,
    nearest: DepthMap,
    /// Weighted sums of three values and of the depth behind the nearest, metres; and the weight.
    sums: Raster<[f32; 5]>,
}

impl<'a> Picture<'a> {
    /// Memory of a pixel, bytes.
    pub const PIXEL_BYTES: u64 = 24;

    /// An empty picture.
    pub fn new(planned: &'a PlannedView) -> Self {
        let view = &planned.view;
        let (width, height) = (view.camera.width, view.camera.height);
        Self {
            view,
            spacing_px: planned.spacing_px,
            nearest: DepthMap::filled(width, height, f32::INFINITY),
            sums: Raster::filled(width, height, [0.0; 5]),
        }
    }

    /// Whether points within a box may show in the picture; cheap, and seldom wrongly true.
    pub fn may_show(&self, bounds: &Bounds) -> bool {
        let middle = self.view.cam_from_world * nalgebra::center(&bounds.min, &bounds.max);
        let radius_m = 0.5 * (bounds.max - bounds.min).norm();
        let depth_m = middle.z.max(NEAREST_M);
        let camera = &self.view.camera;
        let half = [camera.width, camera.height].map(|side| 0.5 * f64::from(side) / camera.focal_px[0]);
        let is_near = |axis: usize| {
            // Distance from the plane through the side of the picture.
            middle[axis].abs() - half[axis] * depth_m < radius_m * (1.0 + half[axis] * half[axis]).sqrt()
        };
        middle.z + radius_m > NEAREST_M && is_near(0) && is_near(1)
    }

    /// First pass: brings the depth of the nearest surface up to date.
    pub fn add_depths(&mut self, cloud: &Cloud) {
        for i in 0..cloud.len() {
            if let Some(spot) = self.spot(&cloud.world(i)) {
                let depth = spot.depth_m as f32;
                spot.each_pixel(self.nearest.width(), self.nearest.height(), |x, y, _| {
                    if let Some(nearest) = self.nearest.get_mut(x, y) {
                        *nearest = nearest.min(depth);
                    }
                });
            }
        }
    }

    /// Second pass: adds the points that lie on the nearest surface, with their colours (0 to 255; a grey three
    /// times where they have none).
    pub fn add_values(&mut self, cloud: &Cloud, values: &[[u8; 3]]) {
        for (i, value) in values.iter().enumerate().take(cloud.len()) {
            let Some(spot) = self.spot(&cloud.world(i)) else {
                continue;
            };
            spot.each_pixel(self.nearest.width(), self.nearest.height(), |x, y, weight| {
                let nearest = self.nearest.get(x, y).copied().unwrap_or(f32::INFINITY);
                let behind_m = spot.depth_m - f64::from(nearest);
                if behind_m > TOLERANCE_M {
                    return;
                }
                if let Some([r, g, b, behind, sum]) = self.sums.get_mut(x, y) {
                    for (sum, v) in [r, g, b].into_iter().zip(value) {
                        *sum += weight * f32::from(*v);
                    }
                    *behind += weight * behind_m as f32;
                    *sum += weight;
                }
            });
        }
    }

    /// The picture of the values; black where the cloud shows nothing.
    pub fn image(&self) -> RgbImage {
        let mut image = RgbImage::filled(self.sums.width(), self.sums.height(), [0; 3]);
        let mut known = vec![false; self.sums.data().len()];
        for ((pixel, known), [r, g, b, _, weight]) in
            image.data_mut().iter_mut().zip(&mut known).zip(self.sums.data())
        {
            if *weight > 0.0 {
                *known = true;
                *pixel = [r, g, b].map(|v| (v / weight).round().clamp(0.0, 255.0) as u8);
            }
        }
        fill_gaps(&mut image, &mut known, self.in_pixels(HALF_GAP));
        image
    }

    /// The picture of the relief, as bright as its values, lit from the upper left and in every second view from
    /// the upper right.
    pub fn relief(&self) -> RgbImage {
        let mut depth = self.nearest.clone();
        for (depth, [.., behind, weight]) in depth.data_mut().iter_mut().zip(self.sums.data()) {
            if *weight > 0.0 {
                *depth += behind / weight;
            }
        }
        let side = match self.view.image.0 % 2 {
            0 => Side::Left,
            _ => Side::Right,
        };
        let mut image = relief_shade(&depth, &self.view.camera, side, self.in_pixels(HALF_SLOPE));
        for (pixel, [value, .., weight]) in image.data_mut().iter_mut().zip(self.sums.data()) {
            if *weight > 0.0 {
                let share = value / weight / 255.0;
                *pixel = pixel.map(|v| (f32::from(v) * share).round() as u8);
            }
        }
        image
    }

    /// A length in distances between points, in whole pixels.
    fn in_pixels(&self, spacings: f64) -> usize {
        (spacings * self.spacing_px).round() as usize
    }

    /// Where a point leaves its spot.
    fn spot(&self, world: &Point3<f64>) -> Option<Spot> {
        let seen = self.view.project(world)?;
        (seen.depth_m > NEAREST_M && self.view.is_inside(seen.pixel)).then_some(Spot {
            pixel: seen.pixel,
            depth_m: seen.depth_m,
            sd_px: SPOT * self.spacing_px,
        })
    }
}

/// The pixels around a projected point.
struct Spot {
    pixel: [f64; 2],
    depth_m: f64,
    sd_px: f64,
}

impl Spot {
    /// Calls `visit` with each pixel inside the picture and its weight.
    fn each_pixel(&self, width: u32, height: u32, mut visit: impl FnMut(u32, u32, f32)) {
        let half = SPOT_SIDE * self.sd_px;
        let [columns, rows] = [(0, width), (1, height)].map(|(axis, side)| {
            let [low, high] = [-half, half].map(|reach| (self.pixel[axis] + reach).round().max(0.0) as u32);
            low..high.min(side)
        });
        let weight = |axis: usize, pixel: u32| {
            let apart = f64::from(pixel) + 0.5 - self.pixel[axis];
            (-0.5 * (apart / self.sd_px).powi(2)).exp()
        };
        for y in rows {
            let y_weight = weight(1, y);
            for x in columns.clone() {
                visit(x, y, (weight(0, x) * y_weight) as f32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;

    fn view(number: u32) -> PlannedView {
        PlannedView {
            view: View {
                image: ImageId(number),
                name: String::new(),
                camera: Camera::pinhole(80, 60, 100.0),
                cam_from_world: Rigid3::identity(),
            },
            spacing_px: 1.0,
            pixel_m: 0.05,
            is_straight: true,
        }
    }

    /// A plane at 5 m that is red on the left and blue on the right, and a white one behind it, which only
    /// shows through a window in the first.
    #[test]
    fn a_pixel_shows_the_nearest_surface() {
        let view = view(0);
        let grid = |depth: f64| {
            let places = (0..80).flat_map(|i| (0..60).map(move |j| [f64::from(i) + 0.3, f64::from(j) + 0.6]));
            places
                .map(move |[x, y]| Point3::new((x - 40.0) / 100.0 * depth, (y - 30.0) / 100.0 * depth, depth))
        };
        let is_window = |p: &Point3<f64>| p.x.abs() < 0.5 && p.y.abs() < 0.5;
        let front: Vec<_> = grid(5.0).filter(|p| !is_window(p)).collect();
        let values: Vec<[u8; 3]> = front
            .iter()
            .map(|p| if p.x < 0.0 { [200, 0, 0] } else { [0, 0, 180] })
            .collect();
        let back: Vec<_> = grid(6.0).collect();
        let white = vec![[255; 3]; back.len()];
        let clouds = [front, back].map(|points| Cloud::from_world(Point3::origin(), points));
        let mut picture = Picture::new(&view);
        clouds.iter().for_each(|c| picture.add_depths(c));
        picture.add_values(&clouds[1], &white);
        picture.add_values(&clouds[0], &values);
        let image = picture.image();
        assert_eq!(image.get(10, 30), Some(&[200, 0, 0]));
        assert_eq!(image.get(70, 30), Some(&[0, 0, 180]));
        assert_eq!(image.get(40, 30), Some(&[255; 3]));
    }

    /// Lambert's law by hand: a plane that leans to the light is brighter than one that leans away.
    #[test]
    fn relief_is_lit_from_the_upper_left_and_right_in_turn() {
        let grey = |number: u32, slope: f64| {
            let view = view(number);
            let mut picture = Picture::new(&view);
            let points =
                (0..160).flat_map(|i| (0..120).map(move |j| [0.5 * f64::from(i), 0.5 * f64::from(j)]));
            let points = points.map(|[x, y]| {
                let (x, y) = ((x - 40.0) / 100.0, (y - 30.0) / 100.0);
                // The ray (x, y, 1) meets the plane z = 5 + slope x.
                let z = 5.0 / (1.0 - slope * x);
                Point3::new(x * z, y * z, z)
            });
            let cloud = Cloud::from_world(Point3::origin(), points);
            picture.add_depths(&cloud);
            picture.add_values(&cloud, &vec![[255; 3]; cloud.len()]);
            picture
                .relief()
                .get(40, 30)
                .map(|p| f64::from(p[0]))
                .unwrap_or_default()
        };
        let expected = |across: f64, slope: f64| {
            let normal = nalgebra::Vector3::new(slope, 0.0, -1.0).normalize();
            let light = nalgebra::Vector3::new(across, -0.6, -0.62).normalize();
            255.0 * (0.25 + 0.75 * normal.dot(&light).max(0.0))
        };
        for (number, across) in [(0, -0.5), (1, 0.5), (2, -0.5)] {
            for slope in [-0.5, 0.0, 0.5] {
                let [found, expected] = [grey(number, slope), expected(across, slope)];
                assert!(
                    (found - expected).abs() < 4.0,
                    "{number}, {slope}: {found} {expected}"
                );
            }
        }
    }
}
