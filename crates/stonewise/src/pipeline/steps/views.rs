//! Views of the clouds of an epoch without photos.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::steps::ingest::{INGEST, Ingested, scanners};
use crate::project::{Epoch, PhotoFiles, Project};
use crate::settings::Align;
use crate::storage::step::{Key, StepDir};
use crate::storage::tiles::{DiskTiles, TileValues};
use crate::texts::SIDE_UNSURE;
use crate::texts::notices::{VIEWS_OF_COLOURS, VIEWS_OF_INTENSITIES, VIEWS_OF_RELIEF};
use nalgebra::Point3;
use rayon::prelude::*;
use std::fs;
use std::sync::Arc;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::surface::oriented_surface;
use stonewise_core::views::{Picture, PlannedView, Shade, Tones, Toning, Walls, plan_views};
use stonewise_io::cameras::write_metashape;
use stonewise_io::image_io::write_png_rgb;

/// Makes views of the clouds of an epoch that has no photos; the steps behind take them for photos.
pub static VIEWS: Step = Step {
    name: STEP,
    words: |_| "views of the clouds of",
    about: About::Epoch,
    needs: &[Need::same(&INGEST), Need::reference(&VIEWS)],
    applies: has_no_photos,
    cost: Some(|_, _| Cost::of(4, PICTURE_BYTES)),
    make: |run, epoch| run.pictured(epoch).map(drop),
    ..Step::PLAIN
};

const STEP: &str = "views";
/// The pictures and their cameras, in the step's folder.
const IMAGES: &str = "images";
const CAMERAS: &str = "cameras.xml";
/// The area of the walls, square metres.
const WALLS: &str = "walls.json";
/// Memory for the pictures that are drawn at a time.
const PICTURE_BYTES: u64 = 512 << 20;

/// Whether views take the place of photos.
pub fn has_no_photos(project: &Project, epoch: EpochId) -> bool {
    project.epochs[epoch].photos.is_none()
}

impl Run<'_> {
    /// An epoch with photos: its own, or views of its clouds.
    pub fn pictured(&self, epoch: EpochId) -> Result<Arc<Epoch>> {
        self.once(&VIEWS, epoch, || {
            let own = self.context.project.epochs[epoch].clone();
            if own.photos.is_some() {
                return Ok(own);
            }
            let (ingested, outside) = (self.ingested(epoch)?, self.outside(epoch)?);
            let step = draw(self.context, epoch, &ingested, &outside)?;
            Ok(Epoch {
                photos: Some(PhotoFiles {
                    images: step.file(IMAGES),
                    cameras: step.file(CAMERAS),
                }),
                ..own
            })
        })
    }
}

impl Run<'_> {
    /// The area of the walls that the clouds of an epoch without photos show, square metres; none with photos.
    pub fn walls_m2(&self, epoch: EpochId) -> Result<Option<f64>> {
        if !has_no_photos(self.context.project, epoch) {
            return Ok(None);
        }
        let pictured = self.pictured(epoch)?;
        let views = pictured
            .photos
            .as_ref()
            .and_then(|photos| photos.cameras.parent());
        views.map(|views| read_json(&views.join(WALLS))).transpose()
    }

    /// Places from which the wall of an epoch is seen: that which the project names, else those of its scanners, else
    /// of cameras: of photos, or of the views of the reference, so that all epochs have the same outside. None
    /// where nothing is known.
    fn outside(&self, id: EpochId) -> Result<Vec<Point3<f64>>> {
        let project = self.context.project;
        let epochs = &project.epochs;
        // Places of another epoch lie in another frame.
        let is_own_frame = project.settings.registration.align == Align::None;
        if let Some(place) = project.settings.views.outside
            && (is_own_frame || id == EpochId::REFERENCE)
        {
            return Ok(vec![place.into()]);
        }
        let scanners = scanners(&epochs[id])?;
        if !scanners.is_empty() {
            return Ok(scanners);
        }
        let centres = |epoch: &Epoch| -> Result<Vec<Point3<f64>>> {
            Ok(epoch.read_cameras()?.views.iter().map(View::centre).collect())
        };
        if !is_own_frame {
            return Ok(Vec::new());
        }
        match epochs.iter().find(|e| e.photos.is_some()) {
            Some(photographed) => centres(photographed),
            None if id == EpochId::REFERENCE => Ok(Vec::new()),
            None => {
                let reference = self.pictured(EpochId::REFERENCE)?;
                centres(&reference)
            }
        }
    }
}

