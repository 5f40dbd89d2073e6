//! Stones that the reference does not show, measured from the first epoch that shows them.
//!
//! Each epoch is adjusted against the reference, and what that does not show has no motion there. Such stones are
//! followed through the later epochs (`core/matching/tracks.rs`), and those of one first epoch are adjusted against that
//! one, together with the stones around them, which tie them to the rest of the wall. The cost is that of the stones
//! concerned and of their neighbours, once for each epoch that shows them.

use crate::error::Result;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::outputs::stone_rows::{motion_in_common, stone_rows};
use crate::pipeline::outputs::time_order::in_time_order;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::r#match::Matched;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::steps::register::datum;
use crate::pipeline::until::Until;
use crate::results::records::EstimatorRecord;
use crate::results::{RowMotion, StoneRow};
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use stonewise_core::cloud::{GridIndex, TileSource};
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::{Bounds, DisplacementSample, SmallMotion};
use stonewise_core::id::StoneId;
use stonewise_core::matching::{LaterStones, MatchReport, Track, tracks};
use stonewise_core::stone::{MatchOutcome, Stone};

/// Follows and measures the stones that the reference does not show.
pub static TRACKS: Step = Step {
    name: "tracks",
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until >= Until::Registered,
    applies: |project, _| project.epochs.len() > 2,
    make: |run, _| run.tracked().map(drop),
    ..Step::PLAIN
};

/// Neighbours with which a stone is adjusted: rings of about three stones, and enough for a shape.
const NEIGHBOURS: usize = 40;
/// Half the box around a stone's middle in which an epoch has points if it shows the place, metres, and how many.
const AROUND_M: f64 = 0.05;
const LEAST_POINTS: usize = 10;

/// What became of the stones that the reference does not show.
pub struct Tracked {
    /// The stones.
    pub stones: Vec<TrackedStone>,
    /// The adjustments that measured them.
    pub pairs: Vec<TrackedPair>,
}

/// A stone that the reference does not show.
pub struct TrackedStone {
    /// The stone in the first epoch that shows it, with a number of its own.
    pub stone: Stone,
    /// That epoch.
    pub since: EpochId,
    /// Whether the reference shows its place without it.
    pub is_new: bool,
    /// Its number in each epoch.
    pub seen: BTreeMap<EpochId, StoneId>,
    /// Epochs after the first that do not show it, and whether they show its place.
    pub missed: BTreeMap<EpochId, bool>,
}

/// Stones since one epoch, in another.
pub struct TrackedPair {
    /// Both epochs.
    pub epochs: Pair<EpochId>,
    /// What the estimator says about itself.
    pub estimator: EstimatorRecord,
    /// A row for each of the stones, with its number among all.
    pub rows: Vec<StoneRow>,
    /// Deformation of each against its surroundings, with its place.
    deformed: BTreeMap<StoneId, Deformed>,
    /// The stones of the reference around them, likewise.
    around: BTreeMap<StoneId, Deformed>,
}

/// A deformation at a place, world, metres.
#[derive(Clone, Copy)]
struct Deformed {
    place: Point3<f64>,
    deformation: Vector3<f64>,
    covariance: Matrix3<f64>,
}

impl TrackedPair {
    /// The deformations of its stones in the frame of the whole wall. `known`: of a stone of the reference from the first
    /// epoch to the later one in that frame.
    ///
    /// The adjustment of a part of the wall gives deformations up to a rigid motion of that part. That motion is the
    /// best fit between its deformations of the stones around and those in the whole wall, and is added.
    pub fn deformations(
        &self,
        known: impl Fn(StoneId) -> Option<Vector3<f64>>,
    ) -> BTreeMap<StoneId, (Vector3<f64>, Matrix3<f64>)> {
        let sample = |(stone, own): (&StoneId, &Deformed)| {
            Some(DisplacementSample {
                place: own.place,
                displacement: known(*stone)? - own.deformation,
                covariance: own.covariance,
            })
        };
        let samples: Vec<DisplacementSample> = self.around.iter().filter_map(sample).collect();
        let Some(rigid) = SmallMotion::fit(&samples) else {
            return BTreeMap::new();
        };
        let whole = |own: &Deformed| {
            let deformation = own.deformation + rigid.at(&own.place);
            (deformation, own.covariance + rigid.covariance_at(&own.place))
        };
        let stones = self.deformed.iter();
        stones.map(|(stone, own)| (*stone, whole(own))).collect()
    }
}

