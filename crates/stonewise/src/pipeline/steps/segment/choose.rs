//! Photos in which the detector looks for stones: as many as the votes need, as large as their stones need.

use super::voting_photo::{photo_bytes, posed_photos, unusable};
use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::steps::ingest::{INGEST, Ingested};
use crate::project::Project;
use crate::storage::step::{Key, StepDir};
use crate::texts::Said;
use crate::texts::notices::{PHOTOS_CHOSEN, SIZE_OF_STONES, SIZE_UNKNOWN};
use crate::warnings::Warnings;
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::statistics::quantile;
use stonewise_core::surface::{orient, surface_cells};
use stonewise_core::transfer::photo_relief;
use stonewise_core::views::{Sight, Sights};
use stonewise_io::image_io::read_rgb;
use stonewise_segment::tiling::segment_photo;
use stonewise_segment::{StoneFinder, Weights};

/// Chooses among the photos of an epoch without masks, unless all of them are to be used.
pub static CHOOSE: Step = Step {
    name: STEP,
    phase: Some(Phase::Find),
    about: About::Epoch,
    needs: &[Need::same(&INGEST)],
    applies: Project::chooses_photos,
    cost: Some(|sizes, epoch| Cost::of(4, photo_bytes(sizes, epoch))),
    make: |run, epoch| run.chosen(epoch).map(drop),
    ..Step::PLAIN
};

const STEP: &str = "choose";
/// The choice, in the step's folder.
const SCALES: &str = "scales.json";
/// Scale of the first look: it costs a quarter of a photo, and stones that need no more are measured there.
const LOOK_SCALE: f64 = 0.5;
/// Photos of the first look: one for each so many that are chosen, up to [`MOST_LOOKS`].
const CHOSEN_PER_LOOK: usize = 8;
const MOST_LOOKS: usize = 3;
/// Fewest stones from which the size of stones is estimated.
const LEAST_STONES: usize = 20;
/// Share of the stones that are smaller than the size returned. 0.1: with 0.25, photos of the fountain were reduced to
/// 0.66 to 0.79, and 5 % fewer pairs of stones were found, though no fewer of the reference masks.
const SMALLER: f64 = 0.1;
/// Share of a photo whose pixels on the wall are smaller than those by which its scale is chosen.
const NEARER: f64 = 0.75;
/// A photo is reduced to this scale at most: less brings nothing.
const LARGEST_REDUCED: f64 = 0.8;
/// Least scale.
const LEAST_SCALE: f64 = 0.1;

impl Run<'_> {
    /// The scale at which the detector looks at each posed photo of an epoch; `None` for those at which it does not.
    pub(super) fn chosen(&self, epoch: EpochId) -> Result<Arc<Vec<Option<f64>>>> {
        self.once(&CHOOSE, epoch, || {
            let ingested = self.ingested(epoch)?;
            let step = choose(self.context, epoch, &ingested, &self.outside(epoch)?)?;
            read_json(&step.file(SCALES))
        })
    }
}

fn choose(context: &Context, id: EpochId, ingested: &Ingested, outside: &[Point3<f64>]) -> Result<StepDir> {
    let epoch = &context.project.epochs[id];
    let settings = &context.project.settings;
    let mut digests = vec![
        ingested.step.key().as_str().to_owned(),
        context.weights_digest(&Weights::named(&settings.segment.model))?,
    ];
    if let Some(files) = &epoch.photos {
        digests.extend([context.digest(&files.cameras)?, context.digest(&files.images)?]);
    }
    let digests: Vec<&str> = digests.iter().map(String::as_str).collect();
    let cell_m = settings.views.cell_m;
    let params = (&settings.segment, cell_m, &settings.label, outside);
    let key = Key::new(STEP, &params, &digests);
    context.step(&format!("{STEP}-{id}"), key, |step, warnings| {
        let posed = posed_photos(epoch, &Warnings::default())?;
        let usable: Vec<usize> = { 0..posed.len() }
            .filter(|&photo| unusable(&posed[photo].0, &posed[photo].1).is_none())
            .collect();
        let views: Vec<View> = usable.iter().map(|&photo| posed[photo].0.clone()).collect();
        let cells = surface_cells::<_, Error>(&ingested.tiles.surveyed, cell_m, context.progress)?;
        let cells = orient(cells, cell_m, outside).cells;
        let sights = Sights::of(&views, &cells, cell_m, context.progress)?;
        let chosen = sights.cover(settings.segment.photos_per_place as usize);
        let mut scales = vec![None; posed.len()];
        if chosen.is_empty() {
            // Photos that show no wall, perhaps because clouds and cameras do not fit.
            usable.iter().for_each(|&photo| scales[photo] = Some(1.0));
            return write_json(&step.file(SCALES), &scales);
        }

        let looks = (chosen.len() / CHOSEN_PER_LOOK).clamp(1, MOST_LOOKS);
        let first = chosen.iter().take(looks);
        let first = first.map(|&place| (&posed[usable[place]], sights.of_photos[place].as_slice()));
        let stone_m = smaller_stones(context, ingested, &first.collect::<Vec<_>>())?;
        for &place in &chosen {
            let scale = stone_m.map_or(1.0, |m| {
                scale_for(m / settings.segment.tiling.stone_px, &sights.of_photos[place])
            });
            scales[usable[place]] = Some(scale);
        }
        let words = said(&scales, settings.segment.photos_per_place, stone_m);
        warnings.notice(STEP, &epoch.name, words);
        write_json(&step.file(SCALES), &scales)
    })
}

