//! Plane-to-plane ICP of every matched stone, a neighbourhood of the survey at a time.

use crate::error::Result;
use crate::pipeline::steps::label::Labelled;
use nalgebra::Point3;
use std::collections::BTreeMap;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::epoch::Pair;
use stonewise_core::geometry::{Bounds, cell_of};
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::{
    GicpBlock, GicpParams, GicpStone, StoneExtents, align, relate_to_neighbours,
};
use stonewise_core::stone::{PairResult, Stone};

/// Points beyond the windows that the planes at their edges need, metres.
const PLANE_MARGIN_M: f64 = 0.1;

/// Measures all matched stones; `size_m`: edge of the neighbourhoods, metres, best that of the tiles.
///
/// Memory holds the points of one neighbourhood and its surroundings in both epochs.
pub fn align_windows(
    labelled: Pair<&Labelled>,
    matches: &[(StoneId, StoneId)],
    size_m: f64,
    params: &GicpParams,
    progress: &dyn Progress,
) -> Result<Vec<PairResult>> {
    let pairs = pairs(labelled, matches);
    let mut groups: BTreeMap<[i64; 3], Vec<&(Stone, Stone)>> = BTreeMap::new();
    for pair in &pairs {
        let cell = cell_of(&pair.0.centroid, size_m);
        groups.entry(cell).or_default().push(pair);
    }
    let extents = labelled.first.extents(progress)?;
    progress.begin("align stones", pairs.len() as u64);
    let mut measured: BTreeMap<StoneId, PairResult> = BTreeMap::new();
    for group in groups.values() {
        progress.check()?;
        let results = align_group(labelled, group, &extents, params)?;
        measured.extend(results.into_iter().map(|r| (r.first, r)));
        progress.advance(group.len() as u64);
    }
    let centroids: BTreeMap<StoneId, Point3<f64>> = pairs.iter().map(|p| (p.0.id, p.0.centroid)).collect();
    let placed = measured.into_values();
    let mut placed: Vec<(Point3<f64>, PairResult)> = placed
        .filter_map(|result| Some((*centroids.get(&result.first)?, result)))
        .collect();
    relate_to_neighbours(&mut placed, params);
    Ok(placed.into_iter().map(|(_, result)| result).collect())
}

fn pairs(labelled: Pair<&Labelled>, matches: &[(StoneId, StoneId)]) -> Vec<(Stone, Stone)> {
    let find = |stones: &[Stone], id: StoneId| {
        let found = stones.binary_search_by_key(&id, |s| s.id).ok()?;
        Some(stones[found].clone())
    };
    let both = |(a, b): &(StoneId, StoneId)| {
        Some((
            find(&labelled.first.stones, *a)?,
            find(&labelled.later.stones, *b)?,
        ))
    };
    matches.iter().filter_map(both).collect()
}

fn align_group(
    labelled: Pair<&Labelled>,
    group: &[&(Stone, Stone)],
    extents: &StoneExtents,
    params: &GicpParams,
) -> Result<Vec<PairResult>> {
    let stones = group.iter().filter_map(|p| extents.of(p.0.id).copied());
    let Some(stones) = stones.reduce(|a, b| a.union(&b)) else {
        return Ok(Vec::new());
    };
    let largest_move = group
        .iter()
        .map(|(a, b)| (b.centroid - a.centroid).norm())
        .fold(0.0, f64::max);
    let region = stones.grown(params.buffer_m + PLANE_MARGIN_M);
    let (cloud, mut points) = labelled_region(labelled.first, &region, group)?;
    let reach = params.max_distance_m + largest_move;
    let cloud_second = labelled.later.ingested.tiles.load_region(&region.grown(reach))?;
    let blocks = [cloud, cloud_second].map(|cloud| GicpBlock::new(&cloud, params));
    let stones: Vec<GicpStone> = group
        .iter()
        .map(|(a, b)| GicpStone {
            first: a.id,
            second: b.id,
            centroid: a.centroid,
            points: points.remove(&a.id.0).unwrap_or_default(),
            points_second: b.points as usize,
        })
        .collect();

    Ok(align(&blocks[0], &blocks[1], &stones, params))
}

/// Points of the first epoch inside a box, and which of them belong to each stone of the group.
fn labelled_region(
    epoch: &Labelled,
    region: &Bounds,
    group: &[&(Stone, Stone)],
) -> Result<(Cloud, BTreeMap<u32, Vec<u32>>)> {
    let tiles = &epoch.ingested.tiles;
    let mut found = Cloud::new(region.centre(), Vec::new());
    let mut points: BTreeMap<u32, Vec<u32>> = group.iter().map(|p| (p.0.id.0, Vec::new())).collect();
    for tile in (0..tiles.tile_count()).filter(|&t| tiles.bounds(t).intersects(region)) {
        let (cloud, labels) = (tiles.load(tile)?, epoch.labels(tile)?);
        let inside: Vec<usize> = (0..cloud.len())
            .filter(|&i| region.contains(&cloud.world(i)))
            .collect();
        for (&i, at) in inside.iter().zip(found.len()..) {
            if let Some(points) = points.get_mut(&labels.stone[i]) {
                points.push(at as u32);
            }
        }
        let kept = inside.iter().map(|&i| cloud.world(i));
        found.append(&Cloud::from_world(region.centre(), kept));
    }
    Ok((found, points))
}
