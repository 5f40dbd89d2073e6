//! The photos of a lesson, as a detector learns from them.

use super::lesson::{Lesson, LessonPhoto, OPEN};
use std::collections::BTreeSet;
use stonewise_core::progress::Silent;
use stonewise_core::raster::Raster;
use stonewise_core::transfer::{TransferParams, photo_relief};
use stonewise_io::image_io::read_rgb;
use stonewise_io::masks::read_label_png;
use stonewise_segment::Sample;
use stonewise_segment::dataset::{DatasetError, PhotoSet};

/// Photos with the masks of a lesson, and with relief for a detector that takes it.
pub struct SurveyPhotos<'a> {
    lesson: &'a Lesson,
    /// Which of its photos.
    photos: Vec<usize>,
    relief: bool,
    params: &'a TransferParams,
}

impl<'a> SurveyPhotos<'a> {
    /// Some photos of a lesson. `params`: how the cloud is seen by them.
    pub fn new(lesson: &'a Lesson, photos: Vec<usize>, relief: bool, params: &'a TransferParams) -> Self {
        Self {
            lesson,
            photos,
            relief,
            params,
        }
    }

    fn photo(&self, index: usize) -> &LessonPhoto {
        &self.lesson.photos[self.photos[index]]
    }
}

impl PhotoSet for SurveyPhotos<'_> {
    fn count(&self) -> usize {
        self.photos.len()
    }

    fn sample(&self, index: usize) -> Result<Sample, DatasetError> {
        let photo = self.photo(index);
        let image = read_rgb(&photo.path)?;
        let mut labels = read_label_png(&photo.image)?;
        let mut ignore = Raster::filled(labels.width(), labels.height(), false);
        for (label, ignored) in labels.data_mut().iter_mut().zip(ignore.data_mut()) {
            *ignored = *label == OPEN;
            let place = (*label as usize).checked_sub(1);
            *label = place.and_then(|p| photo.stones.get(p)).copied().unwrap_or(0);
        }
        let relief = match self.relief {
            true => {
                let tiles = &photo.epoch.ingested.tiles.surveyed;
                let relief = photo_relief(tiles, &photo.view, self.params, &Silent);
                Some(relief.map_err(|e| DatasetError::Other(e.into()))?)
            }
            false => None,
        };
        Ok(Sample::new(image, labels, ignore)?.with_relief(relief))
    }

    fn kept_stones(&self, index: usize) -> Option<BTreeSet<u32>> {
        let labels = self.photo(index).stones.iter().copied();
        Some(labels.filter(|label| self.lesson.kept.contains(label)).collect())
    }
}
