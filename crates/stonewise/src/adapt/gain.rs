//! Whether one detector is better than another.

use super::agreement::Counts;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};

/// Draws of the bootstrap.
const DRAWS: usize = 2000;
/// Seed of the bootstrap.
const SEED: u64 = 1;

/// Change of F1 from one detector to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// In all parts of the wall.
    pub mean: f64,
    /// Its 95 % interval; absent where it cannot be given.
    pub interval: Option<[f64; 2]>,
}

/// The counts of both detectors in each part of the wall. In each part, the number of references is that of the
/// detector that confirms more stones, so that finding fewer stones is not a gain.
pub fn both<B: Ord + Copy>(before: &BTreeMap<B, Counts>, after: &BTreeMap<B, Counts>) -> Vec<[Counts; 2]> {
    let parts: BTreeSet<B> = before.keys().chain(after.keys()).copied().collect();
    let of_part = |part: B| {
        let both = [before, after].map(|counts| counts.get(&part).copied().unwrap_or_default());
        let references = both[0].references.max(both[1].references);
        both.map(|counts| Counts { references, ..counts })
    };
    parts.into_iter().map(of_part).collect()
}

/// The sum of the counts of some parts.
pub fn sum<'a>(parts: impl IntoIterator<Item = &'a [Counts; 2]>) -> [Counts; 2] {
    parts
        .into_iter()
        .fold(Default::default(), |[b, a]: [Counts; 2], part| {
            [b.plus(&part[0]), a.plus(&part[1])]
        })
}

impl Gain {
    /// From the counts before and after in each part of the wall.
    ///
    /// The interval is a percentile bootstrap over parts (Efron 1979).
    pub fn of(parts: &[[Counts; 2]]) -> Self {
        let gain = |[before, after]: [Counts; 2]| after.f1() - before.f1();
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut draws: Vec<f64> = (0..DRAWS)
            .map(|_| {
                let drawn: Vec<usize> = parts.iter().map(|_| rng.random_range(0..parts.len())).collect();
                gain(sum(drawn.iter().map(|&i| &parts[i])))
            })
            .collect();
        draws.sort_by(f64::total_cmp);
        let quantile = |q: f64| draws[((DRAWS - 1) as f64 * q).round() as usize];
        Self {
            mean: gain(sum(parts)),
            interval: (parts.len() > 1).then(|| [quantile(0.025), quantile(0.975)]),
        }
    }

    /// Whether the gain is more than chance.
    pub fn is_shown(&self) -> bool {
        self.interval.is_some_and(|[low, _]| low > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six parts of the wall with ten stones each; `right` of them are found, and one mask is false.
    fn parts(right: [usize; 6]) -> BTreeMap<usize, Counts> {
        let part = |right: usize| Counts {
            found: right + 1,
            right,
            references: 10,
        };
        right.into_iter().map(part).enumerate().collect()
    }

    fn gain(before: [usize; 6], after: [usize; 6]) -> Gain {
        Gain::of(&both(&parts(before), &parts(after)))
    }

    #[test]
    fn a_gain_everywhere_is_shown_and_one_in_a_single_part_is_not() {
        let before = [5, 6, 7, 5, 6, 7];
        let everywhere = gain(before, [7, 8, 8, 7, 8, 9]);
        // 36 and 47 of 60 stones, six false ones.
        let f1 = |right: f64| 2.0 * right / (right + 6.0 + 60.0);
        assert!((everywhere.mean - (f1(47.0) - f1(36.0))).abs() < 1e-12);
        assert!(everywhere.is_shown());
        let in_one = gain(before, [5, 6, 7, 5, 6, 10]);
        assert!(in_one.mean > 0.0 && !in_one.is_shown(), "{in_one:?}");
        let none = gain(before, before);
        assert_eq!((none.mean, none.is_shown()), (0.0, false));
        // A single part says nothing about other parts.
        let one = |right| [(0, parts([right; 6])[&0])].into();
        assert_eq!(Gain::of(&both(&one(5), &one(9))).interval, None);
    }

    #[test]
    fn a_detector_that_confirms_less_does_not_gain() {
        let fewer = Counts {
            found: 5,
            right: 5,
            references: 5,
        };
        let before = parts([8; 6]);
        let after: BTreeMap<usize, Counts> = before.keys().map(|part| (*part, fewer)).collect();
        let gain = Gain::of(&both(&before, &after));
        assert!(gain.mean < 0.0, "{gain:?}");
        // A part in which a detector finds nothing counts as well.
        let [all, none] = sum(&both(&before, &BTreeMap::new()));
        assert_eq!([all.references, none.references, none.found], [60, 60, 0]);
    }
}
