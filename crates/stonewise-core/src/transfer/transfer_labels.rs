//! The transfer, step by step.

use super::assign::assign;
use super::atoms::gather_atoms;
use super::islands::{Occupancy, Removal};
use super::majority::{Decision, decide};
use super::overlap::Overlaps;
use super::run_labels::RunLabels;
use super::tracks::group;
use super::visibility::Observer;
use super::vote::{Ballot, Electorate};
use super::{AuditEvent, LabelStore, TileLabels, TransferError, TransferParams};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{Bounds, View};
use crate::id::{ImageId, InstanceId, StoneId};
use crate::params::Params;
use crate::progress::Progress;
use crate::raster::LabelImage;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The instances that make up a stone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoneInstances {
    /// The stone.
    pub stone: StoneId,
    /// Photo and instance, ascending; a photo may show a stone in several pieces.
    pub instances: Vec<(ImageId, InstanceId)>,
}

/// How much a photo had to say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotoVotes {
    /// The photo.
    pub photo: ImageId,
    /// Whether it has a mask.
    pub masked: bool,
    /// Instances that cover points of the cloud.
    pub instances: u32,
}

/// What became of the instances of all photos.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transfer {
    /// The stones that have labelled points, ascending.
    pub stones: Vec<StoneInstances>,
    /// Every decision of the majority.
    pub audit: Vec<AuditEvent>,
    /// One entry a view, in their order.
    pub photos: Vec<PhotoVotes>,
}

/// Labels every point of a cloud by the masks of the photos that see it, and writes the labels tile by tile.
///
/// `mask` gives the instances of a photo at the size its camera states; a photo without a mask does not vote.
/// It is called once for each view, in order, and only one mask is held uncompressed. `store` has labels for
/// every tile afterwards.
///
/// Method: visibility by splatted depth maps; one-to-one assignment on intersection over union between each
/// two photos (Kuhn 1955), counted on evenly thinned points that both see; groups by agreement of all their
/// photos; merged and fragmented instances by the majority; each point by a vote weighted with ground
/// sampling distance and incidence.
///
/// Cost: four passes over the tiles; each point is projected into the photos whose cone touches its surface
/// cell.
///
/// # Errors
/// A tile, mask or label store that fails, a mask of the wrong size, no mask at all, interruption.
pub fn transfer_labels<T, E, S>(
    tiles: &T,
    views: &[View],
    mask: impl FnMut(ImageId) -> Result<Option<LabelImage>, E>,
    store: &mut S,
    params: &TransferParams,
    progress: &dyn Progress,
) -> Result<Transfer, TransferError>
where
    T: TileSource,
    E: std::error::Error + Send + Sync + 'static,
    S: LabelStore,
{
    params.check()?;
    let observer = Observer::new(tiles, load_masks(views, mask, progress)?, params, progress)?;
    let atoms = gather_atoms(tiles, &observer, params.sample_m, progress)?;
    let overlaps = Overlaps::of(&atoms);
    let pairs = assign(&overlaps, params.min_iou);
    let groups = group(&overlaps, &pairs, params.min_iou);
    let (electorate, decisions) = decide(&overlaps, &groups, &atoms, params);
    drop(atoms);

    let names = Names::of(&electorate, &overlaps, observer.views());
    let mut occupancy = Occupancy::new(params.island_link_m.max(3.0 * observer.spacing_m()));
    let load = |tile| tiles.load(tile).map_err(|e| TransferError::tile(tile, e));
    progress.each_prepared("labels", 0..tiles.tile_count(), load, |tile, cloud| {
        let candidates = observer.candidates(&tiles.bounds(tile));
        let labels = label_tile(tile, &cloud, &observer, &candidates, &electorate, &names);
        let labelled = labels.stone.iter().enumerate().filter(|s| *s.1 != 0);
        occupancy.add_all(labelled.map(|(i, &stone)| (stone, cloud.world(i))));
        store
            .write(tile, &labels)
            .map_err(|e| TransferError::labels(tile, e))
    })?;

    let removal = occupancy.removal(params);
    remove(tiles, &removal, store, progress)?;
    let mut audit = names.decisions(&decisions);
    audit.extend(names.removals(&electorate, &removal));
    Ok(Transfer {
        stones: names.stones(&electorate, &removal),
        audit,
        photos: photo_votes(views, observer.views(), &overlaps),
    })
}

