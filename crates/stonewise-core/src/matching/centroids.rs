//! Stones of one epoch, ready to be searched by place.

use crate::cloud::GridIndex;
use crate::statistics::upper_median;
use crate::stone::Stone;
use nalgebra::Point3;

/// Nothing is looked for farther away, metres.
const REACH_M: f64 = 1e3;

/// Centroids with an index.
pub(super) struct Centroids<'a> {
    pub stones: &'a [Stone],
    index: GridIndex,
}

impl<'a> Centroids<'a> {
    pub(super) fn new(stones: &'a [Stone]) -> Self {
        let points: Vec<Point3<f64>> = stones.iter().map(|s| s.centroid).collect();
        Self::at(stones, &points)
    }

    /// The stones as if they were at other places.
    pub(super) fn at(stones: &'a [Stone], places: &[Point3<f64>]) -> Self {
        let mut sizes: Vec<f64> = stones.iter().map(|s| s.area_m2.max(0.0).sqrt()).collect();
        let size = upper_median(&mut sizes).unwrap_or(0.0);
        Self {
            stones,
            index: GridIndex::new(places, (2.0 * size).max(0.05)),
        }
    }

    /// The `k` nearest stones to a place: index and distance, nearest first.
    pub(super) fn nearest(&self, place: &Point3<f64>, k: usize) -> Vec<(usize, f64)> {
        let found = self.index.nearest_k(place, k, REACH_M);
        found.into_iter().map(|(i, d2)| (i, d2.sqrt())).collect()
    }

    /// The stones within a radius of a place.
    pub(super) fn within(&self, place: &Point3<f64>, radius_m: f64) -> Vec<usize> {
        let mut found = Vec::new();
        self.index.within(place, radius_m, |i, _| found.push(i));
        found.sort_unstable();
        found
    }
}

/// Ratio of the smaller to the larger face.
pub(super) fn area_ratio(a: &Stone, b: &Stone) -> f64 {
    let (small, large) = (a.area_m2.min(b.area_m2), a.area_m2.max(b.area_m2));
    if large > 0.0 { small / large } else { 0.0 }
}