/// The scale at which pixels on most of the wall that a photo shows are `pixel_m` metres wide; 1 where it would
/// hardly be smaller.
fn scale_for(pixel_m: f64, sights: &[Sight]) -> f64 {
    let mut gsds_m: Vec<f64> = sights.iter().map(|s| s.gsd_m).collect();
    gsds_m.sort_by(f64::total_cmp);
    let scale = quantile(&gsds_m, NEARER) / pixel_m;
    match scale <= LARGEST_REDUCED {
        true => ((100.0 * scale).ceil() / 100.0).max(LEAST_SCALE),
        false => 1.0,
    }
}

/// The lower decile of the sizes of stones on the wall (square roots of their areas), metres, from a first look at
/// some photos; none where they show few.
fn smaller_stones(
    context: &Context,
    ingested: &Ingested,
    photos: &[(&(View, PathBuf), &[Sight])],
) -> Result<Option<f64>> {
    let settings = &context.project.settings;
    let (tiling, progress) = (&settings.segment.tiling, context.progress);
    let weights = Weights::named(&settings.segment.model);
    let finder = StoneFinder::open(&weights, tiling.min_score as f32)?;
    let takes_relief = weights.takes_relief()?;
    let tiles = |view: &View| tiling.tile_count(view.camera.width, view.camera.height, LOOK_SCALE);
    let count = photos.iter().map(|((view, _), _)| tiles(view)).sum();
    progress.begin("a first look at the size of stones", count);
    let mut sizes_m: Vec<f64> = Vec::new();

    for ((view, path), sights) in photos {
        // A photo that cannot be read is named where stones are sought.
        let Ok(image) = read_rgb(path) else { continue };
        let relief = takes_relief
            .then(|| photo_relief(&ingested.tiles.surveyed, view, &settings.label, progress))
            .transpose()?;
        let stones = segment_photo(&finder, &image, LOOK_SCALE, relief.as_ref(), tiling, progress)?;
        // Pixels, and sums of their columns and rows.
        let mut sums: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
        let width = stones.labels.width() as usize;
        for (at, id) in stones.labels.data().iter().enumerate().filter(|(_, id)| **id > 0) {
            let sum = sums.entry(*id).or_default();
            sum[0] += 1.0;
            sum[1] += (at % width) as f64 + 0.5;
            sum[2] += (at / width) as f64 + 0.5;
        }
        sizes_m.extend(sums.into_values().filter_map(|[count, x, y]| {
            let middle = [x / count, y / count];
            let distance = |s: &Sight| (s.pixel[0] - middle[0]).hypot(s.pixel[1] - middle[1]);
            let nearest = { sights.iter() }.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            // Beside the wall there is no cell so near.
            let is_near = distance(nearest) * nearest.gsd_m <= settings.views.cell_m;
            is_near.then(|| nearest.gsd_m * (count / nearest.cosine).sqrt())
        }));
    }

    sizes_m.sort_by(f64::total_cmp);
    Ok((sizes_m.len() >= LEAST_STONES).then(|| quantile(&sizes_m, SMALLER)))
}

/// What was chosen, and why.
fn said(scales: &[Option<f64>], photos_per_place: u32, stone_m: Option<f64>) -> Said {
    let chosen = scales.iter().flatten();
    let [least, most] = [f64::min, f64::max].map(|f| chosen.clone().copied().reduce(f).unwrap_or(1.0));
    let range = match least < most {
        true => format!("{least}-{most}"),
        false => format!("{least}"),
    };
    let stones = match stone_m {
        Some(stone_m) => SIZE_OF_STONES.say(&[("size", Said::numbers(format!("{stone_m:.2}")))]),
        None => Said::from(&SIZE_UNKNOWN),
    };
    PHOTOS_CHOSEN.say(&[
        ("n", chosen.clone().count().to_string().into()),
        ("all", scales.len().to_string().into()),
        ("scales", Said::numbers(range)),
        ("each", photos_per_place.to_string().into()),
        ("stones", stones),
    ])
}
