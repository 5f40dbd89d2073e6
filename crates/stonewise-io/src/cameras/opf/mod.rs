//! Projects of the Open Photogrammetry Format (OPF), as PIX4Dmatic and other programs of Pix4D export them.
//!
//! `project.opf` names the files that hold the parts: photos, sensors, poses, and the frame of the scene (Pix4D,
//! "OPF specification" 1.0).

mod frame;
mod parts;
mod project;
mod read;
mod uri;

pub use read::read;
