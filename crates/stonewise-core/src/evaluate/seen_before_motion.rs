//! Photos of a survey whose points a self-check moved.

use super::motion_field::MotionField;
use crate::geometry::View;
use crate::registration::photos::PhotoCamera;
use nalgebra::Point3;

/// Rounds of the fixed point that undoes a motion: a motion changes by a tenth of itself at most over its own
/// length, so that each round gains a digit.
const ROUNDS: usize = 8;

/// A camera that sees moved points where they were when the photo was taken.
pub struct SeenBeforeMotion {
    view: View,
    field: MotionField,
}

impl SeenBeforeMotion {
    /// A photo, and the motion that its epoch's points made after it.
    pub fn new(view: View, field: MotionField) -> Self {
        Self { view, field }
    }

    /// Where a moved point was.
    fn before(&self, moved: &Point3<f64>) -> Point3<f64> {
        (0..ROUNDS).fold(*moved, |at, _| moved - self.field.displacement_at(&at))
    }
}

impl PhotoCamera for SeenBeforeMotion {
    fn project(&self, world: &Point3<f64>) -> Option<[f64; 2]> {
        self.view.project(&self.before(world)).map(|p| p.pixel)
    }

    fn centre(&self) -> Point3<f64> {
        self.view.centre()
    }

    fn height_px(&self) -> f64 {
        self.view.height_px()
    }
}
