//! What a camera sees of a cloud.

use super::fill::fill_gaps;
use super::shade::relief_shade;
use crate::cloud::Cloud;
use crate::geometry::{View, floor};
use crate::raster::{DepthMap, Raster, RgbImage};

/// Standard deviation of the spot of a point, pixels: spots of neighbouring points overlap and stay sharp.
const SPOT_PX: f64 = 0.6;
/// How far behind the nearest surface a point still belongs to it, metres.
const TOLERANCE_M: f64 = 0.03;
/// Shortest distance of a point from the camera, metres.
const NEAREST_M: f64 = 0.5;

/// What the pixels of a picture show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shade {
    /// The colours of the points.
    Colour,
    /// Their intensity, as grey.
    Intensity,
    /// Their relief under light from the upper left, as grey.
    Relief,
}

/// A picture that grows while points pass by, twice: first for the depth of the nearest surface, then for the
/// values of the points on it.
pub struct Picture<'a> {
    view: &'a View,
    depth: DepthMap,
    /// Weighted sums of three values, and the weight.
    sums: Raster<[f32; 4]>,
}

impl<'a> Picture<'a> {
    /// An empty picture.
    pub fn new(view: &'a View) -> Self {
        let (width, height) = (view.camera.width, view.camera.height);
        Self {
            view,
            depth: DepthMap::filled(width, height, f32::INFINITY),
            sums: Raster::filled(width, height, [0.0; 4]),
        }
    }

    /// First pass: brings the depth of the nearest surface up to date.
    pub fn add_depths(&mut self, cloud: &Cloud) {
        for i in 0..cloud.len() {
            if let Some(spot) = self.spot(&cloud.world(i)) {
                let depth = spot.depth_m as f32;
                spot.each_pixel(self.depth.width(), self.depth.height(), |x, y, _| {
                    if let Some(nearest) = self.depth.get_mut(x, y) {
                        *nearest = nearest.min(depth);
                    }
                });
            }
        }
    }

    /// Second pass: adds the values (red, green, blue or one value three times; 0 to 255) of the points that
    /// lie on the nearest surface.
    pub fn add_values(&mut self, cloud: &Cloud, values: &[[u8; 3]]) {
        for (i, value) in values.iter().enumerate().take(cloud.len()) {
            let Some(spot) = self.spot(&cloud.world(i)) else {
                continue;
            };
            spot.each_pixel(self.depth.width(), self.depth.height(), |x, y, weight| {
                let nearest = self.depth.get(x, y).copied().unwrap_or(f32::INFINITY);
                if spot.depth_m > f64::from(nearest) + TOLERANCE_M {
                    return;
                }
                if let Some(sums) = self.sums.get_mut(x, y) {
                    for (sum, v) in sums.iter_mut().zip(value) {
                        *sum += weight * f32::from(*v);
                    }
                    sums[3] += weight;
                }
            });
        }
    }

    /// The picture of the values; black where the cloud shows nothing.
    pub fn image(&self) -> RgbImage {
        let mut image = RgbImage::filled(self.sums.width(), self.sums.height(), [0; 3]);
        let mut known = vec![false; self.sums.data().len()];
        for ((pixel, known), [r, g, b, weight]) in
            image.data_mut().iter_mut().zip(&mut known).zip(self.sums.data())
        {
            if *weight > 0.0 {
                *known = true;
                *pixel = [r, g, b].map(|v| (v / weight).round().clamp(0.0, 255.0) as u8);
            }
        }
        fill_gaps(&mut image, &mut known);
        image
    }

    /// The picture of the relief; needs the first pass only.
    pub fn relief(&self) -> RgbImage {
        relief_shade(&self.depth, &self.view.camera)
    }

    /// Where a point leaves its spot.
    fn spot(&self, world: &nalgebra::Point3<f64>) -> Option<Spot> {
        let seen = self.view.project(world)?;
        (seen.depth_m > NEAREST_M && self.view.is_inside(seen.pixel)).then_some(Spot {
            pixel: seen.pixel,
            depth_m: seen.depth_m,
        })
    }
}

/// The 3 x 3 pixels around a projected point.
struct Spot {
    pixel: [f64; 2],
    depth_m: f64,
}

impl Spot {
    /// Calls `visit` with each pixel inside the picture and its weight.
    fn each_pixel(&self, width: u32, height: u32, mut visit: impl FnMut(u32, u32, f32)) {
        let [x, y] = self.pixel.map(floor);
        for py in (y - 1).max(0)..=(y + 1).min(i64::from(height) - 1) {
            for px in (x - 1).max(0)..=(x + 1).min(i64::from(width) - 1) {
                let dx = px as f64 + 0.5 - self.pixel[0];
                let dy = py as f64 + 0.5 - self.pixel[1];
                let weight = (-0.5 * (dx * dx + dy * dy) / (SPOT_PX * SPOT_PX)).exp();
                visit(px as u32, py as u32, weight as f32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;
    use nalgebra::Point3;

    fn view() -> View {
        View {
            image: ImageId(0),
            name: String::new(),
            camera: Camera::pinhole(80, 60, 100.0),
            cam_from_world: Rigid3::identity(),
        }
    }

    /// A plane at 5 m that is red on the left and blue on the right, and a white one behind it, which only
    /// shows through a window in the first.
    #[test]
    fn a_pixel_shows_the_nearest_surface() {
        let view = view();
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
    fn relief_is_lit_from_the_upper_left() {
        let view = view();
        let grey = |slope: f64| {
            let mut picture = Picture::new(&view);
            let points =
                (0..160).flat_map(|i| (0..120).map(move |j| [0.5 * f64::from(i), 0.5 * f64::from(j)]));
            let points = points.map(|[x, y]| {
                let (x, y) = ((x - 40.0) / 100.0, (y - 30.0) / 100.0);
                // The ray (x, y, 1) meets the plane z = 5 + slope x.
                let z = 5.0 / (1.0 - slope * x);
                Point3::new(x * z, y * z, z)
            });
            picture.add_depths(&Cloud::from_world(Point3::origin(), points));
            picture
                .relief()
                .get(40, 30)
                .map(|p| f64::from(p[0]))
                .unwrap_or_default()
        };
        let expected = |slope: f64| {
            let normal = nalgebra::Vector3::new(slope, 0.0, -1.0).normalize();
            let light = nalgebra::Vector3::new(-0.5, -0.6, -0.62).normalize();
            255.0 * (0.25 + 0.75 * normal.dot(&light).max(0.0))
        };
        for slope in [-0.5, 0.0, 0.5] {
            assert!(
                (grey(slope) - expected(slope)).abs() < 4.0,
                "{slope}: {} {}",
                grey(slope),
                expected(slope)
            );
        }
    }
}
