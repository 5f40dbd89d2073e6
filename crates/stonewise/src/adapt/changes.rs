//! What another detector would change: the stones of the same clouds, found in another way.

use crate::error::Result;
use crate::pipeline::{Context, Labelled, stone_outlines};
use crate::results::Facade;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::cloud::TileSource;
use stonewise_core::evaluate::LabelConfusion;

/// Overlap (intersection over union) of two stones in points, from which they are the same.
const SAME: f64 = 0.75;
/// Share of a stone's points in another from which the other plays a part.
const PART: f64 = 0.1;

/// What becomes of a stone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// It is found where none was.
    New,
    /// It is not found any more.
    Gone,
    /// It has another border: joined, split, larger or smaller.
    Changed,
}

/// A stone of the first epoch that another detector would change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StoneChange {
    /// What becomes of it.
    pub fate: Fate,
    /// The numbers of the stones as they are now that lie there.
    pub stones: Vec<u32>,
    /// Its outline on the unrolled wall, `[along_m, up_m]`, to a millimetre: as it would be; of one that is gone as it
    /// is.
    pub outline: Vec<[f64; 2]>,
}

/// The stones that differ between two labellings of the same clouds.
pub fn changes(
    now: (&Context, &Labelled),
    then: (&Context, &Labelled),
    wall: &Facade,
) -> Result<Vec<StoneChange>> {
    let tiles = &now.1.ingested.tiles;
    let mut shared = LabelConfusion::default();
    let all = 0..tiles.tile_count();
    now.0.progress.each("compare stones", all, |tile| -> Result<()> {
        let (old, new) = (now.1.labels(tile)?, then.1.labels(tile)?);
        old.stone
            .iter()
            .zip(&new.stone)
            .for_each(|(&old, &new)| shared.add(old, new));
        Ok(())
    })?;
    let rings = [now, then].map(|(context, labelled)| -> Result<BTreeMap<u32, Vec<[f64; 2]>>> {
        let centroids: BTreeMap<u32, _> = labelled.stones.iter().map(|s| (s.id.0, s.centroid)).collect();
        let outlines = stone_outlines(context, labelled)?
            .into_iter()
            .filter_map(|outline| {
                let centroid = centroids.get(&outline.stone_id)?;
                let place = |p| {
                    let at = wall.place_in_stone(p, centroid, &outline.normal);
                    [at.x, at.y].map(|v| (v * 1e3).round() / 1e3)
                };
                Some((outline.stone_id, outline.ring.iter().map(place).collect()))
            });
        Ok(outlines.collect())
    });

    let [old, new] = rings;
    let (mut old, mut new) = (old?, new?);
    let change = |(fate, stone, stones): (Fate, u32, Vec<u32>)| {
        let rings = if fate == Fate::Gone { &mut old } else { &mut new };
        StoneChange {
            fate,
            stones,
            outline: rings.remove(&stone).unwrap_or_default(),
        }
    };

    Ok(fates(&shared).into_iter().map(change).collect())
}

/// What becomes of which stone, with the stones that are there now. `shared`: points by their stones now and then.
fn fates(shared: &LabelConfusion) -> Vec<(Fate, u32, Vec<u32>)> {
    let (old_sizes, new_sizes) = (shared.predicted_sizes(), shared.true_sizes());
    let (mut same, mut parts): (BTreeSet<u32>, BTreeMap<u32, Vec<u32>>) = Default::default();
    let mut lives: BTreeSet<u32> = BTreeSet::new();
    for (old, new, n) in shared.overlaps() {
        let (n, old_size, new_size) = (n as f64, old_sizes[&old] as f64, new_sizes[&new] as f64);
        if n >= SAME * (old_size + new_size - n) {
            same.insert(new);
        }
        if n >= PART * old_size.min(new_size) {
            parts.entry(new).or_default().push(old);
            lives.insert(old);
        }
    }
    let found = new_sizes.keys().filter(|new| !same.contains(new));
    let found = found.map(|&new| match parts.remove(&new) {
        Some(stones) => (Fate::Changed, new, stones),
        None => (Fate::New, new, Vec::new()),
    });
    let found: Vec<_> = found.collect();
    let gone = old_sizes.keys().filter(|old| !lives.contains(old));
    found
        .into_iter()
        .chain(gone.map(|&old| (Fate::Gone, old, vec![old])))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stones_that_come_go_join_and_split_are_told_apart() {
        // Stone 1 stays but for its border, 2 and 3 become one, 4 becomes two, 5 goes, one comes.
        let points = [
            (1, 11, 95),
            (1, 0, 5),
            (2, 12, 50),
            (3, 12, 60),
            (4, 13, 50),
            (4, 14, 45),
            (5, 0, 40),
            (0, 15, 30),
            (0, 0, 1000),
        ];
        let mut shared = LabelConfusion::default();
        for (old, new, n) in points {
            (0..n).for_each(|_| shared.add(old, new));
        }
        let expected = [
            (Fate::Changed, 12, vec![2, 3]),
            (Fate::Changed, 13, vec![4]),
            (Fate::Changed, 14, vec![4]),
            (Fate::New, 15, vec![]),
            (Fate::Gone, 5, vec![5]),
        ];
        assert_eq!(fates(&shared), expected);
    }
}