fn load_masks<'a, E: std::error::Error + Send + Sync + 'static>(
    views: &'a [View],
    mut mask: impl FnMut(ImageId) -> Result<Option<LabelImage>, E>,
    progress: &dyn Progress,
) -> Result<Vec<(&'a View, RunLabels)>, TransferError> {
    let mut masked = Vec::new();
    progress.each("masks", views, |view| {
        let image = mask(view.image).map_err(|e| TransferError::Mask {
            photo: view.name.clone(),
            source: Box::new(e),
        })?;
        let Some(image) = image else { return Ok(()) };
        let found = [image.width(), image.height()];
        let expected = [view.camera.width, view.camera.height];
        if found != expected {
            return Err(TransferError::MaskSize {
                photo: view.name.clone(),
                mask: found,
                camera: expected,
            });
        }
        masked.push((view, RunLabels::new(&image)));
        Ok(())
    })?;
    if masked.is_empty() {
        return Err(TransferError::NoMasks { photos: views.len() });
    }
    Ok(masked)
}

fn label_tile(
    tile: usize,
    cloud: &Cloud,
    observer: &Observer,
    candidates: &[u32],
    electorate: &Electorate,
    names: &Names,
) -> TileLabels {
    let all: Vec<u32> = (0..cloud.len() as u32).collect();
    let verdicts = observer.sight_cells(
        tile,
        cloud,
        &all,
        candidates,
        |verdicts: &mut Vec<_>, i, found| {
            if let Some(verdict) = electorate.count(found) {
                let stone = verdict.stone.and_then(|s| names.id(s)).map_or(0, |id| id.0);
                verdicts.push((i as usize, stone, verdict.share as f32));
            }
        },
    );
    let mut labels = TileLabels {
        stone: vec![0; cloud.len()],
        confidence: vec![0.0; cloud.len()],
        seen: vec![false; cloud.len()],
    };
    for (i, stone, share) in verdicts.into_iter().flatten() {
        labels.stone[i] = stone;
        labels.confidence[i] = share;
        labels.seen[i] = true;
    }
    labels
}

/// Takes the label off islands and small stones, in the tiles that hold any.
fn remove<T: TileSource, S: LabelStore>(
    tiles: &T,
    removal: &Removal,
    store: &mut S,
    progress: &dyn Progress,
) -> Result<(), TransferError> {
    let side = removal.voxel_m();
    let boxes: Vec<Bounds> = removal
        .voxels
        .iter()
        .map(|(_, v)| {
            let min = Point3::from(v.map(|c| c as f64 * side));
            Bounds {
                min,
                max: min.map(|c| c + side),
            }
        })
        .collect();

    progress.each("islands", 0..tiles.tile_count(), |tile| {
        let bounds = tiles.bounds(tile);
        if !boxes.iter().any(|b| b.intersects(&bounds)) {
            return Ok(());
        }
        let cloud = tiles.load(tile).map_err(|e| TransferError::tile(tile, e))?;
        let mut labels = store.read(tile).map_err(|e| TransferError::labels(tile, e))?;
        for (i, stone) in labels.stone.iter_mut().enumerate() {
            if *stone != 0 && removal.takes(*stone, &cloud.world(i)) {
                *stone = 0;
            }
        }
        store
            .write(tile, &labels)
            .map_err(|e| TransferError::labels(tile, e))
    })
}

/// Outward names of stones, photos and instances.
struct Names {
    /// Number of each group that still has an instance of its own.
    stones: Vec<Option<StoneId>>,
    /// Photo and instance of each instance index.
    instances: Vec<(ImageId, InstanceId)>,
}

