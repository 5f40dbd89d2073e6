//! One pass over all pairs: places, point spacing, first guesses, and a sample for the noise estimate.

use super::error::AdjustError;
use super::field::{Graph, Place};
use super::params::AdjustmentParams;
use super::partial_view::{hidden, missing};
use crate::id::StoneId;
use crate::progress::{Interrupted, Progress, ahead};
use crate::registration::points::{NOISES_ALIKE, PairPoints, PairSource, Window, face_spacing};
use crate::statistics::{component_median, upper_median};
use crate::switches::{switchable, where_on};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

/// A pair without its points.
pub(crate) struct StoneInfo {
    pub first: StoneId,
    pub second: StoneId,
    pub place: Place,
    /// Difference of the centroids, world, metres.
    pub shift: Vector3<f64>,
    pub counts: [usize; 2],
    pub usable: bool,
    /// Noise of each epoch's points over that of most stones: 1 unless another sensor measured the stone.
    pub noise_factors: [f64; 2],
    /// How much less of its face one epoch shows than is usual, or than points show well, as a share.
    pub hidden: f64,
    /// Sources of each epoch's points, with the share of each; none where the points were not chosen by a window.
    pub sources: [Vec<(u32, f64)>; 2],
}

/// All pairs, with and without their points.
pub(crate) struct Survey<'a, S> {
    pub stones: Vec<StoneInfo>,
    /// Median point spacing of the sparser epoch, metres.
    pub spacing_m: f64,
    pub points: Points<'a, S>,
}

/// The points of all pairs: where they are read again, and those that stay in memory.
pub(crate) struct Points<'a, S> {
    source: &'a S,
    /// The stones of each batch.
    pub batches: Vec<Range<usize>>,
    /// Pairs kept for the noise estimate, with their index.
    pub sample: Vec<(usize, PairPoints)>,
    pub progress: &'a dyn Progress,
}

impl<S: PairSource> Points<'_, S> {
    /// The batches that hold a stone for which `is_due`, in groups that are worked on together.
    pub fn groups(&self, is_due: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let batches = 0..self.batches.len();
        let due: Vec<usize> = batches
            .filter(|&batch| self.batches[batch].clone().any(&is_due))
            .collect();
        due.chunks(ahead()).map(<[usize]>::to_vec).collect()
    }

    /// Runs `work` on the stones of these batches for which `is_due`; returns the results in order. The batches are
    /// read and processed in parallel; if several fail, the error of the first is returned.
    pub fn of_stones<T: Send>(
        &self,
        group: &[usize],
        is_due: impl Fn(usize) -> bool + Sync,
        work: impl Fn(usize, &PairPoints) -> T + Sync,
    ) -> Result<Vec<(usize, T)>, AdjustError<S::Error>> {
        let of_stone = |(pair, i): (&PairPoints, usize)| {
            self.progress.check()?;
            Ok((i, work(i, pair)))
        };
        let of_batch = |batch: &usize| -> Result<Vec<(usize, T)>, AdjustError<S::Error>> {
            self.progress.check()?;
            let pairs = self.source.load(*batch).map_err(AdjustError::Source)?;
            let stones = pairs.par_iter().zip(self.batches[*batch].clone());
            let due = stones.filter(|(_, i)| is_due(*i)).map(of_stone);
            Ok(due.collect::<Result<Vec<_>, Interrupted>>()?)
        };
        let found: Vec<Result<_, _>> = group.par_iter().map(of_batch).collect();
        let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(found.into_iter().flatten().collect())
    }
}

/// Pairs kept for the noise estimate: each has a patch or more, and 64 patches determine the noise to a
/// percent.
const SAMPLE: usize = 48;
/// Stones whose centroid shifts are smoothed into a first guess: a ring of neighbours, so that one wrong mask
/// does not matter.
const SMOOTHED: usize = 12;
/// Points below which a stone shows no spacing.
const SPACING_POINTS: usize = 10;
/// Point spacing of a survey none of whose stones shows one, metres.
const USUAL_SPACING_M: f64 = 0.005;

