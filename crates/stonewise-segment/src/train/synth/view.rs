//! Where the camera stands: the homography between wall and photo, and the lens.

use super::cell::Extent;
use super::draw::{Rng, between, chance, normal};
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::f32::consts::{FRAC_PI_2, PI};

/// Most by which a pixel's size on the wall may differ from the middle's, within a photo.
const MAX_SCALE_RATIO: f32 = 2.5;

/// How the camera looks at the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Turn of the camera about its axis, radians; mostly within 0.15, now and then any angle.
    pub roll: f32,
    /// Angle of the wall's normal to the left or right of the camera's axis, radians, within 1.1.
    pub yaw: f32,
    /// Angle of the wall's normal up or down from the camera's axis, radians, within 0.7.
    pub pitch: f32,
    /// Focal length in parts of the photo's longer side, 0.8 to 4.
    pub focal: f32,
    /// Radial distortion at the photo's corners in parts of the distance from its middle, -0.06 to 0.06.
    pub distortion: f32,
}

impl Viewpoint {
    /// From the front, without distortion.
    pub const FRONTAL: Self = Self {
        roll: 0.0,
        yaw: 0.0,
        pitch: 0.0,
        focal: 2.0,
        distortion: 0.0,
    };

    /// A viewpoint drawn at random, mostly upright and mildly oblique.
    pub(super) fn random(rng: &mut Rng) -> Self {
        let roll = match between(rng, 0.0, 1.0) {
            p if p < 0.05 => FRAC_PI_2,
            p if p < 0.10 => -FRAC_PI_2,
            p if p < 0.14 => PI,
            p if p < 0.20 => between(rng, -PI, PI),
            _ => 0.0,
        };
        let oblique = if chance(rng, 0.5) { 1.0 } else { 0.3 };
        Self {
            roll: roll + 0.06 * normal(rng),
            yaw: oblique * between(rng, -1.1, 1.1),
            pitch: oblique * between(rng, -0.7, 0.7),
            focal: between(rng, 0.8, 4.0),
            distortion: between(rng, -0.06, 0.06) * between(rng, 0.0, 1.0),
        }
    }
}

/// Maps pixels of a photo to places on the wall. One unit of the wall is one pixel in the middle of the
/// photo, up to foreshortening.
#[derive(Clone, Debug)]
pub(super) struct View {
    wall_from_photo: Matrix3<f32>,
    photo_from_wall: Matrix3<f32>,
    /// Determinant of `wall_from_photo`.
    determinant: f32,
    middle: [f32; 2],
    /// Distortion per squared pixel.
    distortion: f32,
    size: [f32; 2],
}