impl Run<'_> {
    /// The stones that the reference does not show, with their motions.
    pub fn tracked(&self) -> Result<Arc<Tracked>> {
        self.once(&TRACKS, EpochId::REFERENCE, || {
            let mut later = in_time_order(self.context.project);
            later.retain(|id| !id.is_reference());
            let stones = followed(self, &later)?;
            let mut pairs = Vec::new();
            for (first, since) in later.iter().enumerate() {
                let group: Vec<&TrackedStone> = stones.iter().filter(|s| s.since == *since).collect();
                for id in later[first + 1..].iter().filter(|_| !group.is_empty()) {
                    pairs.extend(measured(self, Pair::new(*since, *id), &group)?);
                }
            }
            Ok(Tracked { stones, pairs })
        })
    }
}

/// The stones that the reference does not show and two later epochs do.
fn followed(run: &Run, later: &[EpochId]) -> Result<Vec<TrackedStone>> {
    let mut labelled = Vec::new();
    let mut known: Vec<BTreeSet<StoneId>> = Vec::new();
    for id in later {
        labelled.push(run.labelled(*id)?);
        known.push(run.matched(*id)?.pairs().iter().map(|p| p.1).collect());
    }

    let epochs: Vec<LaterStones> = { labelled.iter().zip(&known) }
        .map(|(l, known)| LaterStones {
            stones: &l.stones,
            known,
        })
        .collect();
    let first = run.labelled(EpochId::REFERENCE)?;
    let found = tracks(&first.stones, &epochs, &run.context.project.settings.r#match);
    let places =
        |of: &dyn Fn(&Track) -> bool| -> Vec<usize> { (0..found.len()).filter(|&i| of(&found[i])).collect() };
    let all = places(&|_| true);
    let mut stones: Vec<TrackedStone> = { found.iter().zip(shown(&first, &found, &all)?) }
        .map(|(track, is_new)| TrackedStone {
            stone: track.stone.clone(),
            since: later[track.first()],
            is_new,
            seen: { later.iter().zip(&track.seen) }
                .filter_map(|(id, stone)| Some((*id, (*stone)?)))
                .collect(),
            missed: BTreeMap::new(),
        })
        .collect();

    for (k, id) in later.iter().enumerate() {
        let missing = places(&|t| t.first() < k && t.seen[k].is_none());
        for (i, is_shown) in missing.iter().zip(shown(&labelled[k], &found, &missing)?) {
            stones[*i].missed.insert(*id, is_shown);
        }
    }

    Ok(stones)
}

/// Whether an epoch shows the places of these tracks. Cost: the tiles that hold them.
fn shown(labelled: &Labelled, found: &[Track], which: &[usize]) -> Result<Vec<bool>> {
    let boxes: Vec<Option<Bounds>> = which
        .iter()
        .map(|&i| Some(Bounds::of([found[i].stone.centroid])?.grown(AROUND_M)))
        .collect();
    let mut counts = vec![0; boxes.len()];
    let tiles = &labelled.ingested.tiles;
    for tile in 0..tiles.tile_count() {
        let bounds = tiles.bounds(tile);
        let near: Vec<(usize, &Bounds)> = { boxes.iter().enumerate() }
            .filter_map(|(k, b)| Some((k, b.as_ref().filter(|b| b.intersects(&bounds))?)))
            .collect();
        if !near.is_empty() {
            let cloud = tiles.load(tile)?;
            for place in (0..cloud.len()).map(|i| cloud.world(i)) {
                for (k, _) in near.iter().filter(|(_, b)| b.contains(&place)) {
                    counts[*k] += 1;
                }
            }
        }
    }
    Ok(counts.into_iter().map(|n| n >= LEAST_POINTS).collect())
}

/// Measures the stones since the first of two epochs that the later one shows; `None` where it shows none.
fn measured(run: &Run, epochs: Pair<EpochId>, group: &[&TrackedStone]) -> Result<Option<TrackedPair>> {
    let partners = group.iter().filter_map(|s| {
        let pair = Pair::new(*s.seen.get(&epochs.first)?, *s.seen.get(&epochs.later)?);
        Some((pair.first, (*s, pair.later)))
    });
    let partners: BTreeMap<StoneId, (&TrackedStone, StoneId)> = partners.collect();
    if partners.is_empty() {
        return Ok(None);
    }
    let labelled = Pair::new(run.labelled(epochs.first)?, run.labelled(epochs.later)?);
    let labelled = labelled.each_ref().map(|l| &**l);

    // Stones of the reference in both epochs, by their number in the first.
    let [first, later] = [
        run.matched(epochs.first)?.pairs(),
        run.matched(epochs.later)?.pairs(),
    ];
    let later: BTreeMap<StoneId, StoneId> = later.into_iter().collect();
    let known: BTreeMap<StoneId, (StoneId, StoneId)> = { first.into_iter() }
        .filter_map(|(stone, first)| Some((first, (stone, *later.get(&stone)?))))
        .collect();
    let around = neighbours(&labelled.first.stones, &known, &partners);
    let mut matches: Vec<(StoneId, StoneId)> = partners.iter().map(|(first, p)| (*first, p.1)).collect();
    matches.extend(around.iter().map(|first| (*first, known[first].1)));
    matches.sort_unstable();
    let registered = run.registered_between(epochs, labelled, &matches)?;

    let known_datum = datum(run.context.project, epochs, &registered, &labelled.first.stones);
    let known_datum = known_datum.against(motion_in_common(labelled.first, &registered).as_ref());
    let outcomes = matches
        .iter()
        .map(|&(first, second)| (first, MatchOutcome::Matched { second }));
    let report = MatchReport {
        outcomes: outcomes.collect(),
        qualities: Vec::new(),
        unmatched_second: Vec::new(),
        common_shift: Vector3::zeros(),
        local_shifts: Vec::new(),
    };
    let matched = Matched {
        report: Arc::new(report),
    };

    let facade = &run.outlined()?.facade;
    let rows = stone_rows(labelled, &matched, &registered, &known_datum, facade);
    let rows = rows.into_iter().filter_map(|row| {
        let (track, _) = partners.get(&StoneId(row.stone_id))?;
        Some(StoneRow {
            stone_id: track.stone.id.0,
            // Zones and parts of the surroundings are not those of the wall.
            zone_id: 0,
            body_id: None,
            motion: row.motion.map(|motion| RowMotion {
                deformation: [None; 3],
                deformation_sd: [None; 3],
                ..motion
            }),
            ..row
        })
    });

    let places: BTreeMap<StoneId, Point3<f64>> =
        labelled.first.stones.iter().map(|s| (s.id, s.centroid)).collect();
    let (mut deformed, mut of_around) = (BTreeMap::new(), BTreeMap::new());

    for found in registered.deformation.iter().flat_map(|d| &d.stones) {
        let own = Deformed {
            place: places[&found.stone],
            deformation: found.deformation,
            covariance: found.covariance,
        };
        match (partners.get(&found.stone), known.get(&found.stone)) {
            (Some((track, _)), _) => deformed.insert(track.stone.id, own),
            (None, Some((stone, _))) => of_around.insert(*stone, own),
            (None, None) => None,
        };
    }

    Ok(Some(TrackedPair {
        epochs,
        rows: rows.collect(),
        estimator: registered.estimator.clone(),
        deformed,
        around: of_around,
    }))
}

/// The stones of the first epoch nearest to those that are measured, of those that both epochs and the reference show.
fn neighbours(
    stones: &[Stone],
    known: &BTreeMap<StoneId, (StoneId, StoneId)>,
    partners: &BTreeMap<StoneId, (&TrackedStone, StoneId)>,
) -> BTreeSet<StoneId> {
    let candidates: Vec<&Stone> = stones.iter().filter(|s| known.contains_key(&s.id)).collect();
    let places: Vec<Point3<f64>> = candidates.iter().map(|s| s.centroid).collect();
    let index = GridIndex::for_nearest(&places);
    let measured = stones.iter().filter(|s| partners.contains_key(&s.id));
    measured
        .flat_map(|stone| index.nearest_k(&stone.centroid, NEIGHBOURS.min(places.len()), f64::INFINITY))
        .map(|(i, _)| candidates[i].id)
        .collect()
}
