//! Where masks are complete.

use super::MaskError;
use super::json_text::read_json_text;
use crate::photo_name::{Fit, PhotoName};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_core::raster::{Raster, fill_polygon};

/// For each photo, the regions inside which every stone has a mask; elsewhere stones without one are common.
///
/// A JSON file with an object for each photo name: `width`, `height` and `valid`, a list of regions. A region
/// has an `outer` polygon and `holes`, each polygon a flat list x, y, x, y, ... in pixels. Other keys are
/// left alone.
#[derive(Clone, Debug)]
pub struct ValidRegions {
    path: PathBuf,
    photos: BTreeMap<String, RawPhoto>,
}

#[derive(Clone, Debug, Deserialize)]
struct RawPhoto {
    width: u32,
    height: u32,
    valid: Vec<RawRegion>,
}

#[derive(Clone, Debug, Deserialize)]
struct RawRegion {
    outer: Vec<f64>,
    #[serde(default)]
    holes: Vec<Vec<f64>>,
}

impl ValidRegions {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read or is something else.
    pub fn open(path: &Path) -> Result<Self, MaskError> {
        let text = read_json_text(path)?;
        let photos = serde_json::from_str(&text).map_err(|e| MaskError::Regions {
            path: path.to_owned(),
            problem: e.to_string(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            photos,
        })
    }

    /// True where the masks of a photo of this size are not complete; `None` where the file does not name the
    /// photo.
    ///
    /// # Errors
    /// The regions were drawn in a photo of another size, or two entries fit the name equally well.
    pub fn outside(
        &self,
        photo_name: &str,
        width: u32,
        height: u32,
    ) -> Result<Option<Raster<bool>>, MaskError> {
        let Some((name, photo)) = self.find(photo_name)? else {
            return Ok(None);
        };
        MaskError::check_size(&self.path, name, (photo.width, photo.height), (width, height))?;
        let mut outside = Raster::filled(width, height, true);
        for region in &photo.valid {
            let rings: Vec<Vec<[f64; 2]>> = std::iter::once(&region.outer)
                .chain(&region.holes)
                .map(|ring| ring.as_chunks().0.to_vec())
                .collect();
            fill_polygon(&rings, width, height, |y, begin, end| {
                let row = y as usize * width as usize;
                outside.data_mut()[row + begin as usize..row + end as usize].fill(false);
            });
        }
        Ok(Some(outside))
    }

    /// The one photo that fits a name best.
    fn find(&self, photo_name: &str) -> Result<Option<(&String, &RawPhoto)>, MaskError> {
        let wanted = PhotoName::new(photo_name);
        let fit = |name: &String| wanted.fit(&PhotoName::new(name));
        let best: Option<Fit> = self.photos.keys().filter_map(fit).max();
        let mut fitting = self
            .photos
            .iter()
            .filter(|(name, _)| best.is_some() && fit(name) == best);
        match (fitting.next(), fitting.next()) {
            (Some(first), Some(second)) => Err(MaskError::Ambiguous {
                path: self.path.clone(),
                photo: photo_name.to_owned(),
                first: first.0.clone(),
                second: second.0.clone(),
            }),
            (first, _) => Ok(first),
        }
    }
}
