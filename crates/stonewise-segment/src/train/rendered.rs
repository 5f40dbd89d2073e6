//! Rendered photos as training images.

use super::source::SampleSource;
use super::synth::{MasonryStyle, Survey, masonry_photo_of};
use crate::Sample;
use crate::seed::mix;

/// One photo in this many shows walls laid dry.
const DRY_EVERY: u64 = 4;
/// Number mixed into a photo's seed to decide whether it is one of them.
const DRY_STREAM: u64 = 1;

/// Masonry photos without end, rendered when they are needed.
#[derive(Clone, Copy, Debug)]
pub struct Rendered {
    /// Another seed renders other photos.
    pub seed: u64,
    /// Edge of the photos, pixels.
    pub size_px: u32,
    /// Whether photos have the relief that a cloud would give them; two in five have none even so.
    pub relief: bool,
}

impl SampleSource for Rendered {
    fn sample(&self, number: u64) -> Result<Sample, String> {
        Ok(self.photo(mix(self.seed, number)))
    }
}

impl Rendered {
    /// Photos of another stream of seeds, to measure on.
    pub fn validation(&self, count: u64) -> Vec<Sample> {
        let seed = mix(!self.seed, 0);
        (0..count).map(|number| self.photo(mix(seed, number))).collect()
    }

    fn photo(&self, seed: u64) -> Sample {
        let survey = self.relief.then(|| Survey::sometimes(seed)).flatten();
        let style = if mix(seed, DRY_STREAM).is_multiple_of(DRY_EVERY) {
            MasonryStyle::dry
        } else {
            MasonryStyle::random
        };
        let size = self.size_px;
        masonry_photo_of(&style(seed, size, size), survey.as_ref(), seed, size, size)
    }
}
