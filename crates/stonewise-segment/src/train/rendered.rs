//! Rendered photos as training images.

use super::source::SampleSource;
use crate::Sample;
use crate::seed::mix;
use crate::synth::masonry_photo;

/// Masonry photos without end, rendered when they are needed.
#[derive(Clone, Copy, Debug)]
pub struct Rendered {
    /// Another seed renders other photos.
    pub seed: u64,
    /// Edge of the photos, pixels.
    pub size_px: u32,
}

impl SampleSource for Rendered {
    fn sample(&self, number: u64) -> Result<Sample, String> {
        Ok(masonry_photo(mix(self.seed, number), self.size_px, self.size_px))
    }
}

impl Rendered {
    /// Photos of another stream of seeds, to measure on.
    pub fn validation(&self, count: u64) -> Vec<Sample> {
        let seed = mix(!self.seed, 0);
        (0..count)
            .map(|number| masonry_photo(mix(seed, number), self.size_px, self.size_px))
            .collect()
    }
}
