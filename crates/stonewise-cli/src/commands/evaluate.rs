//! `evaluate`.

use crate::args::EvaluateArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::Result;
use std::io::Write;
use std::path::Path;
use stonewise::{OutputFolder, evaluate_truth};
use stonewise_core::evaluate::{Evaluation, EvaluationParams};

/// Scores a finished run; the evaluation goes to stdout as JSON.
pub fn evaluate(args: &EvaluateArgs, printer: &Printer) -> Result<Outcome> {
    let folder = OutputFolder::of_results(&args.results)?;
    let evaluation = score(&args.results, &args.truth, printer)?;
    folder.note_made_anew()?;
    printer.finish();
    writeln!(stdout(), "{}", serde_json::to_string_pretty(&evaluation)?)?;
    Ok(Outcome::Done)
}

/// Scores a finished run, prints the main figures in a line and returns the evaluation.
pub fn score(results: &Path, truth: &Path, printer: &Printer) -> Result<Evaluation> {
    let evaluation = evaluate_truth(results, truth, &EvaluationParams::default())?;
    if let Some(score) = &evaluation.external {
        let rmse = |s: &Option<stonewise_core::evaluate::ErrorStatistics>| {
            s.as_ref()
                .map_or("-".to_owned(), |s| format!("{:.2} mm", 1e3 * s.rmse_m))
        };
        printer.log(&format!(
            "against the truth: {} of {} countable stones measured, RMSE in-plane (2D) {}, out-of-plane {}",
            score.found,
            score.countable,
            rmse(&score.motions.errors.in_plane_2d),
            rmse(&score.motions.errors.out_of_plane),
        ));
    }
    Ok(evaluation)
}
