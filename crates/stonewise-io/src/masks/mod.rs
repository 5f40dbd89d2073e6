//! Stone masks from files: COCO json, or a folder of label PNGs.

mod coco;
mod coco_write;
mod error;
mod label_png;
mod valid_regions;

pub use coco::{CocoMasks, ListedPhoto};
pub use coco_write::{CocoFile, CocoPhoto, write_coco};
pub use error::MaskError;
pub use label_png::{LabelFolder, read_label_png, write_label_png};
pub use valid_regions::ValidRegions;

use std::path::Path;
use stonewise_core::raster::LabelImage;

/// Masks of the photos of one or more epochs.
#[derive(Clone, Debug)]
pub enum MaskSource {
    /// A COCO instances file.
    Coco(CocoMasks),
    /// A folder of label PNGs.
    Folder(LabelFolder),
}

/// The instances of one photo.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledPhoto {
    /// Instance of every pixel, 0 where there is none.
    pub labels: LabelImage,
    /// What is known of each label that occurs, in rising order of id.
    pub instances: Vec<InstanceInfo>,
    /// Masks that were left out, and why.
    pub warnings: Vec<String>,
}

/// What a mask file says about an instance besides its pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct InstanceInfo {
    /// Label in the image; never 0.
    pub id: u32,
    /// How sure the segmentation was, 0 to 1; 1 where the file does not say.
    pub score: f64,
    /// The true stone where the file knows it (extra key `stone_id`); for evaluation only.
    pub stone_ref: Option<u64>,
}

impl MaskSource {
    /// Opens a .json file or a folder.
    ///
    /// # Errors
    /// It cannot be read, is neither, or holds no photo's masks.
    pub fn open(path: &Path) -> Result<Self, MaskError> {
        if path.is_dir() {
            Ok(Self::Folder(LabelFolder::open(path)?))
        } else {
            Ok(Self::Coco(CocoMasks::open(path)?))
        }
    }

    /// The labels of a photo of this size; `None` where the source has nothing about it.
    ///
    /// `photo_name`: best with the folders it lies in, which tell apart photos of the same name; upper and
    /// lower case and a missing extension do not matter. Of several fitting entries the one with more of the
    /// folders wins.
    ///
    /// # Errors
    /// The masks are broken or made for another image size, or two entries fit equally well.
    pub fn labels_for(
        &self,
        photo_name: &str,
        width: u32,
        height: u32,
    ) -> Result<Option<LabelledPhoto>, MaskError> {
        match self {
            Self::Coco(coco) => coco.labels_for(photo_name, width, height),
            Self::Folder(folder) => folder.labels_for(photo_name, width, height),
        }
    }
}
