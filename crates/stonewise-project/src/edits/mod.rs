//! Corrections by hand: the file that holds them, and how QGIS and editors of COCO files write it.

mod edits_file;
mod from_coco;
mod from_layer;
mod import;
mod lines;
mod photo_name;
mod signed;

pub use edits_file::{Action, Edit, EditsFile};
pub use import::{Imported, import};
pub use photo_name::photo_named;
pub use signed::Signed;
