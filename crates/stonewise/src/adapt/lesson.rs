//! What a survey teaches: masks that several photos and the cloud agree on, stones that a person corrected, and panels,
//! which are background.

use super::sight::{LEAST_PIXELS, Sight, confirmed, matches, owners, panels};
use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::{Labelled, Run, Segmented};
use crate::project::Project;
use crate::storage::step::{Key, StepDir};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::id::StoneId;
use stonewise_core::raster::{LabelImage, Raster};
use stonewise_core::statistics::upper_median;
use stonewise_core::stone::Stone;
use stonewise_io::masks::write_label_png;

const STEP: &str = "lesson";
/// The photos of an epoch with what they teach, in the folder of the step.
const PHOTOS: &str = "photos.json";
/// Value of the pixels about which nothing is known, in the label image of a photo.
pub const OPEN: u32 = u16::MAX as u32;
/// Share of a stone that masks of others may cover in a photo that has no mask of it.
const MAX_FOREIGN: f64 = 0.1;
/// Width of the ring around the masks in which joints are taught, in parts of the width of a typical stone.
const RING: f64 = 0.1;
/// Share of the blocks of the wall that are kept for measuring.
const KEPT_SHARE: f64 = 0.2;
/// Edge of a block, in widths of a typical stone.
const BLOCK_STONES: f64 = 2.5;
/// Confirmed stones from which anything can be learnt and measured.
const LEAST_STONES: usize = 20;

/// What all epochs without masks teach together.
pub struct Lesson {
    /// The photos that show a confirmed stone.
    pub photos: Vec<LessonPhoto>,
    /// How many stones are confirmed or corrected.
    pub stones: usize,
    /// Labels of the stones that are kept for measuring; labels start at 1.
    pub kept: BTreeSet<u32>,
    /// The parts of the wall in which the kept stones lie.
    pub parts: Parts,
    /// Key of everything above.
    pub key: Key,
}

/// A photo and its label image.
pub struct LessonPhoto {
    /// The photo.
    pub path: PathBuf,
    /// Its camera.
    pub view: View,
    /// The stones of its epoch.
    pub epoch: Arc<Labelled>,
    /// Its label image: 1 for the first of `stones`, 0 for joints, [`OPEN`] where nothing is known.
    pub image: PathBuf,
    /// The labels of its stones.
    pub stones: Vec<u32>,
    /// Stones of which the detector had no mask here.
    pub missed: usize,
    /// Stones that a person corrected, by their labels.
    pub corrected: Vec<u32>,
    /// Masks of the detector that a person said are no stones.
    pub deleted: usize,
}

impl Lesson {
    /// The photos that show what a person corrected, and that is not kept for measuring; all where nobody did.
    pub fn to_learn_from(&self) -> Vec<usize> {
        let teaches = |photo: &LessonPhoto| {
            photo.deleted > 0 || photo.corrected.iter().any(|label| !self.kept.contains(label))
        };
        let all = 0..self.photos.len();
        let chosen: Vec<usize> = all.clone().filter(|&n| teaches(&self.photos[n])).collect();
        if chosen.is_empty() { all.collect() } else { chosen }
    }
}

/// The block of the wall in which a place lies.
pub type Block = [i64; 3];

/// The parts of the wall that are kept for measuring.
pub struct Parts {
    edge_m: f64,
    kept: BTreeSet<Block>,
}

impl Parts {
    /// The part in which a place lies; `None` where it is not kept for measuring.
    pub fn of(&self, place: &Point3<f64>) -> Option<Block> {
        Some(block(self.edge_m, place)).filter(|block| self.kept.contains(block))
    }
}

fn block(edge_m: f64, place: &Point3<f64>) -> Block {
    place.coords.map(|x| (x / edge_m).floor() as i64).into()
}

/// What is kept of a photo.
#[derive(Serialize, Deserialize)]
struct Taught {
    /// Number of the photo among those of its epoch.
    photo: usize,
    /// The stones of its label image; the first has the value 1.
    stones: Vec<StoneId>,
    /// How many of them the detector had missed here.
    missed: usize,
    /// Stones of these that a person corrected.
    corrected: Vec<StoneId>,
    /// How many masks a person said are no stones.
    deleted: usize,
}

