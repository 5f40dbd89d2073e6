//! A training of a given number of minutes, over as many calls as it takes.

use crate::error::Result;
use crate::files::create_results_folder;
use std::path::Path;
use stonewise_core::progress::Progress;
use stonewise_segment::Sample;
use stonewise_segment::train::{
    Elapsed, Run, SampleSource, Start, Total, TrainParams, model_path, open_training,
};

/// Trains in `folder` until the minutes are spent; an interrupted training goes on, and one that has ended is
/// taken over. `validation`: the images on which it is measured meanwhile, made where it has not ended.
pub fn train_for(
    minutes: f64,
    folder: &Path,
    (start, params): (&Start, Option<TrainParams>),
    source: &dyn SampleSource,
    validation: impl FnOnce() -> Result<Vec<Sample>>,
    progress: &dyn Progress,
) -> Result<Elapsed> {
    create_results_folder(folder)?;
    let total = Total::Minutes(minutes);
    let mut trainer = open_training(folder, start, params, Some(total), None)?;
    if total.share_done(trainer.elapsed()) < 1.0 || !model_path(folder).exists() {
        let run = Run {
            source,
            validation: &validation()?,
            out: folder,
            minutes: None,
            threads: 1,
            progress,
        };
        run.train(&mut trainer)?;
        progress.check()?;
    }
    Ok(*trainer.elapsed())
}
