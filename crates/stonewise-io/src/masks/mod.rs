//! Stone masks from files: COCO json, or a folder of label PNGs.

mod coco;
mod coco_write;
mod error;
mod json_text;
mod label_png;
mod labelled_photo;
mod mask_source;
mod valid_regions;

pub use coco::{CocoMasks, ListedPhoto};
pub use coco_write::{CocoFile, CocoPhoto};
pub use error::MaskError;
pub use label_png::{LabelFolder, read_label_png, write_label_png};
pub use labelled_photo::{InstanceInfo, LabelledPhoto};
pub use mask_source::MaskSource;
pub use valid_regions::ValidRegions;
