//! Whether a detector finds more than another.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use stonewise_segment::evaluation::{MaskScore, PhotoPairs};

/// Draws of the bootstrap.
const DRAWS: usize = 2000;
/// Seed of the bootstrap.
const SEED: u64 = 1;

/// Change of F1 from one detector to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// On all images.
    pub mean: f64,
    /// Its 95 % interval; absent where it cannot be given.
    pub interval: Option<[f64; 2]>,
}

impl Gain {
    /// From the stones found in the same images before and after. `block`: the part of the wall in which a
    /// reference stone lies; images of one part are drawn together, because they show the same stones.
    ///
    /// The interval is a percentile bootstrap over parts (Efron 1979).
    pub fn of<B: Ord>(before: &[PhotoPairs], after: &[PhotoPairs], block: impl Fn(u32) -> Option<B>) -> Self {
        let mut parts: BTreeMap<Option<B>, [Counts; 2]> = BTreeMap::new();
        for (before, after) in before.iter().zip(after) {
            let part = before.references.first().and_then(|&label| block(label));
            let [b, a] = parts.entry(part).or_default();
            b.add(before);
            a.add(after);
        }
        let parts: Vec<[Counts; 2]> = parts.into_values().collect();
        let gain = |chosen: &mut dyn Iterator<Item = &[Counts; 2]>| {
            let [before, after] = chosen.fold([Counts::default(); 2], |[b, a], part| {
                [b.plus(&part[0]), a.plus(&part[1])]
            });
            after.f1() - before.f1()
        };
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut draws: Vec<f64> = (0..DRAWS)
            .map(|_| {
                let drawn: Vec<usize> = parts.iter().map(|_| rng.random_range(0..parts.len())).collect();
                gain(&mut drawn.iter().map(|&i| &parts[i]))
            })
            .collect();
        draws.sort_by(f64::total_cmp);
        let quantile = |q: f64| draws[((DRAWS - 1) as f64 * q).round() as usize];
        Self {
            mean: gain(&mut parts.iter()),
            interval: (parts.len() > 1).then(|| [quantile(0.025), quantile(0.975)]),
        }
    }

    /// Whether the gain is more than chance.
    pub fn is_shown(&self) -> bool {
        self.interval.is_some_and(|[low, _]| low > 0.0)
    }
}

/// Stones found, right ones among them, and reference stones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Counts {
    found: usize,
    right: usize,
    references: usize,
}

impl Counts {
    fn add(&mut self, pairs: &PhotoPairs) {
        let score = MaskScore::of(std::slice::from_ref(pairs));
        *self = self.plus(&Self {
            found: score.found,
            right: score.right,
            references: score.references,
        });
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            found: self.found + other.found,
            right: self.right + other.right,
            references: self.references + other.references,
        }
    }

    /// Twice what is right over what was found and what is there (van Rijsbergen 1979); 0 without either.
    fn f1(&self) -> f64 {
        2.0 * self.right as f64 / ((self.found + self.references) as f64).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_segment::evaluation::FoundStone;

    /// An image with ten stones of a part of the wall, of which `right` are found, and one false stone.
    fn image(part: u32, right: u32) -> PhotoPairs {
        let stone = |label: u32, reference: Option<u32>| FoundStone {
            label,
            score: 0.9,
            iou: reference.map(|_| 0.8),
            reference,
            is_unknown: false,
        };
        let references: Vec<u32> = (10 * part..10 * part + 10).collect();
        let right = references.iter().take(right as usize).map(|&r| stone(r, Some(r)));
        PhotoPairs {
            found: right.chain([stone(1000, None)]).collect(),
            references,
        }
    }

    fn images(right: [u32; 6]) -> Vec<PhotoPairs> {
        (0..).zip(right).map(|(part, right)| image(part, right)).collect()
    }

    #[test]
    fn a_gain_everywhere_is_shown_and_one_in_a_single_part_is_not() {
        let part = |label: u32| Some(label / 10);
        let before = images([5, 6, 7, 5, 6, 7]);
        let everywhere = Gain::of(&before, &images([7, 8, 8, 7, 8, 9]), part);
        // 36 and 47 of 60 stones, six false ones.
        let f1 = |right: f64| 2.0 * right / (right + 6.0 + 60.0);
        assert!((everywhere.mean - (f1(47.0) - f1(36.0))).abs() < 1e-12);
        assert!(everywhere.is_shown());
        let in_one = Gain::of(&before, &images([5, 6, 7, 5, 6, 10]), part);
        assert!(in_one.mean > 0.0 && !in_one.is_shown(), "{in_one:?}");
        let none = Gain::of(&before, &before, part);
        assert_eq!((none.mean, none.is_shown()), (0.0, false));
        // Images of one part alone say nothing about others.
        assert_eq!(Gain::of(&before, &images([9; 6]), |_| Some(0)).interval, None);
    }
}
