//! Matches across epochs against true identities.

use crate::evaluate::detection::share;
use crate::id::StoneId;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// How many stones were matched to themselves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MatchScore {
    /// True stones that should be matched.
    pub reference: usize,
    /// Of these, stones with a match of which both sides are this stone.
    pub right: usize,
    /// `right` / `reference`.
    pub right_share: Option<f64>,
    /// Matches whose two sides are different true stones.
    pub wrong: usize,
    /// `wrong` / all matches with two known sides.
    pub wrong_share: Option<f64>,
    /// Matches with a side that stands for no true stone.
    pub unknown: usize,
}

/// Scores matches by the true stone that each side stands for.
pub fn score_matches(
    matches: &[(StoneId, StoneId)],
    first: &BTreeMap<StoneId, StoneId>,
    second: &BTreeMap<StoneId, StoneId>,
    reference: &BTreeSet<StoneId>,
) -> MatchScore {
    let mut right = BTreeSet::new();
    let (mut known, mut wrong, mut unknown) = (0, 0, 0);
    for (a, b) in matches {
        match (first.get(a), second.get(b)) {
            (Some(t1), Some(t2)) => {
                known += 1;
                if t1 != t2 {
                    wrong += 1;
                } else if reference.contains(t1) {
                    right.insert(*t1);
                }
            }
            _ => unknown += 1,
        }
    }
    MatchScore {
        reference: reference.len(),
        right: right.len(),
        right_share: share(right.len(), reference.len()),
        wrong,
        wrong_share: share(wrong, known),
        unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_wrong_and_unknown_matches_are_told_apart() {
        let ids = |pairs: [(u32, u32); 4]| pairs.map(|(a, b)| (StoneId(a), StoneId(b)));
        let first = BTreeMap::from(ids([(1, 101), (2, 102), (3, 103), (5, 105)]));
        let second = BTreeMap::from(ids([(11, 101), (12, 103), (13, 102), (15, 105)]));
        let pairs = ids([(1, 11), (2, 12), (4, 13), (5, 15)]);
        let score = score_matches(
            &pairs,
            &first,
            &second,
            &BTreeSet::from([101, 102, 103, 104].map(StoneId)),
        );
        assert_eq!(
            (score.reference, score.right, score.wrong, score.unknown),
            (4, 1, 1, 1)
        );
        assert_eq!(score.wrong_share, Some(1.0 / 3.0));
    }
}
