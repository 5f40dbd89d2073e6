//! How well the masks of a detector agree with the stones that they make up in the cloud.
//!
//! There are no true masks, so the masks of a detector are compared with the stones that they form together in the
//! cloud. Masks that cover part of a stone, several stones or none rarely agree from photo to photo.

use super::lesson::{Block, Lesson, stones_of};
use super::sight::{LEAST_PIXELS, Sight, confirmed, matches, panels};
use crate::error::Result;
use crate::pipeline::Run;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::id::StoneId;

/// Masks and stones, counted in each photo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Masks.
    pub found: usize,
    /// Masks that match a confirmed stone.
    pub right: usize,
    /// Confirmed stones.
    pub references: usize,
}

/// The agreement of a detector's masks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// Masks in the parts of the wall that are kept for measuring, counted in each photo.
    pub found: usize,
    /// Confirmed stones there, counted in each photo that shows them whole; in each part, the larger of the two
    /// detectors' counts.
    pub references: usize,
    /// Masks that match a confirmed stone.
    pub right: usize,
    /// `right` over `found`.
    pub precision: Option<f64>,
    /// `right` over `references`.
    pub recall: Option<f64>,
    /// Harmonic mean of precision and recall.
    pub f1: Option<f64>,
}

impl Counts {
    /// The sum of two counts.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            found: self.found + other.found,
            right: self.right + other.right,
            references: self.references + other.references,
        }
    }

    /// F1 (van Rijsbergen 1979): twice the right masks over the sum of masks and confirmed stones; 0 if there are
    /// neither.
    pub fn f1(&self) -> f64 {
        2.0 * self.right as f64 / ((self.found + self.references) as f64).max(1.0)
    }
}

impl From<Counts> for Agreement {
    fn from(counts: Counts) -> Self {
        let share = |of: usize| (of > 0).then(|| counts.right as f64 / of as f64);
        Self {
            found: counts.found,
            references: counts.references,
            right: counts.right,
            precision: share(counts.found),
            recall: share(counts.references),
            f1: (counts.found + counts.references > 0).then(|| counts.f1()),
        }
    }
}

/// Counts the masks of a detector in each part of the wall that is kept for measuring. Stones that a person corrected
/// count as confirmed.
pub fn agreement(run: &Run, lesson: &Lesson) -> Result<BTreeMap<Block, Counts>> {
    let mut all: BTreeMap<Block, Counts> = BTreeMap::new();
    let project = run.context.project;
    let epochs = project.epochs.ids();
    for epoch in epochs.filter(|&e| project.epochs[e].masks.is_none()) {
        let segmented = run.segmented(epoch)?;
        let (labelled, _) = stones_of(run, epoch)?;
        let edited = labelled.edited.keys().copied();
        let confirmed: BTreeSet<StoneId> = confirmed(&labelled).into_iter().chain(edited).collect();
        let panels = panels(run, epoch, &labelled)?;
        let stones = labelled.stones.iter().filter(|stone| !panels.contains(&stone.id));
        let part_of: BTreeMap<StoneId, Block> = stones
            .filter_map(|s| Some((s.id, lesson.parts.of(&s.centroid)?)))
            .collect();
        run.context.progress.begin("photos", segmented.views.len() as u64);
        for view in &segmented.views {
            if let Some(sight) = Sight::of(run, &labelled, &segmented, view)? {
                for (part, counts) in counted(&sight, &confirmed, &part_of) {
                    let sum = all.entry(part).or_default();
                    *sum = sum.plus(&counts);
                }
            }
            run.context.progress.advance(1);
        }
    }
    Ok(all)
}

/// Counts the masks and the confirmed stones of a photo in each part. A mask belongs to the stone that it overlaps
/// most. Masks of no stone or of a stone without a part are left out, and so is what is small or cut by the border.
fn counted(
    sight: &Sight,
    confirmed: &BTreeSet<StoneId>,
    part_of: &BTreeMap<StoneId, Block>,
) -> BTreeMap<Block, Counts> {
    let mut stones = sight.pixels();
    stones.retain(|_, n| !n.is_cut && n.cloud >= LEAST_PIXELS);
    let mut counts: BTreeMap<Block, Counts> = BTreeMap::new();
    for stone in confirmed.iter().filter(|stone| stones.contains_key(stone)) {
        if let Some(part) = part_of.get(stone) {
            counts.entry(*part).or_default().references += 1;
        }
    }

    let mut sizes: BTreeMap<u32, u64> = BTreeMap::new();
    let mut shared: BTreeMap<u32, BTreeMap<StoneId, u64>> = BTreeMap::new();
    for index in (0..sight.masks.data().len()).filter(|&i| sight.cloud.known.data()[i]) {
        let (mask, seen) = (sight.mask(index).0, sight.stone(index));
        if mask != 0 {
            *sizes.entry(mask).or_default() += 1;
            if let Some(seen) = seen {
                *shared.entry(mask).or_default().entry(seen).or_default() += 1;
            }
        }
    }

    for (mask, stones_of_mask) in shared.iter().filter(|(mask, _)| sizes[mask] >= LEAST_PIXELS) {
        let over = stones_of_mask.iter().max_by_key(|(_, both)| **both);
        let Some((stone, both)) = over else { continue };
        if let (Some(part), Some(pixels)) = (part_of.get(stone), stones.get(stone)) {
            let counts = counts.entry(*part).or_default();
            let is_right = confirmed.contains(stone) && matches(*both, pixels.cloud, sizes[mask]);
            counts.found += 1;
            counts.right += usize::from(is_right);
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::super::testing::{enlarged, labels};
    use super::*;
    use stonewise_core::raster::Raster;
    use stonewise_core::transfer::PhotoStones;

    #[test]
    fn masks_are_right_where_they_match_a_confirmed_stone() {
        // 1 is found; 2 in two parts; 3 is missed; 4 is found but not confirmed; 5 is cut; 6 lies in a part that is
        // not kept; a mask lies beside all stones.
        let cloud = labels([
            "                    ",
            " 111 2222 333 44  55",
            " 111 2222 333 44  55",
            " 111 2222 333 44  55",
            "                    ",
            " 666                ",
            " 666                ",
            "                    ",
        ]);
        let masks = labels([
            "                    ",
            " 111 2233     44  55",
            " 111 2233     44  55",
            " 111 2233     44  55",
            "                    ",
            " 666     777        ",
            " 666     777        ",
            "                    ",
        ]);
        let cloud = enlarged(&cloud);
        let sight = Sight {
            masks: enlarged(&masks),
            cloud: PhotoStones {
                known: Raster::filled(cloud.width(), cloud.height(), true),
                stones: cloud,
            },
            owners: BTreeMap::new(),
        };
        let confirmed = [1, 2, 3, 5, 6].map(StoneId).into();
        let part_of = [1, 2, 3, 4, 5].map(|stone| (StoneId(stone), [i64::from(stone > 2), 0, 0]));
        let found = counted(&sight, &confirmed, &part_of.into());
        let expected = |found, right, references| Counts {
            found,
            right,
            references,
        };
        let parts = [([0, 0, 0], expected(3, 1, 2)), ([1, 0, 0], expected(1, 0, 1))];
        assert_eq!(found, parts.into());
    }
}
