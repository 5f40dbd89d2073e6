//! What a camera sees of a cloud.

use super::fill::fill_gaps;
use super::shade::relief_shade;
use crate::cloud::Cloud;
use crate::geometry::{Bounds, View, floor};
use crate::raster::{DepthMap, Raster, RgbImage};
use nalgebra::Point3;

/// Standard deviation of the spot of a point, pixels: spots of neighbouring points overlap and stay sharp.
const SPOT_PX: f64 = 0.6;
/// How far behind the nearest surface a point still belongs to it, metres.
const TOLERANCE_M: f64 = 0.03;
/// Shortest distance of a point from the camera, metres.
const NEAREST_M: f64 = 0.5;

/// A picture that grows while points pass by, twice: first for the depth of the nearest surface, then for the
/// mean of the points on it.
pub struct Picture<'a> {
    view: &'a View,
    nearest: DepthMap,
    /// Weighted sums of three values and of the depth behind the nearest, metres; and the weight.
    sums: Raster<[f32; 5]>,
}

impl<'a> Picture<'a> {
    /// Memory of a pixel, bytes.
    pub const PIXEL_BYTES: u64 = 24;

    /// An empty picture.
    pub fn new(view: &'a View) -> Self {
        let (width, height) = (view.camera.width, view.camera.height);
        Self {
            view,
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
        fill_gaps(&mut image, &mut known);
        image
    }

    /// The picture of the relief, as bright as its values.
    pub fn relief(&self) -> RgbImage {
        let mut depth = self.nearest.clone();
        for (depth, [.., behind, weight]) in depth.data_mut().iter_mut().zip(self.sums.data()) {
            if *weight > 0.0 {
                *depth += behind / weight;
            }
        }
        let mut image = relief_shade(&depth, &self.view.camera);
        for (pixel, [value, .., weight]) in image.data_mut().iter_mut().zip(self.sums.data()) {
            if *weight > 0.0 {
                let share = value / weight / 255.0;
                *pixel = pixel.map(|v| (f32::from(v) * share).round() as u8);
            }
        }
        image
    }

    /// Where a point leaves its spot.
    fn spot(&self, world: &Point3<f64>) -> Option<Spot> {
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
        let first = self.pixel.map(|p| floor(p) - 1);
        let weights = [0, 1].map(|axis| {
            [0, 1, 2].map(|step| {
                let apart = (first[axis] + step) as f64 + 0.5 - self.pixel[axis];
                (-0.5 * (apart / SPOT_PX).powi(2)).exp()
            })
        });
        for (row, y_weight) in weights[1].into_iter().enumerate() {
            for (column, x_weight) in weights[0].into_iter().enumerate() {
                let at = [first[0] + column as i64, first[1] + row as i64].map(u32::try_from);
                if let [Ok(x), Ok(y)] = at
                    && x < width
                    && y < height
                {
                    visit(x, y, (x_weight * y_weight) as f32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;

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
            let cloud = Cloud::from_world(Point3::origin(), points);
            picture.add_depths(&cloud);
            picture.add_values(&cloud, &vec![[255; 3]; cloud.len()]);
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
