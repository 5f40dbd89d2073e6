//! The transfer, step by step.

use super::assign::assign;
use super::atoms::gather_atoms;
use super::depth::SplatDepth;
use super::election::Election;
use super::frustum::Cone;
use super::islands::{Occupancy, Removal};
use super::majority::{Decision, decide};
use super::overlap::Overlaps;
use super::run_labels::RunLabels;
use super::surface_cells::SurfaceCells;
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
use std::ops::Range;

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
    let prepared = PreparedTransfer::new(tiles, views, mask, params, progress)?;
    let occupancy = prepared.label(tiles, 0..tiles.tile_count(), store, progress)?;
    finish_transfer(
        tiles,
        views,
        &prepared.election,
        occupancy,
        store,
        params,
        progress,
    )
}

/// The photos after all passes but the last, ready to label any tile.
///
/// [`transfer_labels`] in pieces: [`Self::new`] once, [`Self::label`] for ranges of tiles, and
/// [`finish_transfer`] once all tiles are labelled. Between these, [`Self::election`] and the depth maps and
/// surfaces can be kept as bytes; results are the same to the last bit.
pub struct PreparedTransfer<'a> {
    observer: Observer<'a>,
    election: Election,
    params: &'a TransferParams,
}

/// How the parts of a [`PreparedTransfer`] that were kept are read.
pub trait KeptParts {
    /// Why they cannot be read.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Bytes of the depth map of a photo, by its position among those with a mask.
    ///
    /// # Errors
    /// They cannot be read.
    fn depth(&self, photo: usize) -> Result<Vec<u8>, Self::Error>;
    /// Bytes of the surface of a tile.
    ///
    /// # Errors
    /// They cannot be read.
    fn surface(&self, tile: usize) -> Result<Vec<u8>, Self::Error>;
}

impl<'a> PreparedTransfer<'a> {
    /// Goes through the cloud for depth maps and for the overlaps of instances, and decides about these.
    /// Arguments as of [`transfer_labels`].
    ///
    /// # Errors
    /// As [`transfer_labels`].
    pub fn new<T, E>(
        tiles: &T,
        views: &'a [View],
        mask: impl FnMut(ImageId) -> Result<Option<LabelImage>, E>,
        params: &'a TransferParams,
        progress: &dyn Progress,
    ) -> Result<Self, TransferError>
    where
        T: TileSource,
        E: std::error::Error + Send + Sync + 'static,
    {
        params.check()?;
        let masked = load_masks(views, mask, progress)?;
        let of_view: BTreeMap<ImageId, u32> = views.iter().map(|v| v.image).zip(0..).collect();
        let positions = masked.iter().filter_map(|(view, _)| of_view.get(&view.image));
        let positions = positions.copied().collect();
        let observer = Observer::new(tiles, masked, params, progress)?;
        let atoms = gather_atoms(tiles, &observer, params.sample_m, progress)?;
        let overlaps = Overlaps::of(&atoms);
        let pairs = assign(&overlaps, params.min_iou);
        let groups = group(&overlaps, &pairs, params.min_iou);
        let (electorate, decisions) = decide(&overlaps, &groups, &atoms, params);
        let ballots = electorate.ballots().to_vec();
        let election = Election {
            masked: positions,
            ballots,
            decisions,
            spacing_m: observer.spacing_m(),
            overlaps,
        };

        Ok(Self {
            observer,
            election,
            params,
        })
    }

    /// Restores the transfer for some tiles from what was kept; only photos that may show them are read.
    ///
    /// # Errors
    /// A mask that fails; what was kept cannot be read, or is damaged.
    pub fn restore<T, K, E>(
        tiles: &T,
        range: &Range<usize>,
        views: &'a [View],
        election: Election,
        kept: &K,
        mut mask: impl FnMut(ImageId) -> Result<Option<LabelImage>, E>,
        params: &'a TransferParams,
    ) -> Result<Self, TransferError>
    where
        T: TileSource,
        K: KeptParts,
        E: std::error::Error + Send + Sync + 'static,
    {
        let views = election.views(views)?;
        let (mut labels, mut depths) = (Vec::new(), Vec::new());
        for (photo, view) in views.iter().enumerate() {
            let cone = Cone::of(view);
            if !range.clone().any(|tile| cone.touches(&tiles.bounds(tile))) {
                labels.push(RunLabels::none());
                depths.push(SplatDepth::none());
                continue;
            }
            let of_photo = |source| TransferError::Mask {
                photo: view.name.clone(),
                source,
            };
            let image = mask(view.image).map_err(|e| of_photo(Box::new(e)))?;
            labels.push(RunLabels::new(&image.ok_or(TransferError::Damaged)?));
            let depth = kept.depth(photo).map_err(|e| of_photo(Box::new(e)))?;
            depths.push(SplatDepth::decode(&depth)?);
        }

        let surface = |tile| {
            let bytes = kept.surface(tile).map_err(|e| TransferError::tile(tile, e))?;
            SurfaceCells::decode(&bytes)
        };
        let surfaces = range.clone().map(surface).collect::<Result<_, _>>()?;
        Ok(Self {
            observer: Observer::of(views, labels, depths, (surfaces, range.start), params),
            election,
            params,
        })
    }

