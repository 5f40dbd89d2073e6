//! The motion that most stones have in common.

use super::MatchParams;
use super::centroids::{Centroids, area_ratio};
use super::field::{Field, grow};
use crate::geometry::cells_around;
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashMap};

/// Cells of the vote, metres: fine where all stones move alike, coarse where a field varies.
const SCALES_M: [f64; 3] = [0.02, 0.05, 0.12];
/// Peaks tried at each scale.
const PEAKS: usize = 4;
/// Stones of the first epoch that vote, at most; they are spread over the list.
const MAX_VOTERS: usize = 3000;

/// The common shift and the field that grows from it.
///
/// Every pair of stones of similar area within the largest shift votes for its centroid difference; the peaks
/// at several scales, and no motion at all, are tried, and the field with most agreeing pairs wins, the
/// smaller shift among equals.
pub(super) fn common_shift(
    first: &Centroids,
    second: &Centroids,
    params: &MatchParams,
) -> (Vector3<f64>, Field) {
    let mut tried = vec![Vector3::zeros()];
    if params.max_shift_m > 0.0 {
        let votes = votes(first, second, params);
        tried.extend(SCALES_M.iter().flat_map(|&scale| peaks(&votes, scale)));
    }
    tried.sort_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    let mut best = (tried[0], grow(first, second, &tried[0], params));
    for shift in &tried[1..] {
        let field = grow(first, second, shift, params);
        if field.support > best.1.support {
            best = (*shift, field);
        }
    }
    best
}

fn votes(first: &Centroids, second: &Centroids, params: &MatchParams) -> Vec<Vector3<f64>> {
    let step = first.stones.len().div_ceil(MAX_VOTERS).max(1);
    let voters = first.stones.iter().step_by(step);
    voters
        .flat_map(|a| {
            second
                .within(&a.centroid, params.max_shift_m)
                .into_iter()
                .map(move |j| (a, &second.stones[j]))
        })
        .filter(|(a, b)| area_ratio(a, b) >= params.min_area_ratio)
        .map(|(a, b)| b.centroid - a.centroid)
        .collect()
}

/// Where votes gather most densely: the means of the fullest blocks of 3 x 3 x 3 cells.
fn peaks(votes: &[Vector3<f64>], scale: f64) -> Vec<Vector3<f64>> {
    let key = |v: &Vector3<f64>| [0, 1, 2].map(|a| (v[a] / scale).floor() as i32);
    let mut cells: HashMap<[i32; 3], u32> = HashMap::new();
    for vote in votes {
        *cells.entry(key(vote)).or_insert(0) += 1;
    }
    let block = |cell| -> u32 { cells_around(cell).filter_map(|c| cells.get(&c)).sum() };
    let ranked: BTreeMap<(std::cmp::Reverse<u32>, [i32; 3]), ()> = cells
        .keys()
        .map(|&cell| ((std::cmp::Reverse(block(cell)), cell), ()))
        .collect();
    let mut chosen: Vec<[i32; 3]> = Vec::new();
    for (_, cell) in ranked.into_keys() {
        let apart = |c: &[i32; 3]| (0..3).any(|a| (c[a] - cell[a]).abs() > 2);
        if chosen.iter().all(apart) {
            chosen.push(cell);
        }
        if chosen.len() == PEAKS {
            break;
        }
    }
    chosen.iter().map(|&cell| block_mean(votes, key, cell)).collect()
}

fn block_mean(
    votes: &[Vector3<f64>],
    key: impl Fn(&Vector3<f64>) -> [i32; 3],
    cell: [i32; 3],
) -> Vector3<f64> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for vote in votes {
        let k = key(vote);
        if (0..3).all(|a| (k[a] - cell[a]).abs() <= 1) {
            sum += vote;
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}
