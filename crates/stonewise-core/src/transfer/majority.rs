//! Merged and fragmented instances, decided by the majority of the photos that see their points.

use super::TransferParams;
use super::atoms::{Atom, Atoms};
use super::overlap::Overlaps;
use super::visibility::Sighting;
use super::vote::{Ballot, Electorate};
use std::collections::BTreeMap;

/// Rounds of decisions; each may change what the majority is for the next.
const MAX_ROUNDS: usize = 8;
/// An instance must cover at least this share of a stone to have merged it, not just to reach over its
/// border.
const COVERED_SHARE: f64 = 0.5;

/// Why an instance's ballot is not the group it was assigned to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Decision {
    /// It covers several stones.
    Merged(Vec<u32>),
    /// It is a part of this stone, which wins this share of it.
    Fragment(u32, f64),
    /// Its group is gone; it won this share of its area.
    Outvoted(f64),
}

/// The ballots after all decisions, with the decision of each instance that was overruled.
pub(super) fn decide<'a>(
    overlaps: &'a Overlaps,
    groups: &[Vec<u32>],
    atoms: &Atoms,
    params: &TransferParams,
) -> (Electorate<'a>, BTreeMap<u32, Decision>) {
    let mut ballots = vec![Ballot::Nothing; overlaps.instances.len()];
    for (stone, group) in (0..).zip(groups) {
        for &i in group {
            ballots[i as usize] = Ballot::One(stone);
        }
    }

    let mut decisions = BTreeMap::new();
    let mut electorate = Electorate::new(overlaps, ballots, params.border_weight);
    for _ in 0..MAX_ROUNDS {
        let tables = Tables::count(&electorate, overlaps, atoms);
        let changes = changes(&electorate, &tables, params);
        if changes.is_empty() {
            break;
        }
        let mut ballots = electorate.ballots().to_vec();
        for (i, decision) in changes {
            ballots[i as usize] = match &decision {
                Decision::Merged(stones) => Ballot::AnyOf(stones.clone()),
                Decision::Fragment(stone, _) => Ballot::One(*stone),
                Decision::Outvoted(_) => Ballot::Nothing,
            };
            decisions.insert(i, decision);
        }
        electorate = Electorate::new(overlaps, ballots, params.border_weight);
    }

    (electorate, decisions)
}

/// Who wins where, under the ballots of a round.
struct Tables {
    /// Area of each instance won by each stone.
    won: Vec<BTreeMap<u32, u32>>,
    /// Area of each instance.
    area: Vec<u32>,
    /// Area won by a stone where a photo sees it, keyed (stone, photo).
    seen: BTreeMap<(u32, u32), u32>,
    /// Votes for each stone, and of photos that show background where others show it and do not show it
    /// elsewhere: weight times area.
    support: BTreeMap<u32, [f64; 2]>,
    photo: Vec<u32>,
}

impl Tables {
    fn count(electorate: &Electorate, overlaps: &Overlaps, atoms: &Atoms) -> Self {
        let mut tables = Self {
            won: vec![BTreeMap::new(); overlaps.instances.len()],
            area: overlaps.instances.iter().map(|i| i.area).collect(),
            seen: BTreeMap::new(),
            support: BTreeMap::new(),
            photo: overlaps.instances.iter().map(|i| i.photo).collect(),
        };
        for atom in atoms.iter() {
            tables.count_support(electorate, overlaps, atom);
            let Some(stone) = electorate.count(atom.sightings).and_then(|v| v.stone) else {
                continue;
            };
            for s in atom.sightings {
                *tables.seen.entry((stone, s.photo)).or_insert(0) += atom.area;
                if let Some(i) = overlaps.find(s.photo, s.instance) {
                    *tables.won[i as usize].entry(stone).or_insert(0) += atom.area;
                }
            }
        }
        tables
    }

