//! What the report shows of the survey itself: photo crops, sections, stones tracked in photos,
//! thinned clouds, cameras.
//!
//! A run writes these small excerpts into `DIR/evidence`, so that a report can be made again without the
//! survey. Files are Parquet tables and JPEG pictures; numbers in their names are those of epochs, from 1.

mod atlas;
mod cameras;
mod cloud;
mod crops;
mod files;
mod logo;
mod sections;
mod tracks;

pub use cameras::{PosedPhoto, write_cameras};
pub use cloud::{ThinPoint, write_thin_cloud};
pub use crops::{Crop, crop_side_px, write_crops};
pub(super) use files::read_table;
pub use logo::{Logo, write_logo};
pub use sections::{Cut, SectionPoint, write_sections};
pub use tracks::{Tracks, most_pictured, track_side_px, write_tracks};

use crate::names::PROFILE;
use crops::StoredCrops;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_base::profile::Profile;
use tracks::StoredTracks;

/// The excerpts of one pair of epochs; whatever is missing is empty.
#[derive(Clone, Debug, Default)]
pub struct Evidence {
    /// Photo crops of the first and of the later epoch.
    pub crops: [Option<StoredCrops>; 2],
    /// Points of both epochs near the middle of each stone.
    pub sections: Vec<SectionPoint>,
    /// What was tracked in photos.
    pub tracks: Option<StoredTracks>,
    /// Thinned clouds.
    pub clouds: [Vec<ThinPoint>; 2],
    /// Posed photos.
    pub cameras: [Vec<PosedPhoto>; 2],
    /// The picture of the first page.
    pub logo: Option<Logo>,
    /// The profile of the report, where it is a file of the user's.
    pub profile: Option<Profile>,
}

impl Evidence {
    /// Reads the excerpts of the first epoch and of epoch `later` in `dir`.
    ///
    /// # Errors
    /// A file is damaged.
    pub(super) fn read(dir: &Path, later: usize) -> Result<Self, Error> {
        let both = [1, later];
        let [first_crops, second_crops] = both.map(|e| crops::read_crops(dir, e));
        let [first_cloud, second_cloud] = both.map(|e| cloud::read_thin_cloud(dir, e));
        let [first_cameras, second_cameras] = both.map(|e| cameras::read_cameras(dir, e));
        Ok(Self {
            crops: [first_crops?, second_crops?],
            sections: sections::read_sections(dir, later)?,
            tracks: tracks::read_tracks(dir, later)?,
            clouds: [first_cloud?, second_cloud?],
            cameras: [first_cameras?, second_cameras?],
            logo: logo::read_logo(dir)?,
            profile: Profile::kept(&dir.join(PROFILE))?,
        })
    }
}
