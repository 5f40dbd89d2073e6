//! Views of the clouds of an epoch without photos, or beside photos.

mod drawing;
mod stone_size;

pub use drawing::drop_empty;

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::steps::ingest::{INGEST, Ingested, scanners};
use crate::project::{Epoch, PhotoFiles, Project};
use crate::settings::Align;
use crate::storage::step::{Key, StepDir};
use crate::texts::SIDE_UNSURE;
use crate::texts::notices::{VIEWS_OF_COLOURS, VIEWS_OF_INTENSITIES, VIEWS_OF_RELIEF};
use drawing::{Drawing, PICTURE_BYTES, batches, tones};
use nalgebra::Point3;
use std::fs;
use std::sync::Arc;
use stone_size::smaller_stones;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::View;
use stonewise_core::surface::oriented_surface;
use stonewise_core::views::{Shade, Walls, megapixels_of, plan_views};
use stonewise_io::cameras::write_metashape;
use stonewise_io::image_io::write_png_rgb;
use stonewise_segment::Weights;

/// Makes views of the clouds of an epoch that has no photos, or beside them; later steps treat them as photos.
pub static VIEWS: Step = Step {
    name: STEP,
    phase: Some(Phase::Find),
    about: About::Epoch,
    needs: &[Need::same(&INGEST), Need::reference(&VIEWS)],
    applies: Project::has_views,
    cost: Some(|_, _| Cost::of(4, PICTURE_BYTES)),
    make: |run, epoch| run.views(epoch).map(drop),
    ..Step::PLAIN
};

const STEP: &str = "views";
/// The pictures and their cameras, in the step's folder.
const IMAGES: &str = "images";
const CAMERAS: &str = "cameras.xml";
/// The area of the walls, square metres.
const WALLS: &str = "walls.json";

/// Whether views take the place of photos.
pub fn has_no_photos(project: &Project, epoch: EpochId) -> bool {
    project.epochs[epoch].photos.is_none()
}

impl Run<'_> {
    fn views(&self, epoch: EpochId) -> Result<Arc<PhotoFiles>> {
        self.once(&VIEWS, epoch, || {
            let (ingested, outside) = (self.ingested(epoch)?, self.outside(epoch)?);
            let step = draw(self.context, epoch, &ingested, &outside)?;
            Ok(PhotoFiles {
                images: step.file(IMAGES),
                cameras: step.file(CAMERAS),
            })
        })
    }

    /// An epoch with views of its clouds in place of photos.
    fn with_views(&self, epoch: EpochId) -> Result<Epoch> {
        Ok(Epoch {
            photos: Some(PhotoFiles::clone(&*self.views(epoch)?)),
            ..self.context.project.epochs[epoch].clone()
        })
    }

    /// An epoch with photos: its own, or views of its clouds.
    pub fn pictured(&self, epoch: EpochId) -> Result<Epoch> {
        match has_no_photos(self.context.project, epoch) {
            true => self.with_views(epoch),
            false => Ok(self.context.project.epochs[epoch].clone()),
        }
    }

    /// An epoch with views in place of its photos, where the detector looks at both; else none.
    pub fn beside_photos(&self, epoch: EpochId) -> Result<Option<Epoch>> {
        let project = self.context.project;
        let has_both = project.has_views(epoch) && !has_no_photos(project, epoch);
        has_both.then(|| self.with_views(epoch)).transpose()
    }

    /// The area of the walls that the clouds of an epoch without photos show, square metres; none with photos.
    pub fn walls_m2(&self, epoch: EpochId) -> Result<Option<f64>> {
        if !has_no_photos(self.context.project, epoch) {
            return Ok(None);
        }
        let views = self.views(epoch)?;
        let folder = views.cameras.parent();
        folder.map(|folder| read_json(&folder.join(WALLS))).transpose()
    }

    /// Places from which the wall of an epoch is seen: that which the project names, else those of its scanners, else
    /// of cameras: of its photos, of those of another epoch, or of the views of the reference, so that all epochs have
    /// the same outside. Empty where nothing is known.
    pub fn outside(&self, id: EpochId) -> Result<Vec<Point3<f64>>> {
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
        if epochs[id].photos.is_some() {
            return centres(&epochs[id]);
        }
        if !is_own_frame {
            return Ok(Vec::new());
        }
        match epochs.iter().find(|e| e.photos.is_some()) {
            Some(photographed) => centres(photographed),
            None if id == EpochId::REFERENCE => Ok(Vec::new()),
            None => centres(&self.with_views(EpochId::REFERENCE)?),
        }
    }
}

fn draw(context: &Context, id: EpochId, ingested: &Ingested, outside: &[Point3<f64>]) -> Result<StepDir> {
    let epoch = &context.project.epochs[id];
    let settings = &context.project.settings;
    let params = &settings.views;
    // What the detector finds in a first look may decide the size of the pixels.
    let weights = context.weights_digest(&Weights::named(&settings.segment.model))?;
    let key = Key::new(
        STEP,
        &(params, &settings.segment.tiling, &settings.label, outside),
        &[ingested.step.key().as_str(), &weights],
    );
    context.step(&format!("{STEP}-{id}"), key, |step, warnings| {
        let tiles = &ingested.tiles.surveyed;
        let surface = oriented_surface::<_, Error>(tiles, params.cell_m, outside, context.progress)?;
        // Stones of an epoch whose side is wrong do not align.
        if outside.is_empty() && !surface.is_sure() && !context.project.is_aligned(id) {
            warnings.doubt(STEP, &epoch.name, &SIDE_UNSURE);
        }
        let walls = Walls::among(&surface.cells, params.cell_m);
        let tones = tones(context, tiles)?;
        let toning = match params.show {
            Some(shade) => tones.toning(shade),
            None => tones.decide(),
        };
        let drawing = Drawing {
            context,
            tiles,
            toning: &toning,
            walls: &walls,
        };
        let plan = |stone_m| plan_views(&surface.cells, params, stone_m);
        let mut views = plan(None);
        if views.is_empty() {
            return Err(no_walls(epoch));
        }
        if megapixels_of(&views) > params.megapixels
            && let Some(stone_m) = smaller_stones(&drawing, &views)?
        {
            views = plan(Some(stone_m));
        }
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
        for batch in batches(&views) {
            for (planned, image) in batch.iter().zip(drawing.images(batch)?) {
                write_png_rgb(&images.join(&planned.view.name), &image)?;
            }
        }
        let cameras: Vec<View> = views.into_iter().map(|planned| planned.view).collect();
        Ok(write_metashape(&step.file(CAMERAS), &cameras, None)?)
    })
}

fn no_walls(epoch: &Epoch) -> Error {
    Error::Survey(format!(
        "the clouds of epoch {:?} show no wall of more than a square metre to look at: are they dense enough (fifty points a \
         square metre at least), and in metres?",
        epoch.name
    ))
}
