//! `train`.

use crate::args::TrainArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use std::path::Path;
use stonewise_segment::backend::{Training, device};
use stonewise_segment::model::MaskRcnnConfig;
use stonewise_segment::train::{
    Rendered, Run, Start, Stop, Total, TrainParams, Trainer, model_path, open_training,
};

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
    let start = match args.from.as_str() {
        "none" => Start::Nothing(config.model),
        file => Start::File(file.into()),
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
    let training = &trainer.config().training;
    let source = Rendered {
        seed: training.seed,
        size_px: training.crop_px,
    };
    let validation = source.validation(VALIDATION_IMAGES);
    let run = Run {
        source: &source,
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

fn read_config(path: &Path) -> Result<Config> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    toml::from_str(&text).with_context(|| path.display().to_string())
}
