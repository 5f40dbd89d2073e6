//! One pass over all pairs: places, point spacing, first guesses, and a sample for the noise estimate.

use super::graph::{Graph, Place};
use super::network::AdjustError;
use super::pairs::{PairPoints, PairSource};
use super::params::NetworkParams;
use crate::id::StoneId;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::ops::Range;

/// A pair without its points.
pub(super) struct StoneInfo {
    pub first: StoneId,
    pub second: StoneId,
    pub place: Place,
    /// Difference of the centroids, world, metres.
    pub shift: Vector3<f64>,
    pub counts: [usize; 2],
    pub usable: bool,
}

/// All pairs without their points.
pub(super) struct Survey {
    pub stones: Vec<StoneInfo>,
    /// The stones of each batch.
    pub batches: Vec<Range<usize>>,
    /// Median point spacing of the sparser epoch, metres.
    pub spacing_m: f64,
    /// Pairs kept in memory for the noise estimate, with their index.
    pub sample: Vec<(usize, PairPoints)>,
}

/// Pairs kept for the noise estimate.
const SAMPLE: usize = 48;
/// Stones whose centroid shifts are smoothed into a first guess.
const SMOOTHED: usize = 12;
/// Cells in which a face's area is counted, metres.
const AREA_CELL_M: f64 = 0.02;

/// Reads every batch once.
pub(super) fn survey<S: PairSource>(
    source: &S,
    params: &NetworkParams,
) -> Result<Survey, AdjustError<S::Error>> {
    let mut stones = Vec::new();
    let mut batches = Vec::new();
    let mut spacings = Vec::new();
    let mut sample: Vec<(usize, PairPoints)> = Vec::new();
    let mut stride = 1;
    for batch in 0..source.batch_count() {
        let pairs = source.load(batch).map_err(AdjustError::Source)?;
        batches.push(stones.len()..stones.len() + pairs.len());
        spacings.extend(pairs.par_iter().filter_map(spacing).collect::<Vec<f64>>());
        for pair in pairs {
            let index = stones.len();
            let info = StoneInfo::new(&pair, params);
            if info.usable && index % stride == 0 {
                sample.push((index, pair));
            }
            stones.push(info);
            if sample.len() > 2 * SAMPLE {
                stride *= 2;
                sample.retain(|(i, _)| i % stride == 0);
            }
        }
    }
    let keep = sample.len().div_ceil(SAMPLE).max(1);
    let sample = sample.into_iter().step_by(keep).collect();
    spacings.sort_by(f64::total_cmp);
    let spacing_m = spacings.get(spacings.len() / 2).copied().unwrap_or(0.005);
    Ok(Survey {
        stones,
        batches,
        spacing_m,
        sample,
    })
}

impl StoneInfo {
    fn new(pair: &PairPoints, params: &NetworkParams) -> Self {
        let counts = [pair.points_first.len(), pair.points_second.len()];
        Self {
            first: pair.first,
            second: pair.second,
            place: Place::from(pair),
            shift: pair.centroid_second - pair.centroid,
            counts,
            usable: counts.iter().all(|&n| n >= params.min_points),
        }
    }
}

impl Survey {
    /// Centroid shifts, each the median of the stone's and its nearest neighbours' along the graph.
    pub fn smoothed_shifts(&self, graph: &Graph) -> Vec<Vector3<f64>> {
        let mut next = vec![Vec::new(); self.stones.len()];
        for e in &graph.edges {
            next[e.low].push(e.high);
            next[e.high].push(e.low);
        }
        (0..self.stones.len())
            .into_par_iter()
            .map(|i| {
                let mut reached = BTreeSet::from([i]);
                for _ in 0..2 {
                    reached.extend(reached.clone().iter().flat_map(|&j| next[j].iter().copied()));
                }
                let centre = self.stones[i].place.centroid;
                let mut nearest: Vec<usize> = reached.into_iter().collect();
                nearest.sort_by(|&a, &b| {
                    let d = |k: usize| (self.stones[k].place.centroid - centre).norm_squared();
                    d(a).total_cmp(&d(b)).then(a.cmp(&b))
                });
                nearest.truncate(SMOOTHED);
                middle(&nearest.iter().map(|&j| self.stones[j].shift).collect::<Vec<_>>())
            })
            .collect()
    }
}

/// Median of each component; zero of nothing.
pub(super) fn middle(vectors: &[Vector3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|a, _| {
        let mut v: Vec<f64> = vectors.iter().map(|x| x[a]).collect();
        median(&mut v).unwrap_or(0.0)
    })
}

/// The upper median.
pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Mean point spacing of the sparser epoch.
fn spacing(pair: &PairPoints) -> Option<f64> {
    let sparse = if pair.points_first.len() < pair.points_second.len() {
        &pair.points_first
    } else {
        &pair.points_second
    };
    let frame = crate::geometry::FaceFrame::from_normal(&pair.normal);
    let cells: BTreeSet<(i64, i64)> = (0..sparse.len())
        .map(|i| {
            let p = sparse.local(i).coords;
            (
                (p.dot(&frame.along) / AREA_CELL_M).floor() as i64,
                (p.dot(&frame.up) / AREA_CELL_M).floor() as i64,
            )
        })
        .collect();
    (sparse.len() >= 10).then(|| AREA_CELL_M * (cells.len() as f64 / sparse.len() as f64).sqrt())
}