    /// What was decided.
    pub fn election(&self) -> &Election {
        &self.election
    }

    /// Number of photos that have masks.
    pub fn photo_count(&self) -> usize {
        self.observer.views().len()
    }

    /// Bytes of the depth map of a photo, by its position among those with a mask.
    pub fn depth(&self, photo: usize) -> Option<Vec<u8>> {
        self.observer.depth(photo).map(SplatDepth::encode)
    }

    /// Bytes of the surface of a tile.
    pub fn surface(&self, tile: usize) -> Option<Vec<u8>> {
        self.observer.surface(tile).map(SurfaceCells::encode)
    }

    /// Labels some tiles; where the stones are in them.
    ///
    /// # Errors
    /// A tile or label store that fails, interruption.
    pub fn label<T: TileSource, S: LabelStore>(
        &self,
        tiles: &T,
        range: Range<usize>,
        store: &mut S,
        progress: &dyn Progress,
    ) -> Result<Occupancy, TransferError> {
        let electorate = self.election.electorate(self.params.border_weight);
        let names = Names::of(&electorate, &self.election.overlaps, self.observer.views());
        let link_m = self.params.island_link_m.max(3.0 * self.election.spacing_m);
        let mut occupancy = Occupancy::new(link_m);
        let load = |tile| tiles.load(tile).map_err(|e| TransferError::tile(tile, e));
        progress.each_prepared("labels", range, load, |tile, cloud| {
            let candidates = self.observer.candidates(&tiles.bounds(tile));
            let labels = label_tile(tile, &cloud, &self.observer, &candidates, &electorate, &names);
            let labelled = labels.stone.iter().enumerate().filter(|s| *s.1 != 0);
            occupancy.add_all(labelled.map(|(i, &stone)| (stone, cloud.world(i))));
            store
                .write(tile, &labels)
                .map_err(|e| TransferError::labels(tile, e))
        })?;
        Ok(occupancy)
    }
}

/// Takes islands and small stones away once all tiles are labelled; `occupancy`: where the stones are in all
/// of them.
///
/// # Errors
/// A tile or label store that fails, interruption.
pub fn finish_transfer<T: TileSource, S: LabelStore>(
    tiles: &T,
    views: &[View],
    election: &Election,
    occupancy: Occupancy,
    store: &mut S,
    params: &TransferParams,
    progress: &dyn Progress,
) -> Result<Transfer, TransferError> {
    let electorate = election.electorate(params.border_weight);
    let names = Names::of(&electorate, &election.overlaps, &election.views(views)?);
    let removal = occupancy.removal(params);
    remove(tiles, &removal, store, progress)?;
    let mut audit = names.decisions(&election.decisions);
    let stones = names.stones(&electorate, &removal);
    audit.extend(names.removals(&electorate, &removal));
    Ok(Transfer {
        stones,
        audit,
        photos: photo_votes(views, election),
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

fn photo_votes(views: &[View], election: &Election) -> Vec<PhotoVotes> {
    let position: BTreeMap<u32, u32> = election.masked.iter().copied().zip(0..).collect();
    (0..)
        .zip(views)
        .map(|(i, view)| {
            let masked = position.get(&i);
            let instances = election
                .overlaps
                .instances
                .iter()
                .filter(|i| masked == Some(&i.photo))
                .count();
            PhotoVotes {
                photo: view.image,
                masked: masked.is_some(),
                instances: instances as u32,
            }
        })
        .collect()
}