fn draw(context: &Context, id: EpochId, ingested: &Ingested, outside: &[Point3<f64>]) -> Result<StepDir> {
    let epoch = &context.project.epochs[id];
    let params = &context.project.settings.views;
    let key = Key::new(STEP, &(params, outside), &[ingested.step.key().as_str()]);
    context.step(&format!("{STEP}-{id}"), key, |step, warnings| {
        let tiles = &ingested.tiles.surveyed;
        let surface = oriented_surface::<_, Error>(tiles, params.cell_m, outside, context.progress)?;
        // Stones of an epoch whose side is wrong do not align.
        if outside.is_empty() && !surface.is_sure() && !context.project.is_aligned(id) {
            warnings.doubt(STEP, &epoch.name, &SIDE_UNSURE);
        }
        let views = plan_views(&surface.cells, params);
        if views.is_empty() {
            return Err(no_walls(epoch));
        }
        let walls = Walls::among(&surface.cells, params.cell_m);
        let tones = tones(context, tiles)?;
        let toning = match params.show {
            Some(shade) => tones.toning(shade),
            None => tones.decide(),
        };
        let notice = match toning.shade() {
            Shade::Colour => &VIEWS_OF_COLOURS,
            Shade::Intensity => &VIEWS_OF_INTENSITIES,
            Shade::Relief => &VIEWS_OF_RELIEF,
        };
        let count = views.len().to_string();
        warnings.notice(STEP, &epoch.name, notice.say(&[("n", count.into())]));
        write_json(&step.file(WALLS), &walls.area_m2())?;
        let images = step.file(IMAGES);
        fs::create_dir_all(&images).map_err(Error::io("making a folder", &images))?;
        let drawing = Drawing {
            context,
            tiles,
            toning: &toning,
            walls: &walls,
        };
        for batch in batches(&views) {
            for (planned, picture) in batch.iter().zip(drawing.pictures(batch)?) {
                let image = match toning.shade() {
                    Shade::Relief => picture.relief(),
                    Shade::Colour | Shade::Intensity => picture.image(),
                };
                write_png_rgb(&images.join(&planned.view.name), &image)?;
            }
        }
        let cameras: Vec<View> = views.into_iter().map(|planned| planned.view).collect();
        Ok(write_metashape(&step.file(CAMERAS), &cameras, None)?)
    })
}

/// Views whose pictures fit into memory together.
fn batches(views: &[PlannedView]) -> Vec<&[PlannedView]> {
    let mut batches = Vec::new();
    let (mut start, mut bytes) = (0, 0);
    for (i, PlannedView { view, .. }) in views.iter().enumerate() {
        let own = Picture::PIXEL_BYTES * u64::from(view.camera.width) * u64::from(view.camera.height);
        if i > start && bytes + own > PICTURE_BYTES {
            batches.push(&views[start..i]);
            (start, bytes) = (i, 0);
        }
        bytes += own;
    }
    batches.push(&views[start..]);
    batches
}

/// Colours and intensities of all points of an epoch.
fn tones(context: &Context, tiles: &DiskTiles) -> Result<Tones> {
    let mut tones = Tones::default();
    context
        .progress
        .begin("colours and intensities", tiles.tile_count() as u64);
    for tile in 0..tiles.tile_count() {
        context.progress.check()?;
        let values = tiles.values(tile)?;
        tones.add(&tiles.load(tile)?, &values.borrowed());
        context.progress.advance(1);
    }
    Ok(tones)
}

/// Draws the points of a tile in a picture.
type Draw<'c, 'v> = Box<dyn Fn(&mut Picture<'v>) + Sync + 'c>;

/// What pictures are drawn from.
struct Drawing<'a> {
    context: &'a Context<'a>,
    tiles: &'a DiskTiles,
    toning: &'a Toning,
    walls: &'a Walls<'a>,
}

impl Drawing<'_> {
    /// The pictures of a few views.
    fn pictures<'v>(&self, views: &'v [PlannedView]) -> Result<Vec<Picture<'v>>> {
        let mut pictures: Vec<Picture> = views.iter().map(Picture::new).collect();
        self.pass(&mut pictures, "depths", |_, cloud| {
            Ok(Box::new(move |picture: &mut Picture| picture.add_depths(cloud)))
        })?;
        self.pass(&mut pictures, "values", |tile, cloud| {
            let raw: TileValues = self.tiles.values(tile)?;
            let values = self.toning.values(cloud, &raw.borrowed(), self.walls);
            Ok(Box::new(move |picture: &mut Picture| {
                picture.add_values(cloud, &values);
            }))
        })?;
        Ok(pictures)
    }

    /// Shows every tile to the pictures that may show it.
    fn pass<'v>(
        &self,
        pictures: &mut [Picture<'v>],
        what: &str,
        draw: impl for<'c> Fn(usize, &'c Cloud) -> Result<Draw<'c, 'v>>,
    ) -> Result<()> {
        let progress = self.context.progress;
        progress.begin(&format!("views: {what}"), self.tiles.tile_count() as u64);
        for tile in 0..self.tiles.tile_count() {
            progress.check()?;
            let bounds = self.tiles.bounds(tile);
            if pictures.iter().any(|p| p.may_show(&bounds)) {
                let cloud = self.tiles.load(tile)?;
                let draw = draw(tile, &cloud)?;
                pictures
                    .par_iter_mut()
                    .filter(|p| p.may_show(&bounds))
                    .for_each(&draw);
            }
            progress.advance(1);
        }
        Ok(())
    }
}

fn no_walls(epoch: &Epoch) -> Error {
    Error::Survey(format!(
        "the clouds of epoch {:?} show no wall of more than a square metre to look at: are they dense enough (fifty points a \
         square metre at least), and in metres?",
        epoch.name
    ))
}
