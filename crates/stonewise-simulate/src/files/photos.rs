//! Photos, cameras and masks of one epoch.

use crate::files::photo_masks::{FinishedPhoto, MaskWriter};
use crate::files::survey::{Survey, create_folder};
use crate::files::truth::SHOWN_PIXELS;
use crate::files::{SimulateError, SurveyParams};
use crate::world::{
    Day, Photo, SampledFaces, Scene, SensorParams, Studio, Wall, disturb_views, plan_views, shown_part,
    shown_stones, true_labels,
};
use std::path::Path;
use stonewise_core::geometry::View;
use stonewise_core::raster::{LabelImage, Raster};
use stonewise_io::cameras::{write_colmap, write_metashape};
use stonewise_io::image_io::write_jpeg;

/// Largest section that is photographed from one sampled surface, m^2: about 100 MB. Beyond it each photo
/// gets its own part.
const ONE_SURFACE_M2: f64 = 100.0;

/// Takes and writes the photos of an epoch with all that belongs to them; gives back how many photos show
/// each stone.
pub(super) fn write_photos(survey: &Survey) -> Result<Vec<u32>, SimulateError> {
    let (params, number) = (survey.params, survey.number());
    let seed = seed_of(params, survey.epoch);
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
    let day = day_of(params, survey.epoch);
    let darkroom = scene.as_ref().map(|s| Darkroom::new(s, params, &day));
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
                Darkroom::new(&scene, params, &day).photo(view)
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

/// Seed of what is by chance in an epoch's photos.
fn seed_of(params: &SurveyParams, epoch: usize) -> u64 {
    params
        .scene
        .seed
        .wrapping_mul(1000)
        .wrapping_add(10 + epoch as u64)
}

/// Light, moss and moisture of an epoch.
fn day_of(params: &SurveyParams, epoch: usize) -> Day {
    let [first, own] = [0, epoch].map(|e| seed_of(params, e) + 2);
    match epoch {
        0 => Day::new(own),
        _ => Day::later(own, first, &params.photos.later),
    }
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
    fn new(scene: &'a Scene<'a>, params: &'a SurveyParams, day: &Day) -> Self {
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
