//! Areas that deformed: the stones around each peak of the deformation in one direction that moved by more than half of
//! the peak.

use super::found::OUTSIDE;
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::BTreeSet;

/// Share of a peak above which stones belong to its area. Two peaks are two areas if the motion between them falls
/// below this share of the lower one.
pub(super) const HALF: f64 = 0.5;
/// Fewest connected stones that moved in an area: one or two that differ from their surroundings are judged as loose
/// stones.
const LEAST_STONES: usize = 3;

/// How far the stones of a body moved in one direction.
pub(super) struct Motion<'a> {
    /// Neighbours of each stone that count; none of the others.
    next: &'a [Vec<usize>],
    /// Standard deviation of each stone, metres.
    sds: &'a [f64],
    /// The motion of each stone without what its neighbours show to be error, metres.
    pub values: Vec<f64>,
}

/// The stones above half of a peak.
pub(super) struct Area {
    /// The first is that of the peak.
    pub stones: Vec<usize>,
    /// Half of the peak, metres.
    pub half_m: f64,
}

impl<'a> Motion<'a> {
    /// The motion of each stone is averaged with those of the neighbours that moved alike within the errors, so that a
    /// wide area is smoothed and an edge stays (bilateral filter: Tomasi & Manduchi 1998). A stone that moved more than
    /// twice as far as all of its neighbours but one is not a peak: it gets the second largest motion of its
    /// neighbours.
    pub fn new(next: &'a [Vec<usize>], measured: &[f64], sds: &'a [f64]) -> Self {
        let mean = |(i, near): (usize, &Vec<usize>)| {
            let (mut sum, mut weights) = (measured[i], 1.0);
            for &j in near {
                let variance = (sds[i].powi(2) + sds[j].powi(2)).max(f64::MIN_POSITIVE);
                let weight = (-0.5 * (measured[i] - measured[j]).powi(2) / variance).exp();
                sum += weight * measured[j];
                weights += weight;
            }
            sum / weights
        };
        let means: Vec<f64> = next.iter().enumerate().map(mean).collect();
        let levelled = |(near, mean): (&Vec<usize>, &f64)| {
            let mut of_near: Vec<f64> = near.iter().map(|&j| means[j]).collect();
            of_near.sort_by(|a, b| b.total_cmp(a));
            let second = of_near.get(LEAST_STONES - 2).copied().unwrap_or(0.0);
            if HALF * mean > second { second } else { *mean }
        };
        let values = next.iter().zip(&means).map(levelled).collect();
        Self { next, sds, values }
    }

    /// The areas, that of the highest peak first. Two peaks are two areas if the motion between them falls below half
    /// of the lower one by more than errors explain. `moved`: stones that are shown to have moved in this direction; at
    /// least three of them, connected, belong to an area, some perhaps beside it.
    pub fn areas(&self, moved: &[bool]) -> Vec<Area> {
        let mut order: Vec<usize> = (0..self.values.len())
            .filter(|&i| moved[i] && self.values[i] > 0.0)
            .collect();
        order.sort_by(|&a, &b| self.values[b].total_cmp(&self.values[a]).then(a.cmp(&b)));
        let quantile = Normal::standard().inverse_cdf(1.0 - 0.5 * OUTSIDE);
        let is_higher = |i: usize, j: usize| {
            let [of_i, of_j] = [i, j].map(|k| self.values[k]);
            of_j > of_i || (of_j == of_i && j < i)
        };
        let area = |&peak: &usize| {
            let half_m = HALF * self.values[peak];
            let may_join = |j: usize| {
                let sd = (HALF * self.sds[peak]).hypot(self.sds[j]);
                self.values[j] >= half_m - quantile * sd
            };
            self.reached(peak, may_join, |j| is_higher(peak, j))?;
            let shown = self.reached(peak, |j| moved[j] && self.values[j] > 0.0, |_| false)?;
            let stones = self.reached(peak, |j| self.values[j] >= half_m, |_| false)?;
            (shown.len() >= LEAST_STONES).then_some(Area { stones, half_m })
        };
        order.iter().filter_map(area).collect()
    }

    /// The stones that `is_in` connects with this one; `None` if one of them `ends` the search.
    fn reached(
        &self,
        start: usize,
        is_in: impl Fn(usize) -> bool,
        ends: impl Fn(usize) -> bool,
    ) -> Option<Vec<usize>> {
        let mut seen = BTreeSet::from([start]);
        let mut stones = vec![start];
        let mut done = 0;
        while let Some(&i) = stones.get(done) {
            for &j in &self.next[i] {
                if is_in(j) && seen.insert(j) {
                    if ends(j) {
                        return None;
                    }
                    stones.push(j);
                }
            }
            done += 1;
        }
        Some(stones)
    }

    /// The stones of an area and those beside it, ascending.
    pub fn around(&self, area: &Area) -> BTreeSet<usize> {
        let beside = area.stones.iter().flat_map(|&i| &self.next[i]);
        beside.chain(&area.stones).copied().collect()
    }

    /// For each stone of an area or beside it and each of its neighbours: the part of the first half of the way to the
    /// neighbour that lies in the area, from and to, as shares of the whole way. The edge lies where the motion, linear
    /// between neighbours, is half of the peak.
    pub fn ways(&self, area: &Area) -> Vec<([usize; 2], [f64; 2])> {
        let inside: BTreeSet<usize> = area.stones.iter().copied().collect();
        // Share of the way from a stone inside to a neighbour outside.
        let edge = |inner: usize, outer: usize| {
            let [inner, outer] = [inner, outer].map(|k| self.values[k]);
            ((inner - area.half_m) / (inner - outer)).clamp(0.0, 1.0)
        };
        let part = |i: usize, j: usize| match (inside.contains(&i), inside.contains(&j)) {
            (true, true) => [0.0, 0.5],
            (true, false) => [0.0, edge(i, j).min(0.5)],
            (false, true) => [(1.0 - edge(j, i)).min(0.5), 0.5],
            (false, false) => [0.5, 0.5],
        };
        let of_stone = |i: usize| self.next[i].iter().map(move |&j| [i, j]);
        let ways = self.around(area).into_iter().flat_map(of_stone);
        ways.map(|[i, j]| ([i, j], part(i, j))).collect()
    }
}
