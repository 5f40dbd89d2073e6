//! Rigid motions, cameras, views and local frames.

mod bounds;
mod brown;
mod camera;
mod cell;
mod contour;
mod distortion;
mod face_frame;
mod outline;
mod plane;
mod rotation;
mod triangulate;
mod view;

pub use bounds::Bounds;
pub use brown::Brown;
pub use camera::Camera;
pub use cell::cell_of;
pub use distortion::Distortion;
pub use face_frame::FaceFrame;
pub use outline::{OutlineParams, face_outline, is_simple, outline, signed_area};
pub use plane::Plane;
pub use rotation::nearest_rotation;
pub use triangulate::triangulate;
pub use view::{Projection, View};

/// A rigid motion in metres: `p_b = b_from_a * p_a`.
pub type Rigid3 = nalgebra::Isometry3<f64>;
