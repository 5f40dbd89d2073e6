//! Rigid motions, cameras, views and local frames.

mod bounds;
mod brown;
mod camera;
mod cell;
mod contour;
mod distortion;
mod face_frame;
mod moments;
mod outline;
mod plane;
mod rigid;
mod ring;
mod ring_index;
mod rotation;
mod small_motion;
mod strain;
mod triangulate;
mod view;

pub use bounds::Bounds;
pub use brown::Brown;
pub use camera::{Camera, NearPlane};
pub use cell::{CellHasher, CellMap, CellSet, cell_of, cells_around, cells_between, floor};
pub use distortion::Distortion;
pub use face_frame::FaceFrame;
pub use moments::Moments;
pub use outline::{OutlineParams, convex_hull, face_outline, outline, outlines};
pub use plane::Plane;
pub use rigid::Rigid3;
pub use ring::{is_simple, ring_contains, signed_area, simplify_ring};
pub use ring_index::RingIndex;
pub use rotation::{nearest_rotation, rotation_of};
pub use small_motion::{DisplacementSample, SmallMotion, lever};
pub use strain::Strain;
pub use triangulate::triangulate;
pub use view::{Projection, View};
