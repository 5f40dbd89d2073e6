//! `detector train`.

use crate::args::TrainArgs;
use crate::commands::Outcome;
use crate::commands::parameters::in_file;
use crate::counted::counted;
use crate::printer::Printer;
use anyhow::{Result, bail};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use stonewise::{OutputFolder, Owner, read_toml};
use stonewise_core::params::Params;
use stonewise_segment::dataset::{LabelledPhotos, PhotoCrops};
use stonewise_segment::model::MaskRcnnConfig;
use stonewise_segment::train::{
    Rendered, Run, SampleSource, Start, Stop, Total, TrainParams, model_path, open_training,
};
use stonewise_segment::{Sample, Weights};

/// Rendered images on which a training is measured.
const VALIDATION_IMAGES: u64 = 24;

/// The file behind `--config`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    /// The detector, where training starts from random weights.
    #[serde(default = "MaskRcnnConfig::light")]
    model: MaskRcnnConfig,
    /// How it is trained.
    training: Option<TrainParams>,
}

/// Trains, or goes on training, until the time is up.
pub fn train(args: &TrainArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let config = match &args.config {
        Some(path) => {
            let config: Config = read_toml(path)?;
            if let Some(training) = &config.training {
                training.check().map_err(in_file(path))?;
            }
            config
        }
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
    let inputs: Vec<PathBuf> = [&args.data, &args.images, &args.valid]
        .into_iter()
        .flatten()
        .cloned()
        .collect();

    let owner = Owner::inputs("training", &inputs);
    let _folder = OutputFolder::of_inputs(&args.out, &owner, &inputs, &[], force)?;
    let total = args.total_minutes.map(Total::Minutes);
    let mut trainer = open_training(&args.out, &start, config.training, total, args.minutes)?;
    let elapsed = trainer.elapsed();

    if elapsed.steps > 0 {
        let minutes = elapsed.seconds / 60.0;
        printer.log(&format!(
            "going on after {}, {minutes:.1} minutes",
            counted(elapsed.steps, "step")
        ));
    }

    let training = trainer.config().training.clone();
    let (photos, source): (LabelledPhotos, PhotoCrops);
    let rendered = Rendered {
        seed: training.seed,
        size_px: training.crop_px,
        relief: training.relief,
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
        "{}, {:.1} minutes; the detector: {}",
        counted(elapsed.steps, "step"),
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
    printer.log(&format!("{} with masks", counted(photos.photos().len(), "photo")));
    if !photos.unlabelled().is_empty() {
        printer.log(&format!(
            "note: photos without masks, left out: {}",
            photos.unlabelled().len()
        ));
    }
}
