//! Stones that the reference does not show, followed through the epochs that do.

use super::{MatchParams, Surroundings, match_stones};
use crate::id::StoneId;
use crate::stone::{MatchOutcome, Stone};
use std::collections::BTreeSet;

/// The stones of a later epoch.
#[derive(Clone, Copy, Debug)]
pub struct LaterStones<'a> {
    /// All of them.
    pub stones: &'a [Stone],
    /// Stones of this epoch that are stones of the reference.
    pub known: &'a BTreeSet<StoneId>,
}

/// A stone that the reference does not show.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// The stone in the first epoch that shows it, with a number of its own.
    pub stone: Stone,
    /// Its number in each epoch, in the order given; `None`: not shown.
    pub seen: Vec<Option<StoneId>>,
}

impl Track {
    /// The first epoch that shows it, by its place among those given.
    pub fn first(&self) -> usize {
        self.seen.iter().position(Option::is_some).unwrap_or(0)
    }
}

/// Follows the stones that the reference does not contain through the later epochs, given in the order of time, and
/// keeps those that two epochs show.
///
/// Each epoch is matched with the reference's stones and the followed ones together, so that the latter move with their
/// neighbours. Numbers follow the largest of the reference. Cost: a match of stone tables for each epoch.
pub fn tracks(reference: &[Stone], epochs: &[LaterStones], params: &MatchParams) -> Vec<Track> {
    let last = reference.iter().map(|s| s.id.0).max().unwrap_or(0);
    let mut next = last + 1;
    let mut followed: Vec<Track> = Vec::new();

    for (place, epoch) in epochs.iter().enumerate() {
        let mut taken = epoch.known.clone();
        if !followed.is_empty() {
            let all: Vec<Stone> = reference
                .iter()
                .cloned()
                .chain(followed.iter().map(|t| t.stone.clone()))
                .collect();
            let surroundings = Surroundings {
                covered: &|_| true,
                overlap: None,
            };
            let report = match_stones(&all, epoch.stones, &surroundings, params);
            for track in &mut followed {
                let outcome = report.outcomes.binary_search_by_key(&track.stone.id, |o| o.0);
                let partner = match outcome.map(|i| report.outcomes[i].1) {
                    Ok(MatchOutcome::Matched { second }) if !taken.contains(&second) => Some(second),
                    _ => None,
                };
                track.seen[place] = partner;
                taken.extend(partner);
            }
        }
        for stone in epoch.stones.iter().filter(|s| !taken.contains(&s.id)) {
            let mut seen = vec![None; epochs.len()];
            seen[place] = Some(stone.id);
            let stone = Stone {
                id: StoneId(next),
                ..stone.clone()
            };
            followed.push(Track { stone, seen });
            next += 1;
        }
    }

    followed.retain(|t| t.seen.iter().flatten().count() > 1);
    for (number, track) in (last + 1..).zip(&mut followed) {
        track.stone.id = StoneId(number);
    }
    followed
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    /// A wall that settles by 2 mm an epoch; other numbers in each epoch.
    fn wall(epoch: u32) -> Vec<Stone> {
        let stone = |k: u32| Stone {
            id: StoneId((k * 7 + epoch * 13) % 48 + 1),
            centroid: Point3::new(
                0.0,
                0.3 * f64::from(k % 8) + 0.03 * f64::from(k * k % 7),
                0.2 * f64::from(k / 8) - 0.002 * f64::from(epoch),
            ),
            normal: Vector3::x(),
            area_m2: 0.04 + 0.002 * f64::from(k % 5),
            points: 400,
            photos: 3,
            confidence: 1.0,
        };
        (0..48).map(stone).collect()
    }

    /// The number of stone `k` of an epoch.
    fn number(k: u32, epoch: u32) -> StoneId {
        wall(epoch)[k as usize].id
    }

    #[test]
    fn a_stone_that_the_reference_misses_is_followed_through_gaps() {
        // The reference misses stones 20 and 33; epoch 2 misses 20 as well, epoch 3 misses 33; 5 is seen by epoch 1 alone.
        let without = |epoch: u32, missing: &[u32]| -> Vec<Stone> {
            let missing: Vec<StoneId> = missing.iter().map(|k| number(*k, epoch)).collect();
            wall(epoch)
                .into_iter()
                .filter(|s| !missing.contains(&s.id))
                .collect()
        };
        let reference = without(0, &[20, 33, 5]);
        let later = [
            without(1, &[]),
            without(2, &[20, 5]),
            without(3, &[33, 5]),
            without(4, &[5]),
        ];
        let known: Vec<BTreeSet<StoneId>> = (1..5)
            .map(|e| {
                (0..48)
                    .filter(|k| ![20, 33, 5].contains(k))
                    .map(|k| number(k, e))
                    .collect()
            })
            .collect();
        let epochs: Vec<LaterStones> = later
            .iter()
            .zip(&known)
            .map(|(stones, known)| LaterStones { stones, known })
            .collect();
        let found = tracks(&reference, &epochs, &MatchParams::default());
        let seen = |k: u32, missing: u32| -> Vec<Option<StoneId>> {
            (1..5).map(|e| (e != missing).then(|| number(k, e))).collect()
        };
        assert_eq!(found.len(), 2, "{found:?}");
        let last = reference.iter().map(|s| s.id.0).max().unwrap();
        for (k, missing) in [(20, 2), (33, 3)] {
            let track = found.iter().find(|t| t.seen == seen(k, missing)).unwrap();
            assert_eq!(track.first(), 0);
            assert!(track.stone.id.0 > last && track.stone.id.0 <= last + 2);
        }
    }
}