    fn count_support(&mut self, electorate: &Electorate, overlaps: &Overlaps, atom: Atom) {
        let weight = |s: &Sighting| f64::from(s.weight) * f64::from(atom.area);
        let mut votes: BTreeMap<u32, f64> = BTreeMap::new();
        for s in atom.sightings {
            let ballot = overlaps
                .find(s.photo, s.instance)
                .map(|i| &electorate.ballots()[i as usize]);
            if let Some(Ballot::One(stone)) = ballot {
                *votes.entry(*stone).or_default() += weight(s);
            }
        }
        for (stone, votes) in votes {
            let missed: f64 = atom
                .sightings
                .iter()
                .filter(|s| s.instance == 0 && !electorate.shows(stone, s.photo))
                .map(weight)
                .sum();
            let entry = self.support.entry(stone).or_default();
            entry[0] += votes;
            entry[1] += missed;
        }
    }

    /// Share of the votes about a stone as a whole that are for it, those of photos that miss it counted at
    /// `missed_weight`.
    fn acceptance(&self, stone: u32, missed_weight: f64) -> f64 {
        let [votes, missed] = self.support.get(&stone).copied().unwrap_or_default();
        votes / (votes + missed_weight * missed).max(f64::MIN_POSITIVE)
    }

    fn share(&self, instance: u32, stone: u32) -> f64 {
        let won = self.won[instance as usize].get(&stone).copied().unwrap_or(0);
        f64::from(won) / f64::from(self.area[instance as usize].max(1))
    }

    /// Share of what a photo sees of a stone that this instance covers.
    fn coverage(&self, instance: u32, stone: u32) -> f64 {
        let won = self.won[instance as usize].get(&stone).copied().unwrap_or(0);
        let seen = self.seen.get(&(stone, self.photo[instance as usize]));
        f64::from(won) / f64::from(seen.copied().unwrap_or(0).max(1))
    }

    /// Stones of which an instance covers most and which are a considerable part of it.
    fn contained(&self, instance: u32, min_share: f64) -> Vec<u32> {
        self.won[instance as usize]
            .keys()
            .copied()
            .filter(|&stone| {
                self.share(instance, stone) >= min_share && self.coverage(instance, stone) >= COVERED_SHARE
            })
            .collect()
    }
}

/// Ballots to be changed: merged masks first, then fragments, then stones that lost their vote.
fn changes(electorate: &Electorate, tables: &Tables, params: &TransferParams) -> Vec<(u32, Decision)> {
    let singles = || {
        (0..)
            .zip(electorate.ballots())
            .filter_map(|(i, ballot): (u32, _)| match ballot {
                Ballot::One(stone) => Some((i, *stone)),
                _ => None,
            })
    };

    let merged: Vec<_> = singles()
        .filter_map(|(i, _)| {
            let stones = tables.contained(i, params.merged_share);
            (stones.len() > 1).then_some((i, Decision::Merged(stones)))
        })
        .collect();
    if !merged.is_empty() {
        return merged;
    }
    let fragments: Vec<_> = singles()
        .filter_map(|(i, own)| {
            let (&stone, _) = tables.won[i as usize]
                .iter()
                .max_by_key(|(stone, won)| (**won, u32::MAX - **stone))?;
            let share = tables.share(i, stone);
            (stone != own && share > 0.5).then_some((i, Decision::Fragment(stone, share)))
        })
        .collect();

    if !fragments.is_empty() {
        return fragments;
    }
    let mut balance: BTreeMap<u32, (u64, u64)> = BTreeMap::new();

    for (i, stone) in singles() {
        let entry = balance.entry(stone).or_default();
        entry.0 += u64::from(tables.won[i as usize].get(&stone).copied().unwrap_or(0));
        entry.1 += u64::from(tables.area[i as usize]);
    }

    singles()
        .filter_map(|(i, stone)| {
            let (won, all) = balance[&stone];
            let share = won as f64 / all.max(1) as f64;
            let lost = share < params.min_won_share || tables.acceptance(stone, params.missed_weight) < 0.5;
            lost.then_some((i, Decision::Outvoted(share)))
        })
        .collect()
}
