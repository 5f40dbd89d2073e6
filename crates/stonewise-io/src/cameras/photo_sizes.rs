//! Sizes of photos, for camera files that do not tell them.

use super::photos::PhotoFolder;
use super::{CameraError, malformed};
use crate::image_io::image_size;
use std::path::Path;

/// The photos of a folder and their sizes.
pub struct PhotoSizes<'a> {
    camera_file: &'a Path,
    photos: PhotoFolder,
}

impl<'a> PhotoSizes<'a> {
    /// Looks for photos in a folder and below it.
    ///
    /// # Errors
    /// The folder cannot be read or holds no photo.
    pub fn below(folder: &Path, camera_file: &'a Path) -> Result<Self, CameraError> {
        let photos = PhotoFolder::open(folder)?;
        Ok(Self { camera_file, photos })
    }

    /// Width and height of each of these photos, pixels.
    ///
    /// A name without a readable photo gets the size of the first that has one: nothing will be projected into
    /// it.
    ///
    /// # Errors
    /// Two photos match one name equally well, or none of the names has a photo that can be read.
    pub fn of(&self, names: &[&str]) -> Result<Vec<[u32; 2]>, CameraError> {
        let mut sizes = Vec::with_capacity(names.len());
        for name in names {
            let photo = self.photos.find(name)?.map(|i| &self.photos.files[i]);
            sizes.push(photo.and_then(|path| image_size(path).ok()));
        }
        let Some((width, height)) = sizes.iter().flatten().next().copied() else {
            let problem = format!(
                "the file does not tell the sizes of the photos, and none of them can be read in {}: set images to their folder",
                self.photos.folder.display()
            );
            let place = format!("photo {}", names.first().unwrap_or(&"1"));
            return Err(malformed(self.camera_file, place, problem));
        };
        let sizes = sizes.into_iter().map(|size| size.unwrap_or((width, height)));
        Ok(sizes.map(|(width, height)| [width, height]).collect())
    }
}
