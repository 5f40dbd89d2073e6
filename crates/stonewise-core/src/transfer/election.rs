//! What the photos as a whole decided about their instances, before any single point is labelled.

use super::TransferError;
use super::bytes::{Reader, Writer};
use super::majority::Decision;
use super::overlap::{Instance, Overlaps};
use super::vote::{Ballot, Electorate};
use crate::geometry::View;
use std::collections::BTreeMap;

/// The ballots of all instances, and how they came about.
pub struct Election {
    /// Positions of the views that have masks.
    pub(super) masked: Vec<u32>,
    pub(super) overlaps: Overlaps,
    pub(super) ballots: Vec<Ballot>,
    pub(super) decisions: BTreeMap<u32, Decision>,
    /// Median point spacing of the whole cloud, metres.
    pub(super) spacing_m: f64,
}

impl Election {
    /// Ready to count votes.
    pub(super) fn electorate(&self, border_weight: f64) -> Electorate<'_> {
        Electorate::new(&self.overlaps, self.ballots.clone(), border_weight)
    }

    /// The views that have masks, in order.
    pub(super) fn views<'a>(&self, views: &'a [View]) -> Result<Vec<&'a View>, TransferError> {
        let view = |&i: &u32| views.get(i as usize).ok_or(TransferError::Damaged);
        self.masked.iter().map(view).collect()
    }

    /// Encodes the election as bytes, for [`Self::decode`].
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Writer::default();
        out.f64(self.spacing_m);
        out.list(self.masked.iter(), |out, &view| out.u32(view));
        out.list(self.overlaps.instances.iter(), |out, instance| {
            [instance.photo, instance.label, instance.area]
                .iter()
                .for_each(|&v| out.u32(v));
        });
        out.list(self.ballots.iter(), |out, ballot| match ballot {
            Ballot::Nothing => out.u32(0),
            Ballot::One(stone) => [1, *stone].iter().for_each(|&v| out.u32(v)),
            Ballot::AnyOf(stones) => {
                out.u32(2);
                out.list(stones.iter(), |out, &stone| out.u32(stone));
            }
        });

        out.list(self.decisions.iter(), |out, (&instance, decision)| {
            out.u32(instance);
            match decision {
                Decision::Merged(stones) => {
                    out.u32(0);
                    out.list(stones.iter(), |out, &stone| out.u32(stone));
                }
                Decision::Fragment(stone, share) => {
                    [1, *stone].iter().for_each(|&v| out.u32(v));
                    out.f64(*share);
                }
                Decision::Outvoted(share) => {
                    out.u32(2);
                    out.f64(*share);
                }
            }
        });

        out.0
    }

    /// From bytes.
    ///
    /// # Errors
    /// They are not those of an election.
    pub fn decode(bytes: &[u8]) -> Result<Self, TransferError> {
        let mut bytes = Reader(bytes);
        let spacing_m = bytes.f64()?;
        let masked = bytes.list(Reader::u32)?;
        let instances = bytes.list(|bytes| {
            Ok(Instance {
                photo: bytes.u32()?,
                label: bytes.u32()?,
                area: bytes.u32()?,
            })
        })?;
        let ballots = bytes.list(|bytes| match bytes.u32()? {
            0 => Ok(Ballot::Nothing),
            1 => Ok(Ballot::One(bytes.u32()?)),
            2 => Ok(Ballot::AnyOf(bytes.list(Reader::u32)?)),
            _ => Err(TransferError::Damaged),
        })?;

        let decisions = bytes.list(|bytes| {
            let instance = bytes.u32()?;
            let decision = match bytes.u32()? {
                0 => Decision::Merged(bytes.list(Reader::u32)?),
                1 => Decision::Fragment(bytes.u32()?, bytes.f64()?),
                2 => Decision::Outvoted(bytes.f64()?),
                _ => return Err(TransferError::Damaged),
            };
            Ok((instance, decision))
        })?;
        if ballots.len() != instances.len() || instances.iter().any(|i| i.photo as usize >= masked.len()) {
            return Err(TransferError::Damaged);
        }

        Ok(Self {
            masked,
            overlaps: Overlaps::of_instances(instances),
            ballots,
            decisions: decisions.into_iter().collect(),
            spacing_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_election_is_the_same_after_it_was_written_and_damage_is_seen() {
        let instance = |label| Instance {
            photo: 1,
            label,
            area: 100 * label,
        };
        let share = 0.1 + 0.2;
        let election = Election {
            masked: vec![0, 3],
            overlaps: Overlaps::of_instances((1..=4).map(instance).collect()),
            ballots: vec![
                Ballot::Nothing,
                Ballot::One(7),
                Ballot::AnyOf(vec![7, 9]),
                Ballot::One(9),
            ],
            decisions: BTreeMap::from([
                (0, Decision::Outvoted(share)),
                (1, Decision::Fragment(7, 1.0 / 3.0)),
                (2, Decision::Merged(vec![7, 9])),
            ]),
            spacing_m: 0.004_999_999_888_241_291,
        };
        let bytes = election.encode();
        let back = Election::decode(&bytes).unwrap();
        assert_eq!(back.masked, election.masked);
        assert_eq!(back.ballots, election.ballots);
        assert_eq!(back.decisions, election.decisions);
        assert_eq!(back.spacing_m.to_bits(), election.spacing_m.to_bits());
        assert_eq!(back.overlaps.instances, election.overlaps.instances);
        assert_eq!(back.overlaps.find(1, 3), Some(2));
        assert_eq!(back.encode(), bytes);
        for length in 0..bytes.len() {
            assert!(Election::decode(&bytes[..length]).is_err(), "{length} bytes");
        }
    }
}