/// Gathers what the epochs without masks teach, with the corrections of the project.
///
/// # Errors
/// Every epoch has masks, or too few stones are confirmed.
pub fn lesson(run: &Run) -> Result<Lesson> {
    let project = run.context.project;
    let (mut photos, mut confirmed, mut keys) = (Vec::new(), Vec::new(), Vec::new());
    let mut corrected: BTreeSet<u32> = BTreeSet::new();

    for epoch in project
        .epochs
        .ids()
        .filter(|&e| project.epochs[e].masks.is_none())
    {
        let segmented = run.segmented(epoch)?;
        let (labelled, before) = stones_of(run, epoch)?;
        let step = teach(run, epoch, (&labelled, before.as_deref()), &segmented)?;
        let of_id: BTreeMap<StoneId, &Stone> = labelled.stones.iter().map(|s| (s.id, s)).collect();
        let mut labels: BTreeMap<StoneId, u32> = BTreeMap::new();
        for taught in read_json::<Vec<Taught>>(&step.file(PHOTOS))? {
            let mut stones = Vec::new();
            for id in taught.stones {
                let label = labels.entry(id).or_insert_with(|| {
                    confirmed.extend(of_id.get(&id).map(|&s| s.clone()));
                    confirmed.len() as u32
                });
                stones.push(*label);
            }
            let of_person: Vec<u32> = taught
                .corrected
                .iter()
                .filter_map(|id| labels.get(id).copied())
                .collect();
            corrected.extend(&of_person);
            photos.push(LessonPhoto {
                path: segmented.photos[taught.photo].path.clone(),
                view: segmented.views[taught.photo].clone(),
                epoch: Arc::clone(&labelled),
                image: step.file(image_name(taught.photo)),
                stones,
                missed: taught.missed,
                corrected: of_person,
                deleted: taught.deleted,
            });
        }
        keys.push(step.key().as_str().to_owned());
    }

    if keys.is_empty() {
        return Err(refused(
            project,
            "every epoch has `masks`: train a detector on them with `stonewise detector train`",
        ));
    }

    if confirmed.len() < LEAST_STONES {
        return Err(refused(
            project,
            &format!(
                "{} stones are confirmed by two photos and the cloud, and {LEAST_STONES} are needed: outline some by hand and use \
                 `stonewise detector train`",
                confirmed.len()
            ),
        ));
    }

    let edge_m = edge_m(&confirmed);
    let blocks: Vec<Block> = confirmed.iter().map(|s| block(edge_m, &s.centroid)).collect();
    let labels = (1..).zip(&blocks);
    // Corrections are few: most of them are to be learnt from.
    let of_person = labels.clone().filter(|(label, _)| corrected.contains(label));
    let of_person: BTreeSet<Block> = of_person.map(|(_, block)| *block).collect();
    let others = blocks.iter().copied().filter(|block| !of_person.contains(block));
    let mut kept_blocks = chosen_blocks(others.collect(), 2);
    kept_blocks.extend(chosen_blocks(of_person, 0));
    let kept = labels
        .filter(|(_, b)| kept_blocks.contains(*b))
        .map(|(label, _)| label);
    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();

    Ok(Lesson {
        kept: kept.collect(),
        key: Key::new(STEP, &(), &keys),
        photos,
        stones: confirmed.len(),
        parts: Parts {
            edge_m,
            kept: kept_blocks,
        },
    })
}

/// The stones of an epoch, and those before a person's corrections if the project has any.
pub fn stones_of(run: &Run, epoch: EpochId) -> Result<(Arc<Labelled>, Option<Arc<Labelled>>)> {
    Ok(match &run.context.project.edits {
        Some(_) => (run.labelled(epoch)?, Some(run.confirmed(epoch)?)),
        None => (run.found(epoch)?, None),
    })
}

fn refused(project: &Project, why: &str) -> Error {
    Error::Survey(format!(
        "nothing can be learnt from {}: {why}",
        project.path.display()
    ))
}

/// Edge of a block, metres.
fn edge_m(stones: &[Stone]) -> f64 {
    let mut areas: Vec<f64> = stones.iter().map(|s| s.area_m2).collect();
    let typical = upper_median(&mut areas).map_or(1.0, f64::sqrt);
    BLOCK_STONES * typical.max(f64::MIN_POSITIVE)
}

