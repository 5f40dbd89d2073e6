//! Point or pixel labels against true labels.

use crate::evaluate::detection::share;
use std::collections::{BTreeMap, BTreeSet};

/// How often each pair of (predicted, true) label occurs; 0 is no stone.
///
/// Labels need not use the same numbers. Memory grows with the pairs, not with the points, so a survey is
/// added tile by tile.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LabelConfusion {
    counts: BTreeMap<(u32, u32), u64>,
}

/// How many points carry the right stone.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelScore {
    /// Points of the true stones that are scored.
    pub stone_points: u64,
    /// Points of stones that carry the one label that stands for their stone.
    pub right: u64,
    /// Points of stones without a label.
    pub unlabelled: u64,
    /// Points of stones that carry another label.
    pub wrong: u64,
    /// `right` / `stone_points`.
    pub right_share: Option<f64>,
    /// Points without a true stone.
    pub background_points: u64,
    /// Points without a true stone that carry a label.
    pub false_labels: u64,
    /// Share of right points of each true stone.
    pub per_stone: BTreeMap<u32, f64>,
}

impl LabelConfusion {
    /// Counts one point.
    pub fn add(&mut self, predicted: u32, truth: u32) {
        *self.counts.entry((predicted, truth)).or_default() += 1;
    }

    /// Number of points with this pair of labels.
    pub fn count(&self, predicted: u32, truth: u32) -> u64 {
        self.counts.get(&(predicted, truth)).copied().unwrap_or(0)
    }

    /// All pairs of stones that share points: (predicted, true, points), ascending.
    pub fn overlaps(&self) -> impl Iterator<Item = (u32, u32, u64)> + '_ {
        self.counts
            .iter()
            .filter(|((p, t), _)| *p != 0 && *t != 0)
            .map(|(&(p, t), &n)| (p, t, n))
    }

    /// Points per predicted stone, those on background included.
    pub fn predicted_sizes(&self) -> BTreeMap<u32, u64> {
        self.sizes(|(p, _)| *p)
    }

    /// Points per true stone, those without a label included.
    pub fn true_sizes(&self) -> BTreeMap<u32, u64> {
        self.sizes(|(_, t)| *t)
    }

    /// The true stone of each predicted one, one to one: each is the other's largest overlap.
    ///
    /// A label that covers two stones stands for the one it covers more of; of the pieces of a stone only the
    /// largest stands for it. Ties go to the smaller number.
    pub fn one_to_one(&self) -> BTreeMap<u32, u32> {
        let mut best_truth: BTreeMap<u32, (u64, u32)> = BTreeMap::new();
        let mut best_predicted: BTreeMap<u32, (u64, u32)> = BTreeMap::new();
        for (p, t, n) in self.overlaps() {
            let entry = best_truth.entry(p).or_insert((n, t));
            if n > entry.0 {
                *entry = (n, t);
            }
            let entry = best_predicted.entry(t).or_insert((n, p));
            if n > entry.0 {
                *entry = (n, p);
            }
        }
        best_truth
            .into_iter()
            .filter(|(p, (_, t))| best_predicted.get(t).is_some_and(|(_, back)| back == p))
            .map(|(p, (_, t))| (p, t))
            .collect()
    }

    /// Share of right points among the true stones in `counted` (all of them for `None`).
    pub fn score_labels(&self, counted: Option<&BTreeSet<u32>>) -> LabelScore {
        let truth_of = self.one_to_one();
        let counts = |t: u32| t != 0 && counted.is_none_or(|set| set.contains(&t));
        let mut score = LabelScore {
            stone_points: 0,
            right: 0,
            unlabelled: 0,
            wrong: 0,
            right_share: None,
            background_points: 0,
            false_labels: 0,
            per_stone: BTreeMap::new(),
        };
        let mut right_of: BTreeMap<u32, u64> = BTreeMap::new();

        for (&(p, t), &n) in &self.counts {
            if t == 0 {
                score.background_points += n;
                score.false_labels += if p == 0 { 0 } else { n };
            } else if counts(t) {
                let right = if truth_of.get(&p) == Some(&t) { n } else { 0 };
                score.stone_points += n;
                score.right += right;
                score.unlabelled += if p == 0 { n } else { 0 };
                *right_of.entry(t).or_default() += right;
            }
        }

        score.wrong = score.stone_points - score.right - score.unlabelled;
        score.right_share = share(score.right as usize, score.stone_points as usize);
        let sizes = self.true_sizes();
        score.per_stone = right_of
            .into_iter()
            .filter_map(|(t, right)| Some((t, right as f64 / *sizes.get(&t)? as f64)))
            .collect();
        score
    }

    fn sizes(&self, label: impl Fn(&(u32, u32)) -> u32) -> BTreeMap<u32, u64> {
        let mut sizes = BTreeMap::new();
        for (pair, n) in self.counts.iter().filter(|(pair, _)| label(pair) != 0) {
            *sizes.entry(label(pair)).or_default() += n;
        }
        sizes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Predicted, true, points: 7 merges stones 1 and 2; stone 3 is split into 8 and 9; 4 is right but for 2
    /// points; 10 is invented.
    const SPOILT: [(u32, u32, u64); 7] = [
        (7, 1, 60),
        (7, 2, 40),
        (8, 3, 30),
        (9, 3, 50),
        (4, 4, 98),
        (0, 4, 2),
        (10, 0, 20),
    ];

    fn confusion(pairs: &[(u32, u32, u64)]) -> LabelConfusion {
        let mut c = LabelConfusion::default();
        for &(p, t, n) in pairs {
            (0..n).for_each(|_| c.add(p, t));
        }
        c
    }

    #[test]
    fn merged_and_split_stones_count_once() {
        let mut c = confusion(&SPOILT);
        (0..80).for_each(|_| c.add(0, 0));
        assert_eq!(c.one_to_one(), BTreeMap::from([(4, 4), (7, 1), (9, 3)]));
        let score = c.score_labels(None);
        assert_eq!(
            (score.stone_points, score.right, score.unlabelled, score.wrong),
            (280, 208, 2, 70)
        );
        assert_eq!((score.background_points, score.false_labels), (100, 20));
        assert_eq!(score.per_stone[&2], 0.0);
        assert_eq!(score.per_stone[&4], 0.98);
        let only = c.score_labels(Some(&BTreeSet::from([4])));
        assert_eq!((only.right_share, only.per_stone.len()), (Some(0.98), 1));
    }
}