impl View {
    /// The view of a photo of `width` x `height` pixels; obliqueness is reduced where the wall would shrink
    /// out of sight.
    pub(super) fn new(viewpoint: &Viewpoint, width: u32, height: u32) -> Self {
        let size = [width as f32, height as f32];
        let middle = [0.5 * size[0], 0.5 * size[1]];
        let corner = middle[0].hypot(middle[1]).max(1.0);
        let mut view = Self {
            wall_from_photo: Matrix3::identity(),
            photo_from_wall: Matrix3::identity(),
            determinant: 1.0,
            middle,
            distortion: viewpoint.distortion / (corner * corner),
            size,
        };
        let mut strength = 1.0;

        // With no obliqueness left the ratio is 1, so this ends.
        while strength > 0.05 {
            view.turn(viewpoint, strength);
            let middle_scale = view.scale(middle[0], middle[1]);
            let fits = [[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size]
                .iter()
                .all(|p| {
                    let ratio = view.scale(p[0], p[1]) / middle_scale;
                    (1.0 / MAX_SCALE_RATIO..MAX_SCALE_RATIO).contains(&ratio)
                });
            if fits {
                return view;
            }
            strength *= 0.8;
        }

        view.turn(viewpoint, 0.0);
        view
    }

    /// Sets the pinhole projection of a turned plane at the distance of the focal length, about the photo's
    /// middle.
    fn turn(&mut self, viewpoint: &Viewpoint, strength: f32) {
        let focal = viewpoint.focal * self.size[0].max(self.size[1]);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), viewpoint.roll)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), strength * viewpoint.yaw)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), strength * viewpoint.pitch);
        let mut plane = *turn.matrix();
        plane.set_column(2, &Vector3::new(0.0, 0.0, focal));
        self.photo_from_wall = Matrix3::from_diagonal(&Vector3::new(focal, focal, 1.0)) * plane;
        self.wall_from_photo = self
            .photo_from_wall
            .try_inverse()
            .unwrap_or_else(Matrix3::identity);
        self.determinant = self.wall_from_photo.determinant();
    }

    /// The place on the wall behind a pixel coordinate.
    #[inline]
    pub(super) fn wall(&self, x: f32, y: f32) -> [f32; 2] {
        let m = &self.wall_from_photo;
        let (dx, dy) = (x - self.middle[0], y - self.middle[1]);
        let stretch = 1.0 + self.distortion * (dx * dx + dy * dy);
        let (x, y) = (dx * stretch, dy * stretch);
        let w = m[(2, 0)] * x + m[(2, 1)] * y + m[(2, 2)];
        [
            (m[(0, 0)] * x + m[(0, 1)] * y + m[(0, 2)]) / w,
            (m[(1, 0)] * x + m[(1, 1)] * y + m[(1, 2)]) / w,
        ]
    }

    /// The pixel coordinate of a place on the wall, without the lens's distortion.
    pub(super) fn photo(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let p = self.photo_from_wall * Vector3::new(u, v, 1.0);
        [p.x / p.z + self.middle[0], p.y / p.z + self.middle[1]]
    }

    /// The wall's plane as a camera sees it whose focal length is `focal_px`: normal over distance, one over
    /// units of the wall. Its product with the ray of depth 1 through a place of the photo is the inverse
    /// depth there.
    pub(super) fn plane(&self, focal_px: f32) -> Vector3<f32> {
        let m = &self.wall_from_photo;
        Vector3::new(m[(2, 0)] * focal_px, m[(2, 1)] * focal_px, m[(2, 2)])
    }

    /// Pixels per unit of the wall at a pixel coordinate, the geometric mean over directions; 0 beyond the
    /// wall's horizon.
    pub(super) fn scale(&self, x: f32, y: f32) -> f32 {
        let m = &self.wall_from_photo;
        let (dx, dy) = (x - self.middle[0], y - self.middle[1]);
        let w = m[(2, 0)] * dx + m[(2, 1)] * dy + m[(2, 2)];
        let area = self.determinant / (w * w * w);
        if area > 0.0 && w * m[(2, 2)] > 0.0 {
            1.0 / area.sqrt()
        } else {
            0.0
        }
    }

    /// What the photo shows of the wall.
    pub(super) fn extent(&self) -> Extent {
        let mut extent = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
        for i in 0..=8 {
            for j in 0..=8 {
                let p = self.wall(self.size[0] * i as f32 / 8.0, self.size[1] * j as f32 / 8.0);
                for axis in 0..2 {
                    extent[axis] = extent[axis].min(p[axis]);
                    extent[axis + 2] = extent[axis + 2].max(p[axis]);
                }
            }
        }
        extent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn wall_and_photo_agree_with_a_pinhole_camera() {
        let viewpoint = Viewpoint {
            roll: 0.3,
            yaw: 0.5,
            pitch: -0.2,
            ..Viewpoint::FRONTAL
        };
        let view = View::new(&viewpoint, 200, 100);
        let focal = 2.0 * 200.0;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.3)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), 0.5)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), -0.2);
        for wall in [[0.0, 0.0], [40.0, -20.0], [-70.0, 35.0]] {
            let ray = turn * Vector3::new(wall[0], wall[1], 0.0) + Vector3::new(0.0, 0.0, focal);
            let pixel = [100.0 + focal * ray.x / ray.z, 50.0 + focal * ray.y / ray.z];
            let back = view.wall(pixel[0], pixel[1]);
            assert!((back[0] - wall[0]).abs() < 1e-2 && (back[1] - wall[1]).abs() < 1e-2);
        }
    }

    #[test]
    fn no_viewpoint_shows_the_horizon() {
        let mut rng = Rng::seed_from_u64(2);
        for _ in 0..300 {
            let view = View::new(&Viewpoint::random(&mut rng), 384, 384);
            let extent = view.extent();
            let area = (extent[2] - extent[0]) * (extent[3] - extent[1]);
            assert!(area < 60.0 * 384.0 * 384.0, "{extent:?}");
        }
    }
}
