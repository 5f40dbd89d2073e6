//! Photos, cameras and masks of one epoch.

use crate::simulate::truth::SHOWN_PIXELS;
use crate::simulate::write::{Survey, create_folder};
use crate::simulate::{MaskFiles, SimulateError, SurveyParams};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use stonewise_core::geometry::View;
use stonewise_core::raster::{LabelImage, Raster};
use stonewise_core::simulate::{
    Photo, SampledFaces, Scene, SensorParams, Studio, Wall, disturb_views, plan_views, shown_part,
    shown_stones, true_labels,
};
use stonewise_io::cameras::{write_colmap, write_metashape};
use stonewise_io::image_io::write_jpeg;
use stonewise_io::masks::{CocoPhoto, InstanceInfo, write_coco, write_label_png};
use stonewise_io::table::{Table, write_csv};

/// Largest section that is photographed from one sampled surface, m^2: about 100 MB. Beyond it each photo gets its own part.
const ONE_SURFACE_M2: f64 = 100.0;

/// Takes and writes the photos of an epoch with all that belongs to them; gives back how many photos show each stone.
pub(super) fn write_photos(survey: &Survey) -> Result<Vec<u32>, SimulateError> {
    let (params, number) = (survey.params, survey.number());
    let seed = params
        .scene
        .seed
        .wrapping_mul(1000)
        .wrapping_add(10 + survey.epoch as u64);
    let images = survey.folder.join(format!("epoch{number}/images"));
    create_folder(&images)?;
    let wall = &survey.world.wall;
    let exact = plan_views(wall, &params.photos, survey.epoch, seed);
    let extent = wall.extent();
    let mut masks = MaskWriter::new(survey, seed + 6)?;
    let mut shown = vec![0; wall.stones.len()];
    survey
        .progress
        .begin(&format!("photos of epoch {number}"), exact.len() as u64);
    let is_small = (extent[1] - extent[0]) * (extent[3] - extent[2]) <= ONE_SURFACE_M2;
    let whole = is_small.then(|| survey.world.surface(extent));
    let scene = whole.as_ref().map(|s| survey.world.scene_of(s, survey.epoch));
    let darkroom = scene.as_ref().map(|s| Darkroom::new(s, params, seed + 2));
    let mut sampled = SampledFaces::default();
    for (view, shown_part) in along_the_wall(wall, &exact) {
        survey.progress.check()?;
        let part = format!("{}.json", view.name);
        if let Some(finished) = masks.folder.as_ref().and_then(|_| survey.unfinished.read(&part)) {
            masks.take_up(view, &finished, &mut shown);
            survey.progress.advance(1);
            continue;
        }
        let photo = match (&darkroom, shown_part) {
            (Some(darkroom), _) => darkroom.photo(view),
            (None, Some(part)) => {
                let surface = survey.world.next_surface(part, &mut sampled);
                let scene = survey.world.scene_of(&surface, survey.epoch);
                Darkroom::new(&scene, params, seed + 2).photo(view)
            }
            (None, None) => blank(view),
        };
        let name = format!("{}.jpg", view.name);
        write_jpeg(&images.join(&name), &photo.image, params.jpeg_quality)?;
        let shows = shown_stones(&photo.labels, SHOWN_PIXELS);
        let finished = FinishedPhoto {
            instances: masks.write(view, photo.labels)?,
            shows,
        };
        survey.unfinished.write(&part, &finished)?;
        masks.take_up(view, &finished, &mut shown);
        survey.progress.advance(1);
    }
    masks.finish()?;
    write_cameras(survey.folder, &exact, params, number, seed + 4)?;
    Ok(shown)
}

/// Views with the part of the wall that each shows, in such an order that most of one part is in the next.
fn along_the_wall<'a>(wall: &Wall, views: &'a [View]) -> Vec<(&'a View, Option<[f64; 4]>)> {
    let mut parts: Vec<_> = views.iter().map(|view| (view, shown_part(wall, view))).collect();
    let from = |part: &Option<[f64; 4]>| part.map_or(f64::MAX, |p| p[0] + p[1]);
    parts.sort_by(|(_, p), (_, q)| from(p).total_cmp(&from(q)));
    parts
}

/// Takes photos of one scene, or their labels alone on grey where photos are not rendered.
struct Darkroom<'a> {
    scene: &'a Scene<'a>,
    studio: Option<Studio<'a>>,
    sensor: &'a SensorParams,
}

impl<'a> Darkroom<'a> {
    fn new(scene: &'a Scene<'a>, params: &'a SurveyParams, day: u64) -> Self {
        Self {
            scene,
            studio: params.photos.rendered.then(|| Studio::new(scene, day)),
            sensor: &params.photos.sensor,
        }
    }

    fn photo(&self, view: &View) -> Photo {
        match &self.studio {
            Some(studio) => studio.photograph(view, self.sensor),
            None => Photo {
                labels: true_labels(self.scene, view),
                ..blank(view)
            },
        }
    }
}

