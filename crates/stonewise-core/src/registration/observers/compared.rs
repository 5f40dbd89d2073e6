//! The sources from which the variances of all are estimated.

use super::observation::Observation;
use super::sight::{Sight, Source};
use std::collections::{BTreeMap, BTreeSet};

/// Sources of an epoch from which the variances of all are estimated: those of 16 are known to a fifth, and the cost grows
/// with the cube of their number.
const MOST: usize = 16;

/// Some sources of each epoch, what they see, and what is observed of them.
pub(super) struct Compared {
    pub sources: Vec<Source>,
    pub sights: Vec<Sight>,
    pub observations: Vec<Observation>,
}

impl Compared {
    /// Sixteen sources of each epoch at most, which see the same stones as each other; `sights`: of all sources.
    pub fn of(sources: &[Source], sights: &[Sight], observations: &[&Observation]) -> Self {
        let own = |source: usize| sources[source].same_as.unwrap_or(source);
        let chosen: BTreeSet<usize> = [0, 1]
            .into_iter()
            .flat_map(|epoch| {
                let is_of = |s: &Sight| sources[own(s.source)].epoch == epoch;
                let seen_with = |o: &&Observation| -> BTreeSet<usize> {
                    o.sights
                        .iter()
                        .filter(|s| is_of(s))
                        .map(|s| own(s.source))
                        .collect()
                };
                overlapping(&observations.iter().map(seen_with).collect::<Vec<_>>())
            })
            .collect();

        let kept: Vec<usize> = (0..sources.len()).filter(|&s| chosen.contains(&own(s))).collect();
        let place = |source: usize| kept.binary_search(&source).ok();
        let of_sight = |sight: &Sight| {
            let source = place(sight.source)?;
            Some(Sight { source, ..*sight })
        };

        let of_observation = |o: &&Observation| {
            let seen: Vec<usize> = (0..o.sights.len())
                .filter(|&k| place(o.sights[k].source).is_some())
                .collect();
            let mut part = (seen.len() >= 2).then(|| o.among(&seen))?;
            part.sights = part.sights.iter().filter_map(of_sight).collect();
            Some(part)
        };

        Self {
            sights: sights.iter().filter_map(of_sight).collect(),
            observations: observations.iter().filter_map(of_observation).collect(),
            sources: kept
                .iter()
                .map(|&s| Source {
                    same_as: sources[s].same_as.and_then(place),
                    ..sources[s].clone()
                })
                .collect(),
        }
    }
}

/// The source that sees most, then again and again the one that sees most of what the chosen ones see; `groups`: who sees
/// the same.
fn overlapping(groups: &[BTreeSet<usize>]) -> BTreeSet<usize> {
    let mut chosen = BTreeSet::new();
    while chosen.len() < MOST {
        let mut shared: BTreeMap<usize, usize> = BTreeMap::new();
        let reached = |group: &&BTreeSet<usize>| chosen.is_empty() || !group.is_disjoint(&chosen);
        for source in groups.iter().filter(reached).flatten() {
            *shared.entry(*source).or_default() += 1;
        }
        shared.retain(|source, _| !chosen.contains(source));
        let Some((next, _)) = shared
            .into_iter()
            .max_by_key(|(source, n)| (*n, usize::MAX - source))
        else {
            break;
        };
        chosen.insert(next);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_of_stations_is_followed_from_the_one_that_sees_most() {
        // Station 40 sees most; each overlaps with the next.
        let mut groups: Vec<BTreeSet<usize>> = (0..80).map(|k| BTreeSet::from([k, k + 1])).collect();
        groups.push(BTreeSet::from([40, 41, 42]));
        let chosen = overlapping(&groups);
        assert_eq!(chosen.len(), MOST);
        assert!(chosen.contains(&40) && chosen.last().unwrap() - chosen.first().unwrap() == MOST - 1);
        let few: Vec<BTreeSet<usize>> = vec![BTreeSet::from([3, 5]), BTreeSet::from([8])];
        assert_eq!(overlapping(&few), BTreeSet::from([3, 5]), "8 is not compared");
    }
}
