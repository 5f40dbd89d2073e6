//! Faces and photos drawn for tests.

use super::params::PhotoParams;
use super::patch::Patch;
use super::photo::Photo;
use super::surface::Surface;
use super::template::Face;
use crate::geometry::{Camera, FaceFrame, Rigid3, View};
use crate::id::ImageId;
use crate::statistics::split_mix;
use nalgebra::{Matrix3, Point3, Vector3};

/// Rows and columns of a drawn photo.
pub(super) const SIDE: usize = 48;

/// Cells within which one epoch is searched for on the other.
const SEARCH_CELLS: f64 = 10.0;

/// A flat face in the middle of a photo, 12 cells from its border.
pub(super) fn face(pose_error_px: f64) -> Face {
    let params = PhotoParams {
        min_correlation: 0.0,
        pose_error_px,
        ..PhotoParams::default()
    };
    let surface = Surface::flat(SIDE, 12);
    let pixel_m = surface.cell_m;
    Face::new(surface, pixel_m, SEARCH_CELLS * pixel_m, &params)
}

/// Noise of grains of about `grain` cells, moved by `shift` columns and rows.
pub(super) fn grained(seed: u64, grain: f64, shift: [f64; 2]) -> Patch {
    let node = |i: i64, j: i64| {
        let number = split_mix(seed ^ split_mix((i as u64) << 32 ^ (j as u64 & 0xffff_ffff)));
        number as f64 / u64::MAX as f64 - 0.5
    };
    let value = |x: f64, y: f64| {
        let (x, y) = (x / grain, y / grain);
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        let (i, j) = (i as i64, j as i64);
        let line = |j: i64| node(i, j) * (1.0 - u) + node(i + 1, j) * u;
        line(j) * (1.0 - v) + line(j + 1) * v
    };
    // Far from the corner of the nodes, so that shifts of any sign show the same grain.
    let at = |k: usize, shift: f64| k as f64 - shift + 200.0;
    let values = (0..SIDE * SIDE)
        .map(|k| value(at(k % SIDE, shift[0]), at(k / SIDE, shift[1])) as f32)
        .collect();
    Patch::new(values, vec![true; SIDE * SIDE], SIDE)
}

/// A photo that sees a face obliquely: the photo, a point of the face, the face's frame.
pub(super) fn oblique() -> (Photo, Point3<f64>, Matrix3<f64>) {
    let normal = Vector3::new(0.9, 0.1, 0.3).normalize();
    let turn = FaceFrame::from_normal(&normal).face_from_world();
    let at = Point3::new(1.0, 2.0, 3.0);
    let centre = at + normal * 7.0 + Vector3::new(0.0, 2.0, -1.0);
    let look = Rigid3::face_towards(&centre, &(at - Vector3::z()), &Vector3::z()).inverse();
    let photo = Photo {
        name: "a".to_owned(),
        epoch: 0,
        camera: Box::new(View {
            image: ImageId(0),
            name: "a".to_owned(),
            camera: Camera::pinhole(2000, 1500, 1800.0),
            cam_from_world: look,
        }),
    };
    (photo, at, turn)
}
