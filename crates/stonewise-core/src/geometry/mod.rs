//! Rigid motions, cameras, views and local frames.

mod bounds;
mod camera;
mod face_frame;
mod plane;
mod view;

pub use bounds::Bounds;
pub use camera::{Camera, Distortion};
pub use face_frame::FaceFrame;
pub use plane::Plane;
pub use view::View;

/// A rigid motion in metres: `p_b = b_from_a * p_a`.
pub type Rigid3 = nalgebra::Isometry3<f64>;
