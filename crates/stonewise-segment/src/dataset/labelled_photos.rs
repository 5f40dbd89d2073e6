//! Photos of a folder and the masks of a COCO file.

use super::error::DatasetError;
use super::photo_set::PhotoSet;
use crate::Sample;
use std::path::{Path, PathBuf};
use stonewise_core::raster::{LabelImage, Raster};
use stonewise_io::image_io::{image_size, photos_in, read_rgb};
use stonewise_io::masks::{MaskError, MaskSource, ValidRegions};

/// Masks of photos, and where they are complete.
#[derive(Clone, Debug)]
pub struct Reference {
    masks: MaskSource,
    valid: Option<ValidRegions>,
}

/// Photos whose stones have masks. They stay on disk until they are read.
#[derive(Clone, Debug)]
pub struct LabelledPhotos {
    photos: Vec<PathBuf>,
    unlabelled: Vec<PathBuf>,
    reference: Reference,
}

impl Reference {
    /// Opens masks (COCO json or a folder of label PNGs) and, where they are not complete everywhere, a file
    /// of valid regions.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn open(masks: &Path, valid: Option<&Path>) -> Result<Self, MaskError> {
        Ok(Self {
            masks: MaskSource::open(masks)?,
            valid: valid.map(ValidRegions::open).transpose()?,
        })
    }

    /// The stones of a photo of this size, and true where they are not complete; `None` for a photo without
    /// masks.
    ///
    /// A photo that the file of valid regions does not name is complete nowhere.
    ///
    /// # Errors
    /// The masks are broken or made for another size.
    pub fn of_photo(
        &self,
        photo: &Path,
        width: u32,
        height: u32,
    ) -> Result<Option<(LabelImage, Raster<bool>)>, MaskError> {
        let name = photo.to_string_lossy();
        let Some(labelled) = self.masks.labels_for(&name, width, height)? else {
            return Ok(None);
        };
        let ignore = match &self.valid {
            None => Raster::filled(width, height, false),
            Some(valid) => valid
                .outside(&name, width, height)?
                .unwrap_or_else(|| Raster::filled(width, height, true)),
        };
        Ok(Some((labelled.labels, ignore)))
    }
}

impl LabelledPhotos {
    /// Finds the photos below a folder that have masks. `valid`: where the masks are complete; everywhere if
    /// absent.
    ///
    /// # Errors
    /// The folder or a file cannot be read, or no photo has masks.
    pub fn open(folder: &Path, masks: &Path, valid: Option<&Path>) -> Result<Self, DatasetError> {
        let reference = Reference::open(masks, valid)?;
        let all = photos_in(folder)?;
        let count = all.len();
        let (mut photos, mut unlabelled) = (Vec::new(), Vec::new());
        for photo in all {
            let (width, height) = image_size(&photo)?;
            match reference.of_photo(&photo, width, height)? {
                Some(_) => photos.push(photo),
                None => unlabelled.push(photo),
            }
        }
        if photos.is_empty() {
            return Err(DatasetError::NoneLabelled {
                photos: count,
                folder: folder.to_owned(),
                masks: masks.to_owned(),
            });
        }
        Ok(Self {
            photos,
            unlabelled,
            reference,
        })
    }

    /// The photos that have masks.
    pub fn photos(&self) -> &[PathBuf] {
        &self.photos
    }

    /// Photos of the folder without masks; they are left out.
    pub fn unlabelled(&self) -> &[PathBuf] {
        &self.unlabelled
    }

    /// A photo with its stones, see [`Reference::of_photo`].
    ///
    /// # Errors
    /// The photo or its masks cannot be read.
    pub fn read(&self, photo: &Path) -> Result<Sample, DatasetError> {
        let image = read_rgb(photo)?;
        let (width, height) = (image.width(), image.height());
        let known = self.reference.of_photo(photo, width, height)?;
        let (labels, ignore) = known.unwrap_or_else(|| {
            (
                Raster::filled(width, height, 0),
                Raster::filled(width, height, true),
            )
        });
        Ok(Sample::new(image, labels, ignore)?)
    }
}

impl PhotoSet for LabelledPhotos {
    fn count(&self) -> usize {
        self.photos.len()
    }

    fn sample(&self, index: usize) -> Result<Sample, DatasetError> {
        self.read(&self.photos[index])
    }
}
