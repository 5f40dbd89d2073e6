//! Masks of photos from either kind of file.

use super::{CocoMasks, LabelFolder, LabelledPhoto, MaskError};
use std::path::Path;

/// Masks of the photos of one or more epochs.
#[derive(Clone, Debug)]
pub enum MaskSource {
    /// A COCO instances file.
    Coco(CocoMasks),
    /// A folder of label PNGs.
    Folder(LabelFolder),
}

impl MaskSource {
    /// Opens a .json file or a folder.
    ///
    /// ```
    /// use stonewise_core::raster::LabelImage;
    /// use stonewise_io::masks::{MaskSource, write_label_png};
    /// # let folder = tempfile::tempdir()?;
    /// let labels = LabelImage::from_vec(3, 1, vec![0, 7, 7]).expect("as many labels as pixels");
    /// write_label_png(&folder.path().join("wall.png"), &labels)?;
    /// let masks = MaskSource::open(folder.path())?;
    /// let photo = masks.labels_for("wall.jpg", 3, 1)?.expect("the photo has masks");
    /// assert_eq!((photo.labels, photo.instances[0].id), (labels, 7));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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

    /// What of the source is not used, or not as it is marked, whatever the photo.
    pub fn remarks(&self) -> &[String] {
        match self {
            Self::Coco(coco) => coco.remarks(),
            Self::Folder(_) => &[],
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
