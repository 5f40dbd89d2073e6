//! Corrections by hand: the file that holds them, and how QGIS and editors of COCO files write it.

mod edits_file;
mod from_coco;
mod from_layer;
mod import;
mod lines;
mod signed;

pub use edits_file::{Action, Edit, EditsFile};
pub use import::{Imported, import};
pub use signed::Signed;
