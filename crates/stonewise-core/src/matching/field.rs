//! A smooth field of shifts that follows settlements and bulges.

use super::MatchParams;
use super::centroids::{Centroids, area_ratio};
use crate::statistics::component_median;
use crate::stone::Stone;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Rounds of pairing and smoothing.
const ROUNDS: usize = 6;
/// A pair agrees with the field where it is off by less than this share of the stone's size.
const AGREES_SIZES: f64 = 0.25;

/// Shift of every stone of the first epoch.
pub(super) struct Field {
    /// One a stone, metres.
    pub shifts: Vec<Vector3<f64>>,
    /// Number of mutual pairs with matching areas that agree with the field.
    pub support: usize,
}

/// The field that grows from one common shift.
///
/// Mutual nearest neighbours with similar areas are paired; each stone's shift becomes the median over the
/// pairs nearest to it, component by component; again from there.
pub(super) fn grow(
    first: &Centroids,
    second: &Centroids,
    common: &Vector3<f64>,
    params: &MatchParams,
) -> Field {
    let mut shifts = vec![*common; first.stones.len()];
    if params.shift_neighbours == 0 {
        let support = agreeing(first, second, &shifts, params);
        return Field { shifts, support };
    }
    for _ in 0..ROUNDS {
        let pairs = pairs(first, second, &shifts, params);
        if pairs.is_empty() {
            break;
        }
        shifts = smooth(first.stones, &pairs, params.shift_neighbours);
    }
    let support = agreeing(first, second, &shifts, params);
    Field { shifts, support }
}

/// Stones where the field expects them.
pub(super) fn predict(stones: &[Stone], shifts: &[Vector3<f64>]) -> Vec<Point3<f64>> {
    stones.iter().zip(shifts).map(|(s, d)| s.centroid + d).collect()
}

/// A stone of the first epoch with the difference to its mutual nearest partner.
type Pair = (usize, Vector3<f64>);

fn pairs(first: &Centroids, second: &Centroids, shifts: &[Vector3<f64>], params: &MatchParams) -> Vec<Pair> {
    let places = predict(first.stones, shifts);
    let back = Centroids::at(first.stones, &places);
    places
        .par_iter()
        .enumerate()
        .filter_map(|(i, place)| {
            let &(j, distance) = second.nearest(place, 1).first()?;
            let (a, b) = (&first.stones[i], &second.stones[j]);
            let mutual = back.nearest(&b.centroid, 1).first().map(|n| n.0) == Some(i);
            let near = distance <= params.max_offset_m(a.area_m2.max(b.area_m2));
            let alike = area_ratio(a, b) >= params.min_area_ratio;
            (mutual && near && alike).then(|| (i, b.centroid - a.centroid))
        })
        .collect()
}

fn smooth(stones: &[Stone], pairs: &[Pair], neighbours: usize) -> Vec<Vector3<f64>> {
    let paired: Vec<Stone> = pairs.iter().map(|p| stones[p.0].clone()).collect();
    let index = Centroids::new(&paired);
    stones
        .par_iter()
        .map(|stone| {
            let around = index.nearest(&stone.centroid, neighbours);
            component_median(&around.iter().map(|n| pairs[n.0].1).collect::<Vec<_>>())
        })
        .collect()
}

fn agreeing(first: &Centroids, second: &Centroids, shifts: &[Vector3<f64>], params: &MatchParams) -> usize {
    pairs(first, second, shifts, params)
        .iter()
        .filter(|(i, d)| (d - shifts[*i]).norm() <= AGREES_SIZES * first.stones[*i].area_m2.sqrt())
        .count()
}