/// Reads every batch once.
pub(crate) fn survey<'a, S: PairSource>(
    source: &'a S,
    params: &AdjustmentParams,
    progress: &'a dyn Progress,
) -> Result<Survey<'a, S>, AdjustError<S::Error>> {
    let mut stones = Vec::new();
    let mut batches = Vec::new();
    let mut spacings = Vec::new();
    let mut windows = Vec::new();
    let mut sample: Vec<(usize, PairPoints)> = Vec::new();
    let mut stride = 1;

    let load = |batch: usize| {
        let pairs = source.load(batch).map_err(AdjustError::Source)?;
        let spacings: Vec<f64> = pairs.par_iter().filter_map(spacing).collect();
        Ok::<_, AdjustError<S::Error>>((pairs, spacings))
    };
    progress.each_prepared(
        "read stones",
        0..source.batch_count(),
        load,
        |_, (pairs, found)| {
            batches.push(stones.len()..stones.len() + pairs.len());
            spacings.extend(found);
            for pair in pairs {
                let index = stones.len();
                let info = StoneInfo::new(&pair, params);
                let window = pair.window.clone();
                if info.usable && index % stride == 0 {
                    sample.push((index, pair));
                }
                windows.push(window);
                stones.push(info);
                if sample.len() > 2 * SAMPLE {
                    stride *= 2;
                    sample.retain(|(i, _)| i % stride == 0);
                }
            }
            Ok(())
        },
    )?;

    set_noise_factors(&mut stones, &windows);
    let shared: Vec<f64> = windows
        .iter()
        .map(|w| w.as_deref().map_or(1.0, Window::shared))
        .collect();
    for (stone, hidden) in stones.iter_mut().zip(hidden(&shared)) {
        stone.hidden = where_on("partial", hidden.max(missing(stone.counts)), 0.0);
    }
    sample.retain(|(i, _)| stones[*i].noise_factors == [1.0; 2]);
    let keep = sample.len().div_ceil(SAMPLE).max(1);

    Ok(Survey {
        stones,
        spacing_m: upper_median(&mut spacings).unwrap_or(USUAL_SPACING_M),
        points: Points {
            source,
            batches,
            sample: sample.into_iter().step_by(keep).collect(),
            progress,
        },
    })
}

impl StoneInfo {
    fn new(pair: &PairPoints, params: &AdjustmentParams) -> Self {
        let counts = [pair.points_first.len(), pair.points_second.len()];
        Self {
            first: pair.first,
            second: pair.second,
            place: Place::from(pair),
            shift: pair.centroid_second - pair.centroid,
            counts,
            noise_factors: [1.0; 2],
            hidden: 0.0,
            sources: pair.window.as_deref().map_or_else(Default::default, shares),
            usable: counts.iter().all(|&n| n >= params.min_points),
        }
    }
}

/// Share of each source in each epoch's points.
fn shares(window: &Window) -> [Vec<(u32, f64)>; 2] {
    window.sources().each_ref().map(|counts| {
        let all: usize = counts.values().sum();
        let share = |(source, count): (&u32, &usize)| (*source, *count as f64 / all.max(1) as f64);
        counts.iter().map(share).collect()
    })
}

/// Compares the noise of stones that sources of another sensor measured with that of most stones: sources whose
/// stones mostly have another noise.
fn set_noise_factors(stones: &mut [StoneInfo], windows: &[Option<Arc<Window>>]) {
    switchable!("sensors");
    for epoch in 0..2 {
        let mut all: Vec<f64> = windows.iter().flatten().map(|w| w.noise_m()[epoch]).collect();
        let Some(usual) = upper_median(&mut all).filter(|usual| *usual > 0.0) else {
            continue;
        };
        let factor = |w: &Window| w.noise_m()[epoch] / usual;
        let is_usual = |w: &Window| (NOISES_ALIKE.recip()..=NOISES_ALIKE).contains(&factor(w));
        // Per source, stones of usual noise less the others.
        let mut votes: BTreeMap<u32, i64> = BTreeMap::new();
        for w in windows.iter().flatten() {
            for source in w.sources()[epoch].keys() {
                *votes.entry(*source).or_default() += if is_usual(w) { 1 } else { -1 };
            }
        }
        let is_of_another = |source: &u32| votes.get(source).is_some_and(|votes| *votes < 0);
        for (stone, window) in stones.iter_mut().zip(windows) {
            if let Some(w) = window.as_deref()
                && !is_usual(w)
                && factor(w) > 0.0
                && w.sources()[epoch].keys().all(is_of_another)
            {
                stone.noise_factors[epoch] = factor(w);
            }
        }
    }
}

