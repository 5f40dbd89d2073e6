//! `train`.

use crate::args::TrainArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use std::path::Path;
use stonewise_segment::backend::{Training, device};
use stonewise_segment::dataset::{LabelledPhotos, PhotoCrops};
use stonewise_segment::model::MaskRcnnConfig;
use stonewise_segment::train::{
    Rendered, Run, SampleSource, Start, Stop, Total, TrainParams, Trainer, model_path, open_training,
};
use stonewise_segment::{Sample, Weights};

/// Rendered images on which a training is measured.
const VALIDATION_IMAGES: u64 = 24;

/// The file behind `--config`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    /// The network, where it starts from nothing.
    #[serde(default = "MaskRcnnConfig::light")]
    model: MaskRcnnConfig,
    /// How it is trained.
    training: Option<TrainParams>,
}

/// Trains, or goes on training, until the time is up.
pub fn train(args: &TrainArgs, printer: &Printer) -> Result<Outcome> {
    let config = match &args.config {
        Some(path) => read_config(path)?,
        None => Config {
            model: MaskRcnnConfig::light(),
            training: None,
        },
    };
    let start = if args.from == Path::new("none") {
        Start::Nothing(Box::new(config.model))
    } else {
        Start::Weights(Weights::named(&args.from))
    };
    std::fs::create_dir_all(&args.out).with_context(|| format!("making {}", args.out.display()))?;
    let total = args.total_minutes.map(Total::Minutes);
    let mut trainer: Trainer<Training> =
        open_training(&args.out, &start, config.training, total, args.minutes, &device())?;
    let elapsed = trainer.elapsed();
    if elapsed.steps > 0 {
        let minutes = elapsed.seconds / 60.0;
        printer.log(&format!(
            "going on after {} steps, {minutes:.1} minutes",
            elapsed.steps
        ));
    }
    let training = trainer.config().training.clone();
    let (photos, source): (LabelledPhotos, PhotoCrops);
    let rendered = Rendered {
        seed: training.seed,
        size_px: training.crop_px,
    };
    let (source, validation): (&dyn SampleSource, Vec<Sample>) = match (&args.data, &args.images) {
        (Some(masks), Some(images)) => {
            photos = LabelledPhotos::open(images, masks, args.valid.as_deref())?;
            tell(&photos, printer);
            source = PhotoCrops::new(&photos, training.augment.clone(), training.crop_px, training.seed);
            let validation = source.validation()?;
            (&source, validation)
        }
        _ => (&rendered, rendered.validation(VALIDATION_IMAGES)),
    };
    let run = Run {
        source,
        validation: &validation,
        out: &args.out,
        minutes: args.minutes,
        threads: 1,
        progress: printer,
    };
    let stop = run.train(&mut trainer)?;
    let elapsed = trainer.elapsed();
    printer.log(&format!(
        "{} steps, {:.1} minutes; the network: {}",
        elapsed.steps,
        elapsed.seconds / 60.0,
        model_path(&args.out).display()
    ));
    match stop {
        Stop::Finished => {}
        Stop::TimeIsUp => printer.log("the time of this run is up; the same command goes on"),
        Stop::Interrupted => bail!("interrupted; run the same command again to continue"),
    }
    Ok(Outcome::Done)
}

fn tell(photos: &LabelledPhotos, printer: &Printer) {
    printer.log(&format!("{} photos with masks", photos.photos().len()));
    if !photos.unlabelled().is_empty() {
        printer.log(&format!(
            "note: {} photos have no masks and are left out",
            photos.unlabelled().len()
        ));
    }
}

fn read_config(path: &Path) -> Result<Config> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    toml::from_str(&text).with_context(|| path.display().to_string())
}