/// Blocks chosen by their place alone, `least` of them at least where there are more.
fn chosen_blocks(all: BTreeSet<Block>, least: usize) -> BTreeSet<Block> {
    let mut order: Vec<Block> = all.into_iter().collect();
    let rank = |block: &Block| blake3::hash(format!("{block:?}").as_bytes());
    order.sort_by_cached_key(|block| *rank(block).as_bytes());
    let count = (order.len() as f64 * KEPT_SHARE).round() as usize;
    order.truncate(count.max(least).min(order.len().saturating_sub(1)));
    order.into_iter().collect()
}

/// The step of an epoch: a label image for each photo that teaches anything. `before`: its stones without the
/// corrections, where there are some.
fn teach(
    run: &Run,
    epoch: EpochId,
    (labelled, before): (&Labelled, Option<&Labelled>),
    segmented: &Segmented,
) -> Result<StepDir> {
    let context = run.context;
    let panels = panels(run, epoch, labelled)?;
    let key = Key::new(STEP, &(), &[labelled.key.as_str(), segmented.step.key().as_str()]);
    context.step(&format!("{STEP}-{epoch}"), key, |step, _| {
        let corrected: BTreeSet<StoneId> = labelled.edited.keys().copied().collect();
        let confirmed = &confirmed(labelled) - &panels;
        let mut photos = Vec::new();
        context.progress.begin("photos", segmented.views.len() as u64);
        for (photo, view) in segmented.views.iter().enumerate() {
            let Some(sight) = Sight::of(run, labelled, segmented, view)? else {
                context.progress.advance(1);
                continue;
            };
            let had = before.map_or(BTreeMap::new(), |before| owners(before, view.image));
            let deleted = had
                .into_keys()
                .filter(|instance| !sight.owners.contains_key(instance))
                .collect();
            let shown = Shown {
                sight: &sight,
                deleted: &deleted,
                panels: &panels,
            };
            let chosen = shown.choose(&confirmed, &corrected);
            if !chosen.is_empty() {
                write_label_png(&step.file(image_name(photo)), &shown.drawn(&chosen))?;
                photos.push(Taught {
                    photo,
                    missed: chosen.values().filter(|how| **how == How::Missed).count(),
                    corrected: chosen.keys().filter(|s| corrected.contains(s)).copied().collect(),
                    stones: chosen.into_keys().collect(),
                    deleted: deleted.len(),
                });
            }
            context.progress.advance(1);
        }
        write_json(&step.file(PHOTOS), &photos)
    })
}

fn image_name(photo: usize) -> String {
    format!("{photo:05}.png")
}

/// How a stone is taught in a photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum How {
    /// By the detector's own mask.
    Found,
    /// By the points that the photo sees: the detector missed it.
    Missed,
    /// By the points that the photo sees, whatever the detector found: a person corrected it.
    Corrected,
}

/// A photo and what decides which of its pixels are taught.
struct Shown<'a> {
    sight: &'a Sight,
    /// Masks that a person said are no stones.
    deleted: &'a BTreeSet<u32>,
    /// Panels of doors and the like, which are no stones.
    panels: &'a BTreeSet<StoneId>,
}

