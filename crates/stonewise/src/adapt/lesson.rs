//! What a survey teaches: masks that several photos and the cloud agree on, and stones that a person corrected.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::{Labelled, Run, Segmented};
use crate::project::Project;
use crate::storage::step::{Key, StepDir};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::id::{ImageId, StoneId};
use stonewise_core::raster::{LabelImage, Raster};
use stonewise_core::stone::Stone;
use stonewise_core::transfer::{PhotoStones, photo_stones};
use stonewise_io::masks::write_label_png;

const STEP: &str = "lesson";
/// The photos of an epoch with what they teach, in the folder of the step.
const PHOTOS: &str = "photos.json";
/// Value of the pixels about which nothing is known, in the label image of a photo.
pub const OPEN: u32 = u16::MAX as u32;
/// Photos whose masks make up a stone that is confirmed, at least.
const LEAST_PHOTOS: usize = 2;
/// Share of the votes on its points that agree, at least.
const LEAST_CONFIDENCE: f64 = 0.75;
/// Overlap (intersection over union) of a mask with its stone in the cloud from which it is taught.
const LEAST_OVERLAP: f64 = 0.7;
/// Pixels of a stone that is taught, at least: below, the detector cannot find it either.
const LEAST_PIXELS: u64 = 100;
/// A stone so near to the border of a photo may be cut, pixels.
const MARGIN: u32 = 3;
/// Share of a stone that masks of others may cover in a photo that has no mask of it.
const MAX_FOREIGN: f64 = 0.1;
/// Width of the ring around the masks in which joints are taught, in parts of the width of a typical stone.
const RING: f64 = 0.1;
/// Share of the blocks of the wall that are kept for measuring.
const KEPT_SHARE: f64 = 0.15;
/// Edge of a block, in widths of a typical stone.
const BLOCK_STONES: f64 = 4.0;
/// Confirmed stones from which anything can be learnt and measured.
const LEAST_STONES: usize = 20;

/// What all epochs without masks teach together.
pub struct Lesson {
    /// The photos that show a confirmed stone.
    pub photos: Vec<LessonPhoto>,
    /// The block of the wall in which each confirmed stone lies; the first stone has the label 1.
    pub blocks: Vec<[i64; 3]>,
    /// Labels of the stones that are kept for measuring.
    pub kept: BTreeSet<u32>,
    /// Key of everything above.
    pub key: Key,
}

/// A photo and its label image.
pub struct LessonPhoto {
    /// The photo.
    pub path: PathBuf,
    /// Its camera.
    pub view: View,
    /// Its epoch.
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

    /// The block in which the stone of a label lies.
    pub fn block(&self, label: u32) -> Option<[i64; 3]> {
        self.blocks.get((label as usize).checked_sub(1)?).copied()
    }
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
        let (labelled, before) = match &project.edits {
            Some(_) => (run.labelled(epoch)?, Some(run.confirmed(epoch)?)),
            None => (run.found(epoch)?, None),
        };
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
            "every epoch has `masks`: train a detector on them with `stonewise train`",
        ));
    }

    if confirmed.len() < LEAST_STONES {
        return Err(refused(
            project,
            &format!(
                "{} stones are confirmed by two photos and the cloud, and {LEAST_STONES} are needed: outline some by hand and use \
                 `stonewise train`",
                confirmed.len()
            ),
        ));
    }

    let blocks = blocks(&confirmed);
    let labels = (1..).zip(&blocks);
    // Corrections are few: most of them are to be learnt from.
    let of_person = labels.clone().filter(|(label, _)| corrected.contains(label));
    let of_person: BTreeSet<[i64; 3]> = of_person.map(|(_, block)| *block).collect();
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
        blocks,
    })
}

fn refused(project: &Project, why: &str) -> Error {
    Error::Survey(format!(
        "nothing can be learnt from {}: {why}",
        project.path.display()
    ))
}

/// The block of the wall in which each stone lies.
fn blocks(stones: &[Stone]) -> Vec<[i64; 3]> {
    let mut areas: Vec<f64> = stones.iter().map(|s| s.area_m2).collect();
    areas.sort_by(f64::total_cmp);
    let typical = areas.get(areas.len() / 2).map_or(1.0, |area| area.sqrt());
    let edge = BLOCK_STONES * typical.max(f64::MIN_POSITIVE);
    let block = |s: &Stone| s.centroid.coords.map(|x| (x / edge).floor() as i64).into();
    stones.iter().map(block).collect()
}

