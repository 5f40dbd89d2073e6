//! Do labels lie on the stones that the clouds show?

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::r#match::MATCH;
use crate::pipeline::until::Until;
use crate::storage::step::Key;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::Bounds;
use stonewise_core::id::StoneId;
use stonewise_core::matching::{FaceGrid, FacePatch, Offset, OffsetVote};
use stonewise_core::progress::Progress;
use stonewise_core::statistics::component_median;
use stonewise_core::stone::Stone;

/// Compares the labels of a pair of epochs with the relief of their clouds.
pub static OFFSETS: Step = Step {
    name: STEP,
    about: About::Later,
    needs: &[Need::same(&MATCH)],
    wanted: |until| until >= Until::Registered,
    cost: Some(|_, _| Cost::of(2, 0)),
    make: |run, epoch| run.offsets(epoch).map(drop),
    ..Step::PLAIN
};

/// Name of the step.
const STEP: &str = "offsets";
/// Places of the wall that are compared, at most.
const PLACES: usize = 32;
/// Fewer matched stones show nothing.
const LEAST_STONES: usize = 6;
/// Matched stones around a place whose centroids say how far its labels moved.
const NEIGHBOURS: usize = 9;
/// Half width of the squares that are compared, metres: a few stones.
const HALF_M: f64 = 0.5;
/// Largest offset that is sought, metres.
const REACH_M: f64 = 0.5;
/// Points further than this from the face are not of the wall, metres.
const DEPTH_M: f64 = 0.3;

/// How far labels lie beside the stones that the clouds show; absent where the surface does not show it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelOffsets {
    /// Labels of the first epoch against the relief of its own cloud.
    pub first: Option<LabelOffset>,
    /// Labels of the later epoch against the relief of its own cloud.
    pub second: Option<LabelOffset>,
    /// The later epoch's cloud under its labels, against the first epoch's.
    pub between: Option<LabelOffset>,
}

/// Where two pictures of the face are most alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelOffset {
    /// Along and up the face, metres.
    pub along_up_m: [f64; 2],
    /// Correlation there.
    pub likeness: f64,
    /// Correlation without an offset.
    pub likeness_unmoved: f64,
}

impl LabelOffset {
    /// Length of the offset, metres.
    pub fn length_m(&self) -> f64 {
        self.along_up_m[0].hypot(self.along_up_m[1])
    }
}

impl From<Offset> for LabelOffset {
    fn from(offset: Offset) -> Self {
        Self {
            along_up_m: offset.along_up_m.into(),
            likeness: offset.likeness,
            likeness_unmoved: offset.likeness_unmoved,
        }
    }
}

impl Run<'_> {
    /// How far labels lie beside the stones of their clouds.
    pub fn offsets(&self, later: EpochId) -> Result<Arc<LabelOffsets>> {
        self.once(&OFFSETS, later, || label_offsets(self, later))
    }
}

fn label_offsets(run: &Run, later: EpochId) -> Result<LabelOffsets> {
    let (context, labelled) = (run.context, run.labelled_pair(later)?);
    let matches = run.matched(later)?.pairs();
    let keys = labelled.each_ref().map(|l| l.key.as_str());
    let key = Key::new(STEP, &matches, &keys.into_array());
    let step = context.step(&format!("{STEP}-{later}"), key, |step, _| {
        let places = places(&labelled.first.stones, &labelled.later.stones, &matches);
        let views = [
            look(&labelled.first, &places, |p| p.first, context.progress)?,
            look(&labelled.later, &places, |p| p.second, context.progress)?,
        ];
        write_json(&step.file("offsets.json"), &compare(&views))
    })?;
    read_json(&step.file("offsets.json"))
}

/// A place of the wall, under its labels in both epochs.
struct Place {
    first: Point3<f64>,
    second: Point3<f64>,
    normal: Vector3<f64>,
}