impl Shown<'_> {
    /// The confirmed and the corrected stones that the photo can teach.
    fn choose(&self, confirmed: &BTreeSet<StoneId>, corrected: &BTreeSet<StoneId>) -> BTreeMap<StoneId, How> {
        let all = self
            .sight
            .pixels()
            .into_iter()
            .filter(|(stone, _)| confirmed.contains(stone) || corrected.contains(stone));
        let chosen = all.filter_map(|(stone, n)| {
            let how = match n.mask {
                _ if corrected.contains(&stone) && n.is_cut => return None,
                _ if corrected.contains(&stone) => How::Corrected,
                0 if !n.is_cut && n.foreign as f64 <= MAX_FOREIGN * n.cloud as f64 => How::Missed,
                0 => return None,
                _ if matches(n.both, n.cloud, n.mask) => How::Found,
                _ => return None,
            };
            (n.cloud >= LEAST_PIXELS).then_some((stone, how))
        });
        // More do not fit into a label image.
        chosen.take(OPEN as usize - 1).collect()
    }

    /// The label image: the chosen stones by their place, 0 in the joints around them, in panels and where a person
    /// deleted a stone, [`OPEN`] elsewhere.
    fn drawn(&self, chosen: &BTreeMap<StoneId, How>) -> LabelImage {
        let values: BTreeMap<StoneId, (u32, How)> = (1..)
            .zip(chosen)
            .map(|(value, (&stone, &how))| (stone, (value, how)))
            .collect();
        let sight = self.sight;
        let (width, height) = (sight.masks.width(), sight.masks.height());
        let mut drawn = Raster::filled(width, height, OPEN);
        let mut is_stone = Raster::filled(width, height, false);

        for (index, value) in drawn.data_mut().iter_mut().enumerate() {
            let by_mask = sight.mask(index).1.and_then(|stone| values.get(&stone));
            let by_cloud = sight.stone(index).and_then(|stone| values.get(&stone));
            let found = by_mask.filter(|(_, how)| *how == How::Found);
            let seen = by_cloud.filter(|(_, how)| *how == How::Missed);
            let corrected = by_cloud.filter(|(_, how)| *how == How::Corrected);
            if let Some((label, _)) = corrected.or(found).or(seen) {
                *value = *label;
                is_stone.data_mut()[index] = true;
            }
        }

        let pixels = is_stone.data().iter().filter(|s| **s).count();
        let typical = (pixels as f64 / chosen.len().max(1) as f64).sqrt();
        let near = grown(&is_stone, (RING * typical).ceil() as usize);

        for (index, value) in drawn.data_mut().iter_mut().enumerate() {
            let (mask, owner) = sight.mask(index);
            let seen = sight.stone(index);
            let is_joint = mask == 0 && near.data()[index];
            let is_between = sight.cloud.known.data()[index] && seen.is_none();
            let is_no_stone = is_between && (is_joint || self.deleted.contains(&mask))
                || owner.or(seen).is_some_and(|stone| self.panels.contains(&stone));
            if *value == OPEN && is_no_stone {
                *value = 0;
            }
        }

        drawn
    }
}