impl Names {
    fn of(electorate: &Electorate, overlaps: &Overlaps, views: &[&View]) -> Self {
        let mut stones: Vec<Option<StoneId>> = Vec::new();
        for ballot in electorate.ballots() {
            if let Ballot::One(stone) = ballot {
                stones.resize(stones.len().max(*stone as usize + 1), None);
                stones[*stone as usize] = Some(StoneId(0));
            }
        }
        for (id, name) in (1..).zip(stones.iter_mut().flatten()) {
            *name = StoneId(id);
        }
        let instances = overlaps
            .instances
            .iter()
            .map(|i| (views[i.photo as usize].image, InstanceId(i.label)))
            .collect();
        Self { stones, instances }
    }

    fn id(&self, stone: u32) -> Option<StoneId> {
        self.stones.get(stone as usize).copied().flatten()
    }

    fn decisions(&self, decisions: &BTreeMap<u32, Decision>) -> Vec<AuditEvent> {
        decisions
            .iter()
            .filter_map(|(&i, decision)| {
                let (photo, instance) = self.instances[i as usize];
                Some(match decision {
                    Decision::Merged(stones) => AuditEvent::SplitInstance {
                        photo,
                        instance,
                        stones: stones.iter().filter_map(|&s| self.id(s)).collect(),
                    },
                    Decision::Fragment(stone, share) => AuditEvent::JoinedFragment {
                        photo,
                        instance,
                        stone: self.id(*stone)?,
                        share: *share,
                    },
                    Decision::Outvoted(share) => AuditEvent::OutvotedInstance {
                        photo,
                        instance,
                        share: *share,
                    },
                })
            })
            .collect()
    }

    /// Instances of each stone that keeps points, ascending.
    fn stones(&self, electorate: &Electorate, removal: &Removal) -> Vec<StoneInstances> {
        self.members(electorate)
            .into_iter()
            .filter(|(stone, _)| removal.kept.contains(&stone.0))
            .map(|(stone, instances)| StoneInstances { stone, instances })
            .collect()
    }

    fn members(&self, electorate: &Electorate) -> BTreeMap<StoneId, Vec<(ImageId, InstanceId)>> {
        let mut members: BTreeMap<StoneId, Vec<_>> = BTreeMap::new();
        for (name, ballot) in self.instances.iter().zip(electorate.ballots()) {
            if let Ballot::One(stone) = ballot
                && let Some(id) = self.id(*stone)
            {
                members.entry(id).or_default().push(*name);
            }
        }
        members.values_mut().for_each(|m| m.sort_unstable());
        members
    }

    fn removals(&self, electorate: &Electorate, removal: &Removal) -> Vec<AuditEvent> {
        let members = self.members(electorate);
        let photos = |stone: u32| members.get(&StoneId(stone)).map_or(0, |m| count_photos(m));
        let islands = removal
            .islands
            .iter()
            .map(|(&stone, &(islands, points))| AuditEvent::DroppedIslands {
                stone: StoneId(stone),
                islands,
                points,
            });
        let stones = removal
            .stones
            .iter()
            .map(|(&stone, &points)| AuditEvent::DroppedStone {
                stone: StoneId(stone),
                points,
                photos: photos(stone),
            });
        islands.chain(stones).collect()
    }
}

/// Number of different photos among sorted instances.
pub(super) fn count_photos(instances: &[(ImageId, InstanceId)]) -> u32 {
    let mut photos: Vec<ImageId> = instances.iter().map(|i| i.0).collect();
    photos.dedup();
    photos.len() as u32
}

/// `masked`: the views that have masks, in the order of the overlaps' photos.
fn photo_votes(views: &[View], masked: &[&View], overlaps: &Overlaps) -> Vec<PhotoVotes> {
    let position: BTreeMap<ImageId, u32> = masked.iter().map(|view| view.image).zip(0..).collect();
    let votes = |view: &View| {
        let masked = position.get(&view.image);
        let instances = overlaps.instances.iter().filter(|i| masked == Some(&i.photo));
        PhotoVotes {
            photo: view.image,
            masked: masked.is_some(),
            instances: instances.count() as u32,
        }
    };
    views.iter().map(votes).collect()
}