/// Centroid shifts, each the median of the stone's and its nearest neighbours' along the graph.
pub(crate) fn smoothed_shifts(stones: &[StoneInfo], graph: &Graph) -> Vec<Vector3<f64>> {
    let next = graph.neighbours();
    (0..stones.len())
        .into_par_iter()
        .map(|i| {
            let mut reached = BTreeSet::from([i]);
            for _ in 0..2 {
                reached.extend(reached.clone().iter().flat_map(|&j| next[j].iter().copied()));
            }
            let centre = stones[i].place.centroid;
            let mut nearest: Vec<usize> = reached.into_iter().collect();
            nearest.sort_by(|&a, &b| {
                let d = |k: usize| (stones[k].place.centroid - centre).norm_squared();
                d(a).total_cmp(&d(b)).then(a.cmp(&b))
            });
            nearest.truncate(SMOOTHED);
            component_median(&nearest.iter().map(|&j| stones[j].shift).collect::<Vec<_>>())
        })
        .collect()
}

/// Mean point spacing of the sparser epoch.
fn spacing(pair: &PairPoints) -> Option<f64> {
    let sparse = if pair.points_first.len() < pair.points_second.len() {
        &pair.points_first
    } else {
        &pair.points_second
    };
    (sparse.len() >= SPACING_POINTS).then(|| face_spacing(sparse, &pair.normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::progress::Silent;
    use crate::registration::points::MemoryPairs;
    use nalgebra::Point3;

    /// A stone of 20 x 20 cm at column `k` with a point every `spacing_m`, which moved by `shift`.
    fn pair(k: u32, spacing_m: f64, shift: Vector3<f64>) -> PairPoints {
        let centroid = Point3::new(0.0, 0.25 * f64::from(k % 20), 0.25 * f64::from(k / 20));
        let side = (0.2 / spacing_m) as i32;
        let at = |i: i32| (f64::from(i) + 0.5) * spacing_m - 0.1;
        let points: Vec<Point3<f64>> = (0..side * side)
            .map(|i| centroid + Vector3::new(0.0, at(i % side), at(i / side)))
            .collect();
        let cloud = || Cloud::from_world(centroid, points.iter().copied());
        PairPoints {
            first: StoneId(k + 1),
            second: StoneId(k + 1),
            centroid,
            centroid_second: centroid + shift,
            normal: Vector3::x(),
            points_first: cloud(),
            points_second: cloud(),
            nearby_second: Cloud::new(centroid, Vec::new()),
            window: None,
        }
    }

    fn surveyed(pairs: &MemoryPairs) -> Survey<'_, MemoryPairs> {
        survey(pairs, &AdjustmentParams::default(), &Silent).unwrap()
    }

    #[test]
    fn one_pass_finds_spacing_batches_and_a_sample_from_everywhere() {
        // One epoch of each stone has a point every 5 mm, the sparser one every centimetre.
        let of_stone = |k: u32| {
            let (sparse, dense) = (pair(k, 0.01, Vector3::zeros()), pair(k, 0.005, Vector3::zeros()));
            match k.is_multiple_of(2) {
                true => PairPoints {
                    points_first: dense.points_first,
                    ..sparse
                },
                false => PairPoints {
                    points_second: dense.points_second,
                    ..sparse
                },
            }
        };
        let pairs = MemoryPairs::new((0..400).map(of_stone).collect());
        let found = surveyed(&pairs);
        assert_eq!(found.stones.len(), 400);
        for (k, stone) in found.stones.iter().enumerate() {
            let counts = if k % 2 == 0 { [1600, 400] } else { [400, 1600] };
            assert!(stone.usable && stone.counts == counts, "{k}: {:?}", stone.counts);
        }
        assert!((found.spacing_m / 0.01 - 1.0).abs() < 1e-6, "{}", found.spacing_m);
        let covered: Vec<usize> = found.points.batches.iter().cloned().flatten().collect();
        assert_eq!(covered, (0..400).collect::<Vec<_>>());
        let kept: Vec<usize> = found.points.sample.iter().map(|s| s.0).collect();
        assert!((SAMPLE / 2..=SAMPLE).contains(&kept.len()), "{}", kept.len());
        assert!(kept.windows(2).all(|k| k[1] - k[0] == kept[1] - kept[0]) && kept[kept.len() - 1] > 380);
    }

    /// Pairs of which some batches cannot be read.
    struct Unreadable(MemoryPairs, &'static [usize]);

    #[derive(Debug, PartialEq, thiserror::Error)]
    #[error("batch {0}")]
    struct Batch(usize);

    impl PairSource for Unreadable {
        type Error = Batch;

        fn batch_count(&self) -> usize {
            self.0.batch_count()
        }

        fn load(&self, batch: usize) -> Result<Vec<PairPoints>, Batch> {
            match self.1.contains(&batch) {
                true => Err(Batch(batch)),
                false => self.0.load(batch).map_err(|_| Batch(batch)),
            }
        }
    }

    #[test]
    fn stones_of_a_group_are_worked_on_in_order_and_the_first_error_counts() {
        let source = |unreadable| {
            let pairs = (0..300).map(|k| pair(k, 0.05, Vector3::zeros()));
            Unreadable(MemoryPairs::new(pairs.collect()), unreadable)
        };
        let every_third = |i: usize| i.is_multiple_of(3) && i < 190;
        let worked = |source: &Unreadable| {
            let points = Points {
                source,
                batches: (0..5).map(|b| 64 * b..(64 * (b + 1)).min(300)).collect(),
                sample: Vec::new(),
                progress: &Silent,
            };
            let groups = points.groups(every_third);
            // Batches of 64 stones: no stone of the fourth and fifth is due.
            assert_eq!(groups.concat(), [0, 1, 2]);
            let of_group = |group: &Vec<usize>| points.of_stones(group, every_third, |_, pair| pair.first);
            groups.iter().map(of_group).collect::<Result<Vec<_>, _>>()
        };
        for threads in [1, 3] {
            stonewise_testing::on_threads(threads, || {
                let all = worked(&source(&[])).unwrap().concat();
                let expected: Vec<(usize, StoneId)> =
                    (0..190).step_by(3).map(|i| (i, StoneId(i as u32 + 1))).collect();
                assert_eq!(all, expected);
                let error = worked(&source(&[1, 2])).unwrap_err();
                assert!(matches!(error, AdjustError::Source(Batch(1))), "{error:?}");
            });
        }
    }

    #[test]
    fn stones_with_few_points_are_kept_but_not_used() {
        let mut pairs: Vec<PairPoints> = (0..12).map(|k| pair(k, 0.01, Vector3::zeros())).collect();
        pairs[4] = pair(4, 0.05, Vector3::zeros());
        let pairs = MemoryPairs::new(pairs);
        let found = surveyed(&pairs);
        let usable: Vec<bool> = found.stones.iter().map(|s| s.usable).collect();
        assert_eq!(usable.iter().filter(|u| !**u).count(), 1);
        assert!(!usable[4] && !found.points.sample.iter().any(|s| s.0 == 4));
    }

    #[test]
    fn one_wrong_centroid_does_not_move_the_first_guess() {
        let shift = Vector3::new(0.001, 0.02, -0.01);
        let wrong = Vector3::new(0.0, 0.3, 0.1);
        let pairs = (0..60).map(|k| pair(k, 0.02, if k == 27 { wrong } else { shift }));
        let pairs = MemoryPairs::new(pairs.collect());
        let found = surveyed(&pairs);
        let places: Vec<Place> = found.stones.iter().map(|s| s.place.clone()).collect();
        let smoothed = smoothed_shifts(&found.stones, &Graph::new(&places, 2).unwrap());
        assert!(
            smoothed.iter().all(|s| (s - shift).norm() < 1e-12),
            "{smoothed:?}"
        );
    }
}
