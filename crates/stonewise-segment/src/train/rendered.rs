//! Rendered photos as training images.

use super::source::SampleSource;
use crate::Sample;
use crate::seed::mix;
use crate::synth::{masonry_photo, surveyed_photo};

/// Masonry photos without end, rendered when they are needed.
#[derive(Clone, Copy, Debug)]
pub struct Rendered {
    /// Another seed renders other photos.
    pub seed: u64,
    /// Edge of the photos, pixels.
    pub size_px: u32,
    /// Photos with the relief that a cloud would give them; a third has none.
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
        let render = if self.relief {
            surveyed_photo
        } else {
            masonry_photo
        };
        render(seed, self.size_px, self.size_px)
    }
}
