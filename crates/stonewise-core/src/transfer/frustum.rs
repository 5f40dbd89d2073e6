//! Which tiles a photo can show at all.

use crate::geometry::{Bounds, Camera, View};
use nalgebra::{Point3, Vector3};

/// Rays through the image border leave a cone of this much more than the widest one: the border between the
/// sampled pixels.
const MARGIN: f64 = 1.05;

/// A cone around everything that a photo shows.
pub(super) struct Cone {
    apex: Point3<f64>,
    axis: Vector3<f64>,
    half_angle: f64,
}

impl Cone {
    pub(super) fn of(view: &View) -> Self {
        let axis = view.cam_from_world.inverse_transform_vector(&Vector3::z());
        Self {
            apex: view.centre(),
            axis,
            half_angle: widest_angle(&view.camera) * MARGIN,
        }
    }

    /// False only where no point of the box can be in the photo.
    pub(super) fn touches(&self, bounds: &Bounds) -> bool {
        let to_centre = bounds.centre() - self.apex;
        let radius = (bounds.max - bounds.min).norm() / 2.0;
        let distance = to_centre.norm();
        if distance <= radius {
            return true;
        }
        let angle = self.axis.angle(&to_centre);
        angle <= self.half_angle + (radius / distance).asin()
    }
}

/// Largest angle between the view axis and the rays through the image border.
fn widest_angle(camera: &Camera) -> f64 {
    let (w, h) = (f64::from(camera.width), f64::from(camera.height));
    let border = (0..=8).flat_map(|i| {
        let t = f64::from(i) / 8.0;
        [[t * w, 0.0], [t * w, h], [0.0, t * h], [w, t * h]]
    });
    border
        .map(|pixel| match camera.unproject(pixel) {
            Some(ray) => ray.angle(&Vector3::z()),
            // The lens model does not reach the border: anything in front may be in the photo.
            None => std::f64::consts::FRAC_PI_2,
        })
        .fold(0.0, f64::max)
}
