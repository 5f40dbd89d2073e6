//! The project file: which surveys, and every parameter of every step.

mod project_file;
mod project_type;

pub use project_type::{Epoch, Project};