fn blank(view: &View) -> Photo {
    let (width, height) = (view.camera.width, view.camera.height);
    Photo {
        image: Raster::filled(width, height, [128; 3]),
        labels: LabelImage::filled(width, height, 0),
    }
}

fn write_cameras(
    folder: &Path,
    exact: &[View],
    params: &SurveyParams,
    number: usize,
    seed: u64,
) -> Result<(), SimulateError> {
    let mut delivered = disturb_views(exact, &params.photos, seed);
    if params.photos.last_unaligned {
        delivered.pop();
    }
    write_metashape(
        &folder.join(format!("epoch{number}/cameras_metashape.xml")),
        &delivered,
        None,
    )?;
    let truth = folder.join(format!("truth/cameras_epoch{number}"));
    create_folder(&truth.join("colmap"))?;
    write_metashape(&truth.join("cameras_metashape.xml"), exact, None)?;
    write_colmap(&truth.join("colmap"), exact)?;
    Ok(())
}

/// What is known of a photo whose files are whole.
#[derive(Serialize, Deserialize)]
struct FinishedPhoto {
    /// Stone and instance of each mask that was written.
    instances: Vec<(u32, u32)>,
    /// Stones of which it shows enough to count.
    shows: Vec<u32>,
}

/// Masks for the project, with numbers that say nothing about the stone, and beside them which stone each one is.
///
/// COCO json holds all photos of an epoch, so their labels stay in memory; label PNGs are written photo by photo, with a table
/// of (photo, instance, stone_id) as their truth. Where the project gets no masks, the PNGs belong to the truth.
struct MaskWriter<'a> {
    survey: &'a Survey<'a>,
    seed: u64,
    /// Folder of the label PNGs.
    folder: Option<PathBuf>,
    /// Photos and their labels, for COCO.
    kept: Vec<(String, LabelImage)>,
    /// Photo, instance, stone.
    known: Vec<(String, u32, u32)>,
}

impl<'a> MaskWriter<'a> {
    fn new(survey: &'a Survey<'a>, seed: u64) -> Result<Self, SimulateError> {
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
    fn write(&mut self, view: &View, labels: LabelImage) -> Result<Vec<(u32, u32)>, SimulateError> {
        let Some(folder) = &self.folder else {
            self.kept.push((format!("{}.jpg", view.name), labels));
            return Ok(Vec::new());
        };
        let (shuffled, numbers) = shuffle(&labels, self.seed.wrapping_add(u64::from(view.image.0)));
        write_label_png(&folder.join(format!("{}.png", view.name)), &shuffled)?;
        Ok(numbers)
    }

    /// Notes what a photo shows; `shown`: number of photos that show each stone, in the wall's order.
    fn take_up(&mut self, view: &View, photo: &FinishedPhoto, shown: &mut [u32]) {
        let name = format!("{}.jpg", view.name);
        let known = photo.instances.iter();
        self.known
            .extend(known.map(|&(stone, instance)| (name.clone(), instance, stone)));
        for &stone in &photo.shows {
            shown[stone as usize - 1] += 1;
        }
    }

    fn finish(mut self) -> Result<(), SimulateError> {
        let number = self.survey.number();
        let truth = self.survey.folder.join("truth/masks");
        if self.folder.is_some() {
            self.known.sort();
            let mut table = Table::new();
            table.push(
                "photo",
                self.known.iter().map(|k| k.0.clone()).collect::<Vec<_>>(),
            )?;
            table.push("instance", self.known.iter().map(|k| k.1).collect::<Vec<_>>())?;
            table.push("stone_id", self.known.iter().map(|k| k.2).collect::<Vec<_>>())?;
            return Ok(write_csv(
                &truth.join(format!("epoch{number}_stones.csv")),
                &table,
            )?);
        }
        self.kept.sort_by(|a, b| a.0.cmp(&b.0));
        let (names, labels): (Vec<String>, Vec<LabelImage>) = self.kept.into_iter().unzip();
        let known: Vec<Vec<InstanceInfo>> = labels.iter().map(true_instances).collect();
        write_coco(
            &truth.join(format!("epoch{number}_coco.json")),
            &coco_photos(&names, &labels, &known),
        )?;
        let shuffled: Vec<LabelImage> = labels
            .iter()
            .zip(self.seed..)
            .map(|(l, s)| shuffle(l, s).0)
            .collect();
        let masks = self.survey.folder.join("masks");
        create_folder(&masks)?;
        let unknown = vec![Vec::new(); shuffled.len()];
        write_coco(
            &masks.join(format!("epoch{number}.json")),
            &coco_photos(&names, &shuffled, &unknown),
        )?;
        Ok(())
    }
}

fn coco_photos<'a>(
    names: &'a [String],
    labels: &'a [LabelImage],
    instances: &'a [Vec<InstanceInfo>],
) -> Vec<CocoPhoto<'a>> {
    names
        .iter()
        .zip(labels)
        .zip(instances)
        .map(|((file_name, labels), instances)| CocoPhoto {
            file_name,
            labels,
            instances,
        })
        .collect()
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

/// The same masks, numbered from 1 in random order, and the pairs of old and new numbers.
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
