//! Training images from labelled photos.

use super::error::DatasetError;
use super::photo_set::PhotoSet;
use super::split::Split;
use crate::Sample;
use crate::augment::{AugmentParams, CropView, Photo, recolour};
use crate::seed::mix;
use crate::train::SampleSource;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Share of the stones that is measured on and not learnt from (the paper's split).
const VALIDATION_SHARE: f64 = 0.1;
/// Size at which a stone of typical size is shown in the images that are measured on, pixels.
const VALIDATION_STONE_PX: f64 = 60.0;
/// Images that are measured on, at most.
const VALIDATION_IMAGES: usize = 32;
/// Photos in memory at a time, about nine bytes a pixel each.
const PHOTOS_IN_MEMORY: u64 = 6;
/// Crops that are taken from a photo before it makes room for another.
const CROPS_PER_VISIT: u64 = 64;
/// Tries to find a place about which something is known.
const TRIES: usize = 40;

/// Crops of labelled photos, each seen from elsewhere in other light.
pub struct PhotoCrops<'a> {
    photos: &'a dyn PhotoSet,
    params: AugmentParams,
    size_px: u32,
    seed: u64,
    in_memory: Mutex<VecDeque<(usize, Arc<Photo>)>>,
}

impl<'a> PhotoCrops<'a> {
    /// Crops of `size_px` pixels.
    pub fn new(photos: &'a dyn PhotoSet, params: AugmentParams, size_px: u32, seed: u64) -> Self {
        Self {
            photos,
            params,
            size_px,
            seed,
            in_memory: Mutex::default(),
        }
    }

    /// Crops of the blocks that are kept for measuring, as they are; the same for the same seed.
    ///
    /// # Errors
    /// A photo or its masks cannot be read.
    pub fn validation(&self) -> Result<Vec<Sample>, DatasetError> {
        let mut crops: Vec<(u64, Sample)> = Vec::new();
        for index in 0..self.photos.count() {
            let photo = Photo::new(self.photos.sample(index)?);
            let split = self.split(&photo, index);
            let side = self.block_px(&photo);
            let measured = Photo::new(split.for_validation(photo.sample()));
            for (number, corner) in split.kept_blocks().enumerate() {
                let view = CropView::straight(corner.map(f64::from), f64::from(side), self.size_px);
                let rank = mix(self.seed, (index as u64) << 32 | number as u64);
                crops.push((rank, view.cut(&measured)));
            }
        }
        crops.sort_by_key(|crop| crop.0);
        Ok(crops
            .into_iter()
            .take(VALIDATION_IMAGES)
            .map(|crop| crop.1)
            .collect())
    }

    /// Edge of a block, pixels of the photo: what an image shows that is measured on.
    fn block_px(&self, photo: &Photo) -> u32 {
        let sides = [photo.sample().image().width(), photo.sample().image().height()];
        let side = f64::from(self.size_px) * photo.stone_px() / VALIDATION_STONE_PX;
        (side.round() as u32).clamp(1, sides[0].min(sides[1]).max(1))
    }

    fn split(&self, photo: &Photo, index: usize) -> Split {
        let (sample, block_px) = (photo.sample(), self.block_px(photo));
        match self.photos.kept_stones(index) {
            Some(stones) => Split::of_stones(sample, block_px, &stones),
            None => Split::new(sample, block_px, VALIDATION_SHARE, mix(self.seed, index as u64)),
        }
    }

    /// Which photo a crop is taken from: a few at a time, so that each is read from disk once for many crops.
    fn photo_of(&self, number: u64) -> usize {
        let (visit, slot) = (
            number / (PHOTOS_IN_MEMORY * CROPS_PER_VISIT),
            number % PHOTOS_IN_MEMORY,
        );
        ((visit * PHOTOS_IN_MEMORY + slot) % self.photos.count() as u64) as usize
    }

    fn photo(&self, index: usize) -> Result<Arc<Photo>, DatasetError> {
        let mut all = self.in_memory.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, photo)) = all.iter().find(|(i, _)| *i == index) {
            return Ok(Arc::clone(photo));
        }
        let photo = Photo::new(self.photos.sample(index)?);
        let learnt = Photo::new(self.split(&photo, index).for_training(photo.sample()));
        let learnt = Arc::new(learnt);
        if all.len() as u64 >= PHOTOS_IN_MEMORY {
            all.pop_front();
        }
        all.push_back((index, Arc::clone(&learnt)));
        Ok(learnt)
    }
}

impl SampleSource for PhotoCrops<'_> {
    fn sample(&self, number: u64) -> Result<Sample, String> {
        let photo = self.photo(self.photo_of(number)).map_err(|e| e.to_string())?;
        let mut rng = ChaCha8Rng::seed_from_u64(mix(self.seed, number));
        let centre = known_place(&photo, &mut rng);
        let crop = CropView::random(&photo, centre, self.size_px, &self.params, &mut rng).cut(&photo);
        let image = recolour(crop.image(), &self.params, &mut rng);
        let (labels, ignore) = (crop.labels().clone(), crop.ignore().clone());
        let relief = crop.relief().cloned();
        let sample = Sample::new(image, labels, ignore).map_err(|e| e.to_string())?;
        Ok(sample.with_relief(relief))
    }
}

/// A place by chance about which something is known; any place where none was met.
fn known_place(photo: &Photo, rng: &mut ChaCha8Rng) -> [f64; 2] {
    let image = photo.sample().image();
    let size = [image.width(), image.height()].map(f64::from);
    let mut place = [0.0; 2];
    for _ in 0..TRIES {
        place = size.map(|s| s * rng.random::<f64>());
        if !photo.label(place).1 {
            break;
        }
    }
    place
}
