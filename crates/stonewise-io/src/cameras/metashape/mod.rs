//! Agisoft Metashape's camera XML.
//!
//! A chunk holds sensors, cameras with camera-to-chunk matrices, and the chunk's transform to the world
//! (rotation, translation, scale), which newer versions write in the component that a camera belongs to.
//! Camera model: Metashape Professional user manual, appendix "Camera models".

mod frame;
mod numbers;
mod read;
mod sensor;
mod write;

pub use read::read;
pub use write::write_metashape;
