//! The majority of the photos.

use super::overlap::Overlaps;
use super::visibility::Sighting;

/// What an instance votes for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Ballot {
    /// One stone.
    One(u32),
    /// Whichever of these stones the other photos see at a point: a mask that merges them.
    AnyOf(Vec<u32>),
    /// Nothing: an instance that the majority does not confirm.
    Nothing,
}

/// What the votes of all photos come to at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Verdict {
    /// Stone, or `None` for background.
    pub stone: Option<u32>,
    /// Share of the weight of all votes that agree, 0..1.
    pub share: f64,
}

/// The ballots of all instances, ready to be counted.
pub(super) struct Electorate<'a> {
    overlaps: &'a Overlaps,
    ballots: Vec<Ballot>,
    /// One bit a photo, stone by stone: whether it shows a part of the stone.
    shown: Vec<u64>,
    /// Words of `shown` for each stone.
    words: usize,
    border_weight: f64,
}

impl<'a> Electorate<'a> {
    pub(super) fn new(overlaps: &'a Overlaps, ballots: Vec<Ballot>, border_weight: f64) -> Self {
        let photos = overlaps.instances.iter().map(|i| i.photo as usize + 1).max();
        let words = photos.unwrap_or(0).div_ceil(64);
        let mut shown = Vec::new();
        for (instance, ballot) in overlaps.instances.iter().zip(&ballots) {
            let stones: &[u32] = match ballot {
                Ballot::One(stone) => std::slice::from_ref(stone),
                Ballot::AnyOf(stones) => stones,
                Ballot::Nothing => &[],
            };
            for &stone in stones {
                let at = stone as usize * words + instance.photo as usize / 64;
                shown.resize(shown.len().max(at + 1), 0);
                shown[at] |= 1 << (instance.photo % 64);
            }
        }
        Self {
            overlaps,
            ballots,
            shown,
            words,
            border_weight,
        }
    }

    pub(super) fn ballots(&self) -> &[Ballot] {
        &self.ballots
    }

    /// Whether a photo shows a part of the stone.
    pub(super) fn shows(&self, stone: u32, photo: u32) -> bool {
        // A photo without instances has no bit, where another stone's could be.
        let word = photo as usize / 64;
        let bits = self.shown.get(stone as usize * self.words + word);
        word < self.words && bits.is_some_and(|bits| bits >> (photo % 64) & 1 == 1)
    }

    /// The stone for which every sighting votes with a weight above zero; most points on stones have one.
    fn unanimous(&self, sightings: &[Sighting]) -> Option<u32> {
        let vote = |s: &Sighting| match self.ballots[self.overlaps.find(s.photo, s.instance)? as usize] {
            Ballot::One(stone) if s.weight > 0.0 => Some(stone),
            _ => None,
        };
        let (first, others) = sightings.split_first()?;
        let stone = vote(first)?;
        others.iter().all(|s| vote(s) == Some(stone)).then_some(stone)
    }

    /// Counts the votes at a point; `None` where no photo votes.
    ///
    /// Background counts against a stone only in photos that show the stone elsewhere, because only there a
    /// border was drawn. A photo that does not show the stone at all was counted when the stone as a whole
    /// was accepted; here it only lowers the share. Between a stone and background a tie goes to the stone,
    /// between stones to the lower index.
    pub(super) fn count(&self, sightings: &[Sighting]) -> Option<Verdict> {
        if let Some(stone) = self.unanimous(sightings) {
            return Some(Verdict {
                stone: Some(stone),
                share: 1.0,
            });
        }
        let mut tally: Vec<(u32, f64)> = Vec::with_capacity(4);
        let mut total = 0.0;
        let mut undecided: Vec<(f64, &[u32])> = Vec::new();
        let mut background = 0.0;

        for s in sightings {
            let weight = f64::from(s.weight);
            match self
                .overlaps
                .find(s.photo, s.instance)
                .map(|i| &self.ballots[i as usize])
            {
                None => background += weight,
                Some(Ballot::One(stone)) => cast(&mut tally, *stone, weight),
                Some(Ballot::AnyOf(stones)) => undecided.push((weight, stones)),
                Some(Ballot::Nothing) => continue,
            }
            total += weight;
        }

        for (weight, stones) in undecided {
            if let Some((stone, _)) = leader(tally.iter().filter(|t| stones.contains(&t.0))) {
                cast(&mut tally, stone, weight);
            }
        }

        if total <= 0.0 {
            return None;
        }
        let Some((stone, votes)) = leader(tally.iter()) else {
            // Only background, or only merged masks, which cannot say which stone it is.
            return (background > 0.0).then_some(Verdict {
                stone: None,
                share: background / total,
            });
        };
        let against: f64 = sightings
            .iter()
            .filter(|s| self.overlaps.find(s.photo, s.instance).is_none())
            .filter(|s| self.shows(stone, s.photo))
            .map(|s| f64::from(s.weight) * self.border_weight)
            .sum();

        Some(if votes >= against {
            Verdict {
                stone: Some(stone),
                share: votes / total,
            }
        } else {
            Verdict {
                stone: None,
                share: background / total,
            }
        })
    }
}

fn cast(tally: &mut Vec<(u32, f64)>, stone: u32, weight: f64) {
    match tally.iter_mut().find(|t| t.0 == stone) {
        Some(entry) => entry.1 += weight,
        None => tally.push((stone, weight)),
    }
}

/// The entry with most votes, the lower stone among equals.
fn leader<'t>(tally: impl Iterator<Item = &'t (u32, f64)>) -> Option<(u32, f64)> {
    tally.copied().reduce(|best, t| {
        if t.1 > best.1 || (t.1 == best.1 && t.0 < best.0) {
            t
        } else {
            best
        }
    })
}

#[cfg(test)]
mod tests {
    use super::super::overlap::Instance;
    use super::*;

    #[test]
    fn only_votes_that_count_and_agree_are_unanimous() {
        let instance = |photo| Instance {
            photo,
            label: 1,
            area: 1,
        };
        let overlaps = Overlaps::of_instances((0..3).map(instance).collect());
        let ballots = vec![Ballot::One(4), Ballot::One(4), Ballot::One(5)];
        let electorate = Electorate::new(&overlaps, ballots, 1.0);
        let sighting = |(photo, instance, weight)| Sighting {
            photo,
            instance,
            weight,
        };
        let count = |votes: [(u32, u32, f32); 2]| {
            let verdict = electorate.count(&votes.map(sighting));
            verdict.map(|v| (v.stone, v.share))
        };
        assert_eq!(count([(0, 1, 0.5), (1, 1, 2.0)]), Some((Some(4), 1.0)));
        assert_eq!(count([(0, 1, 0.0), (1, 1, 0.0)]), None);
        assert_eq!(count([(0, 1, 3.0), (2, 1, 1.0)]), Some((Some(4), 0.75)));
        assert_eq!(count([(0, 1, 3.0), (1, 0, 1.0)]), Some((Some(4), 0.75)));
    }
}
