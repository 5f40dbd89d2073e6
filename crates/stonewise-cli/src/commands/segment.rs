//! `detector segment`.

use crate::args::SegmentArgs;
use crate::commands::{Outcome, run};
use crate::counted::counted;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::{Result, bail};
use std::io::Write;
use stonewise::segmentation::{FolderJob, MaskEvaluation, require_memory, segment_folder};
use stonewise::{Language, OutputFolder, Owner, Until};
use stonewise_core::params::Params;
use stonewise_segment::Weights;
use stonewise_segment::dataset::Reference;
use stonewise_segment::evaluation::MaskScore;
use stonewise_segment::tiling::TilingOptions;

/// Refuses options that a project has as parameters, or that are for folders of photos only.
fn refuse_options(args: &SegmentArgs) -> Result<()> {
    let parameters = [
        (args.model.is_some(), "model", "`model` in its section [segment]"),
        (
            args.scales.is_some(),
            "scales",
            "`scales` in its section [segment.tiling]",
        ),
        (
            args.min_score.is_some(),
            "min-score",
            "`min_score` in its section [segment.tiling]",
        ),
    ];
    let file = args.input.display();
    if let Some((_, option, parameter)) = parameters.iter().find(|(is_given, ..)| *is_given) {
        bail!("{file}: --{option} cannot be used with a project file; set {parameter} instead");
    }
    for (is_given, option) in [
        (args.boxes.is_some(), "boxes"),
        (args.reference.is_some(), "reference"),
    ] {
        if is_given {
            bail!(
                "{file}: --{option} cannot be used with a project file; give the folder of its photos as input instead"
            );
        }
    }
    Ok(())
}

/// Segments photos, or the photos of a project.
pub fn segment(args: SegmentArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    if args
        .input
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
    {
        refuse_options(&args)?;
        let out = args.out.unwrap_or_else(|| "results".into());
        return run::run_project(&args.input, &out, Until::Segmented, force, printer);
    }
    let out = args.out.unwrap_or_else(|| "stones".into());

    let mut tiling = TilingOptions::default();
    tiling.scales = args.scales.unwrap_or(tiling.scales);
    tiling.min_score = args.min_score.unwrap_or(tiling.min_score);
    tiling.check()?;
    if !force {
        require_memory()?;
    }
    let reference = match &args.reference {
        Some(masks) => Some(Reference::open(masks, args.valid.as_deref())?),
        None => None,
    };
    let inputs = [args.input.clone()];
    let written = ["labels", "overlays", "masks.json", "evaluation.json", "work"];
    let folder = OutputFolder::of_inputs(&out, &Owner::inputs("stones", &inputs), &inputs, &written, force)?;

    let summary = segment_folder(
        &FolderJob {
            photos: &args.input,
            out: folder.path(),
            weights: &args.model.as_deref().map_or(Weights::BuiltIn, Weights::named),
            tiling: &tiling,
            boxes: args.boxes.as_deref(),
            reference: reference.as_ref(),
        },
        printer,
    )?;
    printer.finish();
    for warning in &summary.warnings {
        printer.log(&format!("skipped: {}", warning.line(Language::English)));
    }

    printer.log(&format!(
        "{} in {}; look at {}",
        counted(summary.stones, "stone"),
        counted(summary.photos, "photo"),
        out.join("overlays").display()
    ));
    if let Some(evaluation) = &summary.evaluation {
        write!(stdout(), "{}", table(evaluation))?;
    }

    Ok(if summary.warnings.is_empty() {
        Outcome::Done
    } else {
        Outcome::InDoubt
    })
}

/// Figures as a table, a photo a row.
fn table(evaluation: &MaskEvaluation) -> String {
    let width = evaluation
        .photos
        .iter()
        .map(|p| p.photo.len())
        .max()
        .unwrap_or(0)
        .max(5);
    let mut text = format!(
        "{:width$}  found  reference  right  precision  recall     F1   mIoU   AP50     AP\n",
        "photo"
    );
    let rows = evaluation.photos.iter().map(|p| (p.photo.as_str(), &p.score));
    for (name, score) in rows.chain([("total", &evaluation.total)]) {
        text += &row(name, score, width);
    }
    text
}

fn row(name: &str, score: &MaskScore, width: usize) -> String {
    let share = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
    format!(
        "{name:width$}  {:5}  {:9}  {:5}  {:>9}  {:>6}  {:>5}  {:>5}  {:>5}  {:>5}\n",
        score.found,
        score.references,
        score.right,
        share(score.precision),
        share(score.recall),
        share(score.f1),
        share(score.mean_iou),
        share(score.ap50),
        share(score.ap)
    )
}
