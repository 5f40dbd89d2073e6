//! A photo prepared for the projection of many points.

use crate::cloud::Cloud;
use crate::geometry::{Brown, Camera, Distortion, View};
use nalgebra::{Matrix3, Point3, Vector3};
use pulp::{Arch, Simd, WithSimd};

/// Points that are projected together, in the processor's vectors.
pub(super) const CHUNK: usize = 32;

/// x, y and z of some points.
pub(super) type Chunk = [[f64; CHUNK]; 3];

/// World coordinates of some points of a tile, [`CHUNK`] at most; NaN beyond them.
pub(super) fn chunk_of(cloud: &Cloud, points: impl Iterator<Item = u32>) -> Chunk {
    let mut chunk = [[f64::NAN; CHUNK]; 3];
    for (k, i) in points.take(CHUNK).enumerate() {
        let world = cloud.world(i as usize);
        for (row, coordinate) in chunk.iter_mut().zip(world.iter()) {
            row[k] = *coordinate;
        }
    }
    chunk
}

/// Where a photo shows the points of a chunk.
pub(super) struct Shown {
    /// The points in the frame of the camera; z is their depth.
    pub points: Chunk,
    /// x and y of their pixels; x is NaN where the photo does not show the point.
    pub pixels: [[f64; CHUNK]; 2],
}

impl Shown {
    /// No points.
    pub(super) fn none() -> Self {
        Self {
            points: [[f64::NAN; CHUNK]; 3],
            pixels: [[f64::NAN; CHUNK]; 2],
        }
    }

    /// Pixel of a point; `None` where the photo does not show it.
    #[inline]
    pub(super) fn pixel(&self, k: usize) -> Option<[f64; 2]> {
        let [x, y] = [self.pixels[0][k], self.pixels[1][k]];
        (!x.is_nan()).then_some([x, y])
    }
}

/// A view with all quantities that do not depend on the point.
pub(super) struct PhotoFrame<'a> {
    camera: &'a Camera,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    /// Geometric mean of the focal lengths, pixels. Divided by a depth it gives pixels per metre there.
    pub focal_px: f64,
}

impl<'a> PhotoFrame<'a> {
    pub(super) fn of(view: &'a View) -> Self {
        let [fx, fy] = view.camera.focal_px;
        Self {
            camera: &view.camera,
            rotation: view.cam_from_world.rotation.to_rotation_matrix().into_inner(),
            translation: view.cam_from_world.translation.vector,
            focal_px: (fx * fy).sqrt(),
        }
    }

    /// A direction of the world in the frame of the camera.
    pub(super) fn direction(&self, world: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * world
    }

    /// Projects points.
    pub(super) fn show(&self, world: &Chunk, shown: &mut Shown) {
        // Each lens has a loop of its own. Those of the first two have no branches, so that they are compiled to
        // vectors; the fisheye's arc tangent is not.
        match &self.camera.distortion {
            Distortion::None => self.show_through(Pinhole, world, shown),
            Distortion::Brown(lens) => self.show_through(lens, world, shown),
            lens @ Distortion::Fisheye(_) => self.show_through(lens, world, shown),
        }
        if let Some(near) = self.camera.near {
            for k in 0..CHUNK {
                if near.hides(&Point3::from([0, 1, 2].map(|a| shown.points[a][k]))) {
                    shown.pixels[0][k] = f64::NAN;
                }
            }
        }
    }

    /// Projects points, without the near plane.
    fn show_through<L: Lens>(&self, lens: L, world: &Chunk, shown: &mut Shown) {
        Arch::new().dispatch(Projection {
            frame: self,
            lens,
            world,
            shown,
        });
    }
}

/// A lens of one kind.
trait Lens {
    /// As [`Distortion::distort`].
    fn distort(&self, place: [f64; 2]) -> Option<[f64; 2]>;
}

struct Pinhole;

impl Lens for Pinhole {
    #[inline(always)]
    fn distort(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        Some(place)
    }
}