/// Blocks chosen by their place alone, `least` of them at least where there are more.
fn chosen_blocks(all: BTreeSet<[i64; 3]>, least: usize) -> BTreeSet<[i64; 3]> {
    let mut order: Vec<[i64; 3]> = all.into_iter().collect();
    let rank = |block: &[i64; 3]| blake3::hash(format!("{block:?}").as_bytes());
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
    let key = Key::new(STEP, &(), &[labelled.key.as_str(), segmented.step.key().as_str()]);
    context.step(&format!("{STEP}-{epoch}"), key, |step, _| {
        let corrected: BTreeSet<StoneId> = labelled.edited.keys().copied().collect();
        let confirmed = confirmed(labelled);
        let mut photos = Vec::new();
        context.progress.begin("photos", segmented.views.len() as u64);
        for (photo, view) in segmented.views.iter().enumerate() {
            let masks = segmented.labels(view.image)?;
            let tiles = &labelled.ingested.tiles.surveyed;
            let labels = |tile| labelled.labels(tile);
            let params = &context.project.settings.label;
            let cloud = photo_stones(tiles, labels, view, params, context.progress)?;
            let owners = owners(labelled, view.image);
            let had = before.map_or(BTreeMap::new(), |before| self::owners(before, view.image));
            let deleted = had
                .into_keys()
                .filter(|instance| !owners.contains_key(instance))
                .collect();
            let shown = Shown {
                masks: &masks,
                cloud: &cloud,
                owners: &owners,
                deleted: &deleted,
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

/// The stones that photos agree on.
fn confirmed(labelled: &Labelled) -> BTreeSet<StoneId> {
    let sure = labelled
        .stones
        .iter()
        .filter(|s| s.confidence >= LEAST_CONFIDENCE);
    let sure: BTreeSet<StoneId> = sure.map(|s| s.id).collect();
    let stones = labelled.transfer.stones.iter();
    let in_photos = stones.filter(|s| {
        let photos: BTreeSet<ImageId> = s.instances.iter().map(|(photo, _)| *photo).collect();
        photos.len() >= LEAST_PHOTOS
    });
    in_photos.map(|s| s.stone).filter(|s| sure.contains(s)).collect()
}

/// The stone to which each instance of a photo belongs.
fn owners(labelled: &Labelled, photo: ImageId) -> BTreeMap<u32, StoneId> {
    let stones = labelled.transfer.stones.iter();
    let instances = stones.flat_map(|s| {
        s.instances
            .iter()
            .map(|(image, instance)| (image, instance.0, s.stone))
    });
    instances
        .filter(|(image, ..)| **image == photo)
        .map(|(_, instance, stone)| (instance, stone))
        .collect()
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

/// A photo with its masks and what the cloud says of it.
struct Shown<'a> {
    masks: &'a LabelImage,
    cloud: &'a PhotoStones,
    owners: &'a BTreeMap<u32, StoneId>,
    /// Masks that a person said are no stones.
    deleted: &'a BTreeSet<u32>,
}

/// Pixels of a stone in a photo, where the cloud says anything.
#[derive(Clone, Copy, Debug, Default)]
struct Pixels {
    /// Pixels of the stone in the cloud.
    cloud: u64,
    /// Pixels of its masks.
    mask: u64,
    /// Pixels of both.
    both: u64,
    /// Pixels of the stone in the cloud, under the masks of others.
    foreign: u64,
    /// Whether the stone reaches the border of the photo.
    is_cut: bool,
}

impl Shown<'_> {
    /// The confirmed and the corrected stones that the photo can teach.
    fn choose(&self, confirmed: &BTreeSet<StoneId>, corrected: &BTreeSet<StoneId>) -> BTreeMap<StoneId, How> {
        let all = self
            .pixels()
            .into_iter()
            .filter(|(stone, _)| confirmed.contains(stone) || corrected.contains(stone));
        let chosen = all.filter_map(|(stone, n)| {
            let how = match n.mask {
                _ if corrected.contains(&stone) && n.is_cut => return None,
                _ if corrected.contains(&stone) => How::Corrected,
                0 if !n.is_cut && n.foreign as f64 <= MAX_FOREIGN * n.cloud as f64 => How::Missed,
                0 => return None,
                _ if n.both as f64 >= LEAST_OVERLAP * (n.cloud + n.mask - n.both) as f64 => How::Found,
                _ => return None,
            };
            (n.cloud >= LEAST_PIXELS).then_some((stone, how))
        });
        // More do not fit into a label image.
        chosen.take(OPEN as usize - 1).collect()
    }

    fn pixels(&self) -> BTreeMap<StoneId, Pixels> {
        let mut pixels: BTreeMap<StoneId, Pixels> = BTreeMap::new();
        let (width, height) = (self.masks.width(), self.masks.height());
        for index in (0..self.masks.data().len()).filter(|&i| self.cloud.known.data()[i]) {
            let (mask, owner) = self.mask(index);
            let seen = self.stone(index);
            if let Some(owner) = owner {
                pixels.entry(owner).or_default().mask += 1;
            }
            let Some(seen) = seen else { continue };
            let (x, y) = (index as u32 % width, index as u32 / width);
            let stone = pixels.entry(seen).or_default();
            stone.cloud += 1;
            stone.both += u64::from(owner == Some(seen));
            stone.foreign += u64::from(mask != 0 && owner != Some(seen));
            stone.is_cut |= x < MARGIN || y < MARGIN || x + MARGIN >= width || y + MARGIN >= height;
        }
        pixels
    }

    /// The label image: the chosen stones by their place, 0 in the joints around them and where a person deleted
    /// a stone, [`OPEN`] elsewhere.
    fn drawn(&self, chosen: &BTreeMap<StoneId, How>) -> LabelImage {
        let values: BTreeMap<StoneId, (u32, How)> = (1..)
            .zip(chosen)
            .map(|(value, (&stone, &how))| (stone, (value, how)))
            .collect();
        let (width, height) = (self.masks.width(), self.masks.height());
        let mut drawn = Raster::filled(width, height, OPEN);
        let mut is_stone = Raster::filled(width, height, false);

        for (index, value) in drawn.data_mut().iter_mut().enumerate() {
            let by_mask = self.mask(index).1.and_then(|stone| values.get(&stone));
            let by_cloud = self.stone(index).and_then(|stone| values.get(&stone));
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
            let is_no_stone = self.cloud.known.data()[index] && self.stone(index).is_none();
            let mask = self.mask(index).0;
            let is_joint = mask == 0 && near.data()[index];
            if *value == OPEN && is_no_stone && (is_joint || self.deleted.contains(&mask)) {
                *value = 0;
            }
        }

        drawn
    }

    /// The instance of a pixel, and the stone to which it belongs.
    fn mask(&self, index: usize) -> (u32, Option<StoneId>) {
        let instance = self.masks.data()[index];
        (instance, self.owners.get(&instance).copied())
    }

    /// The stone that the cloud shows in a pixel.
    fn stone(&self, index: usize) -> Option<StoneId> {
        Some(self.cloud.stones.data()[index])
            .filter(|&stone| stone != 0)
            .map(StoneId)
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
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Rows of pixels: digits are labels, spaces have none.
    fn labels(rows: [&str; 8]) -> LabelImage {
        let values = rows
            .iter()
            .flat_map(|row| row.chars().map(|c| c.to_digit(10).unwrap_or(0)));
        Raster::from_vec(rows[0].len() as u32, 8, values.collect()).unwrap()
    }

    /// Each pixel of a row ten times in both directions.
    fn enlarged<T: Copy>(small: &Raster<T>) -> Raster<T> {
        let (width, height) = (10 * small.width(), 10 * small.height());
        let at = |i: u32| *small.get(i % width / 10, i / width / 10).unwrap();
        Raster::from_vec(width, height, (0..width * height).map(at).collect()).unwrap()
    }

    /// A photo with stone 1 as found, 2 that the detector missed, 3 whose mask covers half of it, 4 that it
    /// missed at the border of the photo, 5 that lies under the mask of another, 6 that is not confirmed.
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
            "                    ",
            " 777      88999  222",
            " 777      88999  222",
            " 777      88999  222",
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
        let cloud = PhotoStones { stones: cloud, known };
        let shown = Shown {
            masks: &masks,
            cloud: &cloud,
            owners: &owners,
            deleted: &BTreeSet::new(),
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
        assert_eq!([at(45, 75), at(115, 25), at(145, 25), at(185, 25)], [OPEN; 4]);
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
        let cloud = PhotoStones {
            stones: cloud,
            known: Raster::filled(200, 80, true),
        };
        let shown = Shown {
            masks: &masks,
            cloud: &cloud,
            owners: &owners.into(),
            deleted: &[5].into(),
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
        assert_eq!(chosen(100, 2).len(), 15);
        assert_eq!(chosen(5, 2).len(), 2);
        assert_eq!(chosen(2, 2).len(), 1);
        assert!(chosen(1, 2).is_empty());
        // Of a few blocks that a person corrected, none.
        assert_eq!([1, 3, 7, 20].map(|count| chosen(count, 0).len()), [0, 0, 1, 3]);
    }
}
