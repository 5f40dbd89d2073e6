//! The masks of a photo, and the stones of the cloud in it.

use crate::error::Result;
use crate::pipeline::{Labelled, Run, Segmented};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::id::{ImageId, StoneId};
use stonewise_core::raster::LabelImage;
use stonewise_core::transfer::{PhotoStones, photo_stones};

/// Least number of photos whose masks form a confirmed stone.
const LEAST_PHOTOS: usize = 2;
/// Least share of the votes on its points that agree.
const LEAST_CONFIDENCE: f64 = 0.75;
/// Overlap (intersection over union) from which a mask matches a stone.
const LEAST_OVERLAP: f64 = 0.7;
/// Fewest pixels of a stone that counts: the detector cannot find smaller ones either.
pub const LEAST_PIXELS: u64 = 100;
/// A stone within so many pixels of the border of a photo may be cut.
const MARGIN: u32 = 3;

/// The stones that photos agree on.
pub fn confirmed(labelled: &Labelled) -> BTreeSet<StoneId> {
    let sure = labelled
        .stones
        .iter()
        .filter(|s| s.confidence >= LEAST_CONFIDENCE);
    let sure: BTreeSet<StoneId> = sure.map(|s| s.id).collect();
    let stones = labelled.transfer.stones.iter();
    let in_photos = stones.filter(|s| {
        let photos: BTreeSet<ImageId> = s.instances.iter().map(|(photo, _)| *photo).collect();
        photos.len() >= LEAST_PHOTOS
    });
    in_photos.map(|s| s.stone).filter(|s| sure.contains(s)).collect()
}

/// The stone to which each instance of a photo belongs.
pub fn owners(labelled: &Labelled, photo: ImageId) -> BTreeMap<u32, StoneId> {
    let stones = labelled.transfer.stones.iter();
    let instances = stones.flat_map(|s| {
        s.instances
            .iter()
            .map(|(image, instance)| (image, instance.0, s.stone))
    });
    instances
        .filter(|(image, ..)| **image == photo)
        .map(|(_, instance, stone)| (instance, stone))
        .collect()
}

/// The stones of an epoch that are panels of doors and the like.
pub fn panels(run: &Run, epoch: EpochId, labelled: &Labelled) -> Result<BTreeSet<StoneId>> {
    let panels = run.panels_of(&format!("panels-{epoch}"), labelled)?;
    Ok(panels.into_iter().collect())
}

/// Whether a mask matches a stone: `both` pixels are common to them, of `stone` and `mask` pixels.
pub fn matches(both: u64, stone: u64, mask: u64) -> bool {
    both as f64 >= LEAST_OVERLAP * (stone + mask - both) as f64
}

/// The masks of a photo, and the stones of the cloud in it.
pub struct Sight {
    /// The masks of the detector.
    pub masks: LabelImage,
    /// The stones of the cloud.
    pub cloud: PhotoStones,
    /// The stone of each mask that belongs to one.
    pub owners: BTreeMap<u32, StoneId>,
}

/// Pixels of a stone in a photo, counted where the photo shows points of the cloud.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pixels {
    /// Pixels of the stone in the cloud.
    pub cloud: u64,
    /// Pixels of its masks.
    pub mask: u64,
    /// Pixels of both.
    pub both: u64,
    /// Pixels of the stone in the cloud, under the masks of others.
    pub foreign: u64,
    /// Whether the stone reaches the border of the photo.
    pub is_cut: bool,
}

impl Sight {
    /// A photo of an epoch; `None` where the detector did not look at it.
    pub fn of(run: &Run, labelled: &Labelled, segmented: &Segmented, view: &View) -> Result<Option<Self>> {
        let Some(masks) = segmented.labels(view.image)? else {
            return Ok(None);
        };
        let tiles = &labelled.ingested.tiles.surveyed;
        let labels = |tile| labelled.labels(tile);
        let params = &run.context.project.settings.label;
        Ok(Some(Self {
            masks,
            cloud: photo_stones(tiles, labels, view, params, run.context.progress)?,
            owners: owners(labelled, view.image),
        }))
    }

    /// The pixels of each stone.
    pub fn pixels(&self) -> BTreeMap<StoneId, Pixels> {
        let mut pixels: BTreeMap<StoneId, Pixels> = BTreeMap::new();
        let (width, height) = (self.masks.width(), self.masks.height());
        for index in (0..self.masks.data().len()).filter(|&i| self.cloud.known.data()[i]) {
            let (mask, owner) = self.mask(index);
            let seen = self.stone(index);
            if let Some(owner) = owner {
                pixels.entry(owner).or_default().mask += 1;
            }
            let Some(seen) = seen else { continue };
            let (x, y) = (index as u32 % width, index as u32 / width);
            let stone = pixels.entry(seen).or_default();
            stone.cloud += 1;
            stone.both += u64::from(owner == Some(seen));
            stone.foreign += u64::from(mask != 0 && owner != Some(seen));
            stone.is_cut |= x < MARGIN || y < MARGIN || x + MARGIN >= width || y + MARGIN >= height;
        }
        pixels
    }

    /// The instance of a pixel, and the stone to which it belongs.
    pub fn mask(&self, index: usize) -> (u32, Option<StoneId>) {
        let instance = self.masks.data()[index];
        (instance, self.owners.get(&instance).copied())
    }

    /// The stone that the cloud shows in a pixel.
    pub fn stone(&self, index: usize) -> Option<StoneId> {
        Some(self.cloud.stones.data()[index])
            .filter(|&stone| stone != 0)
            .map(StoneId)
    }
}