/// Matched stones, spread over the list; the later epoch's place follows the labels around the stone, whose
/// outlines differ one by one.
fn places(first: &[Stone], second: &[Stone], matches: &[(StoneId, StoneId)]) -> Vec<Place> {
    let find = |stones: &[Stone], id: StoneId| {
        let found = stones.binary_search_by_key(&id, |s| s.id).ok()?;
        Some((stones[found].centroid, stones[found].normal))
    };
    let pairs: Vec<(Point3<f64>, Vector3<f64>, Vector3<f64>)> = matches
        .iter()
        .filter_map(|(a, b)| {
            let ((from, normal), (to, _)) = (find(first, *a)?, find(second, *b)?);
            Some((from, normal, to - from))
        })
        .collect();
    if pairs.len() < LEAST_STONES {
        return Vec::new();
    }

    let place = |(centre, normal, _): &(Point3<f64>, Vector3<f64>, Vector3<f64>)| {
        let mut near: Vec<(f64, Vector3<f64>)> = pairs
            .iter()
            .map(|(p, _, shift)| ((p - centre).norm_squared(), *shift))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let shifts: Vec<Vector3<f64>> = near.into_iter().take(NEIGHBOURS).map(|n| n.1).collect();
        Place {
            first: *centre,
            second: centre + component_median(&shifts),
            normal: *normal,
        }
    };

    pairs
        .iter()
        .step_by(pairs.len().div_ceil(PLACES))
        .map(place)
        .collect()
}

/// What an epoch shows at a place.
struct View {
    labels: FaceGrid,
    relief: FaceGrid,
    relief_around: FaceGrid,
}

/// Relief and labels of an epoch at all places, in one pass over the tiles around them.
fn look(
    epoch: &Labelled,
    places: &[Place],
    at: impl Fn(&Place) -> Point3<f64>,
    progress: &dyn Progress,
) -> Result<Vec<View>> {
    let around = HALF_M + REACH_M;
    let mut views: Vec<View> = places
        .iter()
        .map(|place| {
            let grid = |half_m| FaceGrid::new(at(place), &place.normal, half_m);
            View {
                labels: grid(HALF_M),
                relief: grid(HALF_M),
                relief_around: grid(around),
            }
        })
        .collect();
    let reach = around.hypot(around).hypot(DEPTH_M);
    let boxes: Vec<Bounds> = places
        .iter()
        .map(|place| {
            Bounds {
                min: at(place),
                max: at(place),
            }
            .grown(reach)
        })
        .collect();

    let tiles = &epoch.ingested.tiles;
    for tile in 0..tiles.tile_count() {
        progress.check()?;
        let bounds = tiles.bounds(tile);
        if !boxes.iter().any(|b| b.intersects(&bounds)) {
            continue;
        }
        let (cloud, labels) = (tiles.load(tile)?, epoch.labels(tile)?);
        views
            .par_iter_mut()
            .zip(&boxes)
            .filter(|(_, b)| b.intersects(&bounds))
            .for_each(|(view, region)| {
                for i in 0..cloud.len() {
                    let p = cloud.world(i);
                    if !region.contains(&p) {
                        continue;
                    }
                    let height = view.relief.height(&p);
                    if height.abs() > DEPTH_M {
                        continue;
                    }
                    view.relief.add(&p, height);
                    view.relief_around.add(&p, height);
                    if labels.seen[i] {
                        view.labels.add(&p, f64::from(u8::from(labels.stone[i] != 0)));
                    }
                }
            });
    }

    Ok(views)
}

fn compare([first, second]: &[Vec<View>; 2]) -> LabelOffsets {
    let places = first.len();
    LabelOffsets {
        first: offset(places, |i| {
            [&first[i].labels, &first[i].relief_around].map(FaceGrid::finish)
        }),
        second: offset(places, |i| {
            [&second[i].labels, &second[i].relief_around].map(FaceGrid::finish)
        }),
        between: offset(places, |i| {
            [&first[i].relief, &second[i].relief_around].map(FaceGrid::finish)
        }),
    }
}

/// Where the second patches of all places lie against the first.
fn offset(places: usize, pair: impl Fn(usize) -> [FacePatch; 2] + Sync) -> Option<LabelOffset> {
    let vote = |place: usize| {
        let [smaller, larger] = pair(place);
        let mut vote = OffsetVote::new(REACH_M);
        vote.add(&smaller, &larger);
        vote
    };
    let votes: Vec<OffsetVote> = (0..places).into_par_iter().map(vote).collect();
    // One after the other, so that the sums do not depend on the number of threads.
    let sum = votes.iter().fold(OffsetVote::new(REACH_M), OffsetVote::merge);
    sum.offset().map(LabelOffset::from)
}