/// The pixels within this many columns and rows of a pixel that is set.
fn grown(set: &Raster<bool>, reach: usize) -> Raster<bool> {
    let (width, height) = (set.width() as usize, set.height() as usize);
    let mut grown = set.clone();
    let rows: Vec<Vec<usize>> = (0..height)
        .map(|y| (0..width).map(|x| y * width + x).collect())
        .collect();
    let columns: Vec<Vec<usize>> = (0..width)
        .map(|x| (0..height).map(|y| y * width + x).collect())
        .collect();
    for line in rows.into_iter().chain(columns) {
        let before: Vec<bool> = line.iter().map(|&i| grown.data()[i]).collect();
        let mut until = 0;
        for (place, _) in before.iter().enumerate().filter(|(_, set)| **set) {
            let first = until.max(place.saturating_sub(reach));
            until = (place + reach + 1).min(line.len());
            line[first..until]
                .iter()
                .for_each(|&i| grown.data_mut()[i] = true);
        }
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::super::testing::{enlarged, labels};
    use super::*;
    use rand::{RngExt, SeedableRng};
    use stonewise_core::transfer::PhotoStones;

    /// A photo with stone 1 as found, 2 that the detector missed, 3 whose mask covers half of it, 4 that it
    /// missed at the border of the photo, 5 that lies under the mask of another, and 6, a panel of a door.
    #[test]
    fn a_photo_teaches_what_mask_and_cloud_agree_on_and_what_was_missed() {
        let cloud = labels([
            "                    ",
            " 111 222 333 555 666",
            " 111 222 333 555 666",
            " 111 222 333 555 666",
            "                    ",
            "                    ",
            " 44                 ",
            " 44                 ",
        ]);
        let masks = labels([
            "                 222",
            " 777      88999  222",
            " 777      88999  222",
            " 777      88999     ",
            "                    ",
            "                    ",
            "                    ",
            "                    ",
        ]);
        // A mask of no stone covers most of 3 and of 5.
        let owners = [(7, StoneId(1)), (8, StoneId(3)), (2, StoneId(6))].into();
        let (cloud, masks) = (enlarged(&cloud), enlarged(&masks));
        let mut known = Raster::filled(200, 80, true);
        // Beyond the last rows the cloud has no points.
        known.data_mut()[200 * 50..200 * 60].fill(false);
        let sight = Sight {
            masks,
            cloud: PhotoStones { stones: cloud, known },
            owners,
        };
        let shown = Shown {
            sight: &sight,
            deleted: &BTreeSet::new(),
            panels: &[StoneId(6)].into(),
        };
        let confirmed = (1..=5).map(StoneId).collect();
        let chosen = shown.choose(&confirmed, &BTreeSet::new());
        let expected = [(StoneId(1), How::Found), (StoneId(2), How::Missed)];
        assert_eq!(chosen, expected.into());
        let drawn = shown.drawn(&chosen);
        let at = |x: u32, y: u32| *drawn.get(x, y).unwrap();
        // The two stones, the joint between them, what is far from both, and what is open.
        assert_eq!([at(25, 25), at(65, 25)], [1, 2]);
        assert_eq!([at(41, 25), at(48, 25)], [0, 0]);
        assert_eq!([at(45, 75), at(115, 25), at(145, 25)], [OPEN; 3]);
        // The panel, by its mask and by the cloud.
        assert_eq!([at(185, 5), at(185, 25), at(185, 35)], [0, 0, 0]);
        assert_eq!(drawn.data().iter().filter(|v| **v == 1 || **v == 2).count(), 1800);
    }

    /// A photo with stone 1 that the detector found as two, 2 of which it found a part, and a mask of what is no
    /// stone.
    #[test]
    fn a_photo_teaches_what_a_person_corrected_and_nothing_that_was_not_looked_at() {
        let cloud = labels([
            "                    ",
            " 1111 222           ",
            " 1111 222     333   ",
            " 1111 222     333   ",
            "                    ",
            "                    ",
            "                    ",
            "                    ",
        ]);
        let masks = labels([
            "                    ",
            " 7788 9             ",
            " 7788 9       666   ",
            " 7788 9       666   ",
            "                    ",
            "          5555      ",
            "          5555      ",
            "                    ",
        ]);
        let owners = [(7, 1), (8, 1), (9, 2), (6, 3)].map(|(mask, stone)| (mask, StoneId(stone)));
        let (cloud, masks) = (enlarged(&cloud), enlarged(&masks));
        let sight = Sight {
            masks,
            cloud: PhotoStones {
                stones: cloud,
                known: Raster::filled(200, 80, true),
            },
            owners: owners.into(),
        };
        let shown = Shown {
            sight: &sight,
            deleted: &[5].into(),
            panels: &BTreeSet::new(),
        };
        let chosen = shown.choose(&BTreeSet::new(), &[1, 2].map(StoneId).into());
        let expected = [1, 2].map(|stone| (StoneId(stone), How::Corrected));
        assert_eq!(chosen, expected.into());
        let drawn = shown.drawn(&chosen);
        let at = |x: u32, y: u32| *drawn.get(x, y).unwrap();
        // Both stones as the cloud shows them, the joint between, the deleted one; all else is open.
        assert_eq!([at(15, 25), at(45, 25), at(85, 25)], [1, 1, 2]);
        assert_eq!([at(51, 25), at(59, 25), at(115, 55)], [0, 0, 0]);
        assert_eq!([at(145, 25), at(185, 25), at(115, 75)], [OPEN; 3]);
    }

    #[test]
    fn grown_areas_are_those_of_brute_force() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let (width, height, reach) = (37_i64, 23_i64, 3);
        let set: Vec<bool> = (0..width * height).map(|_| rng.random_bool(0.01)).collect();
        let raster = Raster::from_vec(width as u32, height as u32, set.clone()).unwrap();
        let grown = grown(&raster, reach);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let r = reach as i64;
            let near = |i: i64| (i % width - x).abs() <= r && (i / width - y).abs() <= r;
            let expected = (0..width * height).any(|i| set[i as usize] && near(i));
            assert_eq!(grown.get(x as u32, y as u32), Some(&expected));
        }
        assert!(grown.data().iter().any(|g| !g));
    }

    #[test]
    fn some_blocks_are_kept_and_never_all() {
        let chosen = |count: i64, least| chosen_blocks((0..count).map(|i| [i, 0, 0]).collect(), least);
        assert_eq!(chosen(100, 2).len(), 20);
        assert_eq!(chosen(5, 2).len(), 2);
        assert_eq!(chosen(2, 2).len(), 1);
        assert!(chosen(1, 2).is_empty());
        // Of a few blocks that a person corrected, none.
        assert_eq!([1, 2, 7, 20].map(|count| chosen(count, 0).len()), [0, 0, 1, 4]);
    }
}
