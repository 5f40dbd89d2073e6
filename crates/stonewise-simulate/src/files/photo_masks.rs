//! The masks of one epoch's photos, and which stone each of them is.

use crate::files::survey::{Survey, create_folder};
use crate::files::{MaskFiles, SimulateError};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use stonewise_core::geometry::View;
use stonewise_core::raster::LabelImage;
use stonewise_io::masks::{CocoFile, CocoPhoto, InstanceInfo, write_label_png};
use stonewise_io::table::{Table, write_csv};

/// What the table of masks as a whole holds.
const DESCRIPTION: &str = "Which stone each mask of an epoch's photos shows, one row per mask.";

/// What is known of a photo whose files are whole.
#[derive(Serialize, Deserialize)]
pub(super) struct FinishedPhoto {
    /// Stone and instance of each mask that was written.
    pub instances: Vec<(u32, u32)>,
    /// Stones of which it shows enough to count.
    pub shows: Vec<u32>,
}

/// Masks for the project, with numbers that say nothing about the stone, and beside them which stone each one
/// is.
///
/// COCO json holds all photos of an epoch, so their labels stay in memory; label PNGs are written photo by
/// photo, with a table of (photo, instance, stone_id) as their truth. Where the project gets no masks, the
/// PNGs belong to the truth.
pub(super) struct MaskWriter<'a> {
    survey: &'a Survey<'a>,
    seed: u64,
    /// Folder of the label PNGs.
    pub folder: Option<PathBuf>,
    /// Photos and their labels, for COCO.
    kept: Vec<(String, LabelImage)>,
    /// Photo, instance, stone.
    known: Vec<(String, u32, u32)>,
}

impl<'a> MaskWriter<'a> {
    pub fn new(survey: &'a Survey<'a>, seed: u64) -> Result<Self, SimulateError> {
        create_folder(&survey.folder.join("truth/masks"))?;
        let number = survey.number();
        let folder = match survey.params.masks {
            MaskFiles::Coco => None,
            MaskFiles::Png => Some(survey.folder.join(format!("masks/epoch{number}"))),
            MaskFiles::None => Some(survey.folder.join(format!("truth/masks/epoch{number}"))),
        };
        if let Some(folder) = &folder {
            create_folder(folder)?;
        }
        Ok(Self {
            survey,
            seed,
            folder,
            kept: Vec::new(),
            known: Vec::new(),
        })
    }

    /// Writes a photo's masks or keeps them; gives back stone and instance of each that is written.
    pub fn write(&mut self, view: &View, labels: LabelImage) -> Result<Vec<(u32, u32)>, SimulateError> {
        let Some(folder) = &self.folder else {
            self.kept.push((format!("{}.jpg", view.name), labels));
            return Ok(Vec::new());
        };
        let (shuffled, numbers) = shuffle(&labels, self.seed.wrapping_add(u64::from(view.image.0)));
        write_label_png(&folder.join(format!("{}.png", view.name)), &shuffled)?;
        Ok(numbers)
    }

    /// Notes what a photo shows; `shown`: number of photos that show each stone, in the wall's order.
    pub fn take_up(&mut self, view: &View, photo: &FinishedPhoto, shown: &mut [u32]) {
        let name = format!("{}.jpg", view.name);
        let known = photo.instances.iter();
        self.known
            .extend(known.map(|&(stone, instance)| (name.clone(), instance, stone)));
        for &stone in &photo.shows {
            shown[stone as usize - 1] += 1;
        }
    }

    pub fn finish(mut self) -> Result<(), SimulateError> {
        let number = self.survey.number();
        let truth = self.survey.folder.join("truth/masks");
        if self.folder.is_some() {
            self.known.sort();
            let mut table = Table::new();
            let photos: Vec<String> = self.known.iter().map(|k| k.0.clone()).collect();
            table.push("photo", "", "file name of the photo", photos)?;
            let instances: Vec<u32> = self.known.iter().map(|k| k.1).collect();
            table.push(
                "instance",
                "",
                "value of the mask in the label PNG of the photo",
                instances,
            )?;
            let stones: Vec<u32> = self.known.iter().map(|k| k.2).collect();
            table.push("stone_id", "", "stone that the mask shows", stones)?;
            let csv = truth.join(format!("epoch{number}_stones.csv"));
            return Ok(write_csv(&csv, &table, DESCRIPTION, None)?);
        }

        self.kept.sort_by(|a, b| a.0.cmp(&b.0));
        let (mut of_stones, mut of_project) = (CocoFile::default(), CocoFile::default());
        let words = format!("masks of epoch {number}");
        let photos = self.kept.iter().enumerate();
        self.survey
            .progress
            .each(&words, photos, |(i, (file_name, labels))| {
                of_stones.add(&CocoPhoto {
                    file_name,
                    labels,
                    instances: &true_instances(labels),
                });
                let (shuffled, _) = shuffle(labels, self.seed.wrapping_add(i as u64));
                of_project.add(&CocoPhoto {
                    file_name,
                    labels: &shuffled,
                    instances: &[],
                });
                Ok::<(), SimulateError>(())
            })?;

        of_stones.write(&truth.join(format!("epoch{number}_coco.json")))?;
        let masks = self.survey.folder.join("masks");
        create_folder(&masks)?;
        of_project.write(&masks.join(format!("epoch{number}.json")))?;
        Ok(())
    }
}

fn present(labels: &LabelImage) -> Vec<u32> {
    let mut ids = labels.data().to_vec();
    ids.sort_unstable();
    ids.dedup();
    ids.retain(|&id| id > 0);
    ids
}

fn true_instances(labels: &LabelImage) -> Vec<InstanceInfo> {
    present(labels)
        .into_iter()
        .map(|id| InstanceInfo {
            id,
            score: 1.0,
            stone_ref: Some(u64::from(id)),
        })
        .collect()
}

/// Numbers the masks from 1 in random order; returns them and the pairs of old and new numbers.
fn shuffle(labels: &LabelImage, seed: u64) -> (LabelImage, Vec<(u32, u32)>) {
    let mut ids = present(labels);
    ids.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    let largest = ids.iter().copied().max().unwrap_or(0) as usize;
    let mut new = vec![0; largest + 1];
    for (number, &id) in (1..).zip(&ids) {
        new[id as usize] = number;
    }
    let mut shuffled = labels.clone();
    for label in shuffled.data_mut() {
        *label = new[*label as usize];
    }
    (shuffled, ids.into_iter().zip(1..).collect())
}