impl Lens for &Brown {
    #[inline(always)]
    fn distort(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        Brown::distort(self, place)
    }
}

impl Lens for &Distortion {
    #[inline(always)]
    fn distort(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        Distortion::distort(self, place)
    }
}

struct Projection<'a, L> {
    frame: &'a PhotoFrame<'a>,
    lens: L,
    world: &'a Chunk,
    shown: &'a mut Shown,
}

impl<L: Lens> WithSimd for Projection<'_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (frame, shown) = (self.frame, self.shown);
        let (r, t, camera) = (&frame.rotation, &frame.translation, frame.camera);
        for k in 0..CHUNK {
            for a in 0..3 {
                shown.points[a][k] = r[(a, 0)] * self.world[0][k]
                    + r[(a, 1)] * self.world[1][k]
                    + r[(a, 2)] * self.world[2][k]
                    + t[a];
            }
            let [x, y, z] = [shown.points[0][k], shown.points[1][k], shown.points[2][k]];
            let [px, py] = camera.pixel_of(self.lens.distort([x / z, y / z]).unwrap_or([f64::NAN; 2]));
            let is_shown = (z > 0.0) & camera.is_inside([px, py]);
            shown.pixels[0][k] = if is_shown { px } else { f64::NAN };
            shown.pixels[1][k] = py;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{NearPlane, Rigid3};
    use crate::id::ImageId;
    use nalgebra::{Translation3, UnitQuaternion};
    use rand::{RngExt, SeedableRng};

    /// Points on all sides of cameras with every lens are shown as if each were projected alone.
    #[test]
    fn points_are_shown_together_as_alone() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        let mut draw = |reach: f64| Vector3::from_fn(|_, _| rng.random_range(-reach..reach));
        let lenses = [
            Distortion::None,
            Distortion::brown([-0.1, 0.03, 0.0, 0.001], [0.02, 0.0, 0.0], [4e-4, -1e-4]),
            Distortion::fisheye([0.02, -0.01, 0.0, 0.0], [0.0, 0.0]),
        ];
        let near = [None, Some((Vector3::z(), 2.0))];
        let (mut seen, mut all) = (0, 0);
        for (distortion, near) in lenses
            .iter()
            .flat_map(|lens| near.map(|near| (lens.clone(), near)))
        {
            let turn = UnitQuaternion::from_scaled_axis(draw(1.0));
            let view = View {
                image: ImageId(0),
                name: String::new(),
                camera: Camera {
                    distortion,
                    skew_px: 0.3,
                    focal_px: [60.0, 61.0],
                    near: near.map(|(normal, distance_m)| NearPlane { normal, distance_m }),
                    ..Camera::pinhole(100, 80, 60.0)
                },
                cam_from_world: Rigid3::from_parts(Translation3::from(draw(1.0)), turn),
            };
            for _ in 0..40 {
                let points: Vec<Point3<f64>> = (0..CHUNK - 1).map(|_| Point3::from(draw(4.0))).collect();
                let cloud = Cloud::from_world(Point3::origin(), points);
                let mut shown = Shown::none();
                PhotoFrame::of(&view).show(&chunk_of(&cloud, 0..cloud.len() as u32), &mut shown);
                for k in 0..cloud.len() {
                    let alone = view.project(&cloud.world(k)).filter(|p| view.is_inside(p.pixel));
                    assert_eq!(shown.pixel(k).is_some(), alone.is_some());
                    if let (Some(pixel), Some(alone)) = (shown.pixel(k), alone) {
                        let apart = [0, 1].map(|a| (pixel[a] - alone.pixel[a]).abs());
                        assert!(apart[0].max(apart[1]) < 1e-9, "{pixel:?} {alone:?}");
                        assert!((shown.points[2][k] - alone.depth_m).abs() < 1e-12);
                        seen += 1;
                    }
                    all += 1;
                }
                assert_eq!(shown.pixel(CHUNK - 1), None);
            }
        }
        assert!(10 * seen > all, "{seen} of {all}");
    }
}
