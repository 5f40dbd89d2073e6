//! The method, from surveys to results.

use crate::error::{Error, Result};
use crate::files::write_readable_json;
use crate::pipeline::clouds_out::write_clouds;
use crate::pipeline::compare::compare;
use crate::pipeline::context::Context;
use crate::pipeline::evidence::write_evidence;
use crate::pipeline::face_cloud::write_face_cloud;
use crate::pipeline::label::{Labelled, label};
use crate::pipeline::matching::find_partners;
use crate::pipeline::photos::{Segmented, segment};
use crate::pipeline::registration::register;
use crate::pipeline::run_record::write_run_record;
use crate::pipeline::score::evaluate;
use crate::pipeline::series::write_series;
use crate::pipeline::tables::{stone_rows, write_audit, write_change, write_stone_outlines};
use crate::pipeline::tiled::{Tiled, tile_epoch};
use crate::project::Project;
use crate::report::{StoneRow, read_outlines, write_layers, write_report, write_stones_named};
use crate::warnings::Warning;
use nalgebra::Point3;
use serde_json::json;
use std::path::Path;
use stonewise_core::change::OutwardReference;
use stonewise_core::cloud::TileSource;
use stonewise_core::evaluate::Evaluation;
use stonewise_core::geometry::{Bounds, View};
use stonewise_core::progress::Progress;
use stonewise_core::stone::Stone;

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Until {
    /// Masks of every photo.
    Segmented,
    /// Stones in the clouds.
    Labelled,
    /// Stones across epochs.
    Matched,
    /// Motions of stones.
    Registered,
    /// Every table of results, M3C2 and evaluation too, but no copies of the clouds and no report.
    Compared,
    /// Everything.
    Reported,
}

/// What a run did.
#[derive(Clone, Debug)]
pub struct Summary {
    /// What went wrong without stopping the run.
    pub warnings: Vec<Warning>,
    /// Each later epoch against the first.
    pub pairs: Vec<PairSummary>,
}

/// What came out for a later epoch against the first.
#[derive(Clone, Debug, Default)]
pub struct PairSummary {
    /// One row for each stone of the first epoch; empty where the run did not go so far.
    pub rows: Vec<StoneRow>,
    /// Where the project knows the motion, and the run went so far.
    pub evaluation: Option<Evaluation>,
}

impl Summary {
    /// Whether an input was left out.
    pub fn skipped_inputs(&self) -> bool {
        self.warnings.iter().any(|w| w.skipped_input)
    }
}

/// Runs a project as far as asked, in the folder `out`; takes over whatever an earlier run finished there.
///
/// Errors: an input that cannot be used, epochs that do not overlap, a full disk, interruption. What is finished
/// stays, and the same call goes on from there.
pub fn run(project: &Project, out: &Path, until: Until, progress: &dyn Progress) -> Result<Summary> {
    run_in(&Context::new(project, out, progress)?, until)
}

/// The same in a context of the caller's.
pub(crate) fn run_in(context: &Context, until: Until) -> Result<Summary> {
    let epochs = 1..=context.project.epochs.len();
    let tiled = epochs
        .clone()
        .map(|n| tile_epoch(context, n))
        .collect::<Result<Vec<_>>>()?;
    check_overlap(context, &tiled)?;
    let photos = epochs
        .clone()
        .map(|n| segment(context, n))
        .collect::<Result<Vec<_>>>()?;
    if until == Until::Segmented {
        return Ok(summary(context, Vec::new()));
    }
    let labelled = tiled
        .into_iter()
        .zip(&photos)
        .zip(1..)
        .map(|((tiled, photos), number)| label(context, number, tiled, photos))
        .collect::<Result<Vec<_>>>()?;
    for number in epochs.clone() {
        write_audit(context, number, &photos[number - 1], &labelled[number - 1])?;
    }
    if until == Until::Labelled {
        epochs
            .clone()
            .try_for_each(|n| write_clouds(context, n, &labelled[n - 1], None))?;
        return Ok(summary(context, Vec::new()));
    }
    let mut pairs = Vec::new();
    for number in epochs.clone().skip(1) {
        pairs.push(measure(context, &photos, &labelled, number, until)?);
    }
    if until == Until::Matched {
        return Ok(summary(context, pairs));
    }
    write_stone_outlines(context, &labelled[0])?;
    if until < Until::Reported {
        write_run_record(context, &photos, &labelled)?;
        return Ok(summary(context, pairs));
    }
    let outlines = read_outlines(&context.out)?;
    let rows: Vec<&[StoneRow]> = pairs.iter().map(|pair| pair.rows.as_slice()).collect();
    context.timed("evidence", || {
        write_evidence(context, &photos, &labelled, &outlines, &rows)
    })?;
    for number in epochs {
        let rows = if number == 1 {
            pairs.first().map(|pair| pair.rows.as_slice())
        } else {
            None
        };
        write_clouds(context, number, &labelled[number - 1], rows)?;
    }
    if let Some(rows) = rows.first() {
        context.timed("face cloud", || write_face_cloud(context, &labelled[0], rows))?;
    }
    write_series(context, &pairs)?;
    write_run_record(context, &photos, &labelled)?;
    context.timed("report", || Ok(write_report(&context.out)?))?;
    context.timed("layers", || Ok(write_layers(&context.out)?))?;
    Ok(summary(context, pairs))
}

/// Stones of the first epoch, before any known motion is asked for.
pub(crate) fn first_stones(context: &Context) -> Result<Vec<Stone>> {
    let tiled = tile_epoch(context, 1)?;
    Ok(label(context, 1, tiled, &segment(context, 1)?)?.stones)
}

/// Matches, measures and compares one later epoch against the first, and writes its tables.
fn measure(
    context: &Context,
    photos: &[Segmented],
    labelled: &[Labelled],
    number: usize,
    until: Until,
) -> Result<PairSummary> {
    let (first, second) = (&labelled[0], &labelled[number - 1]);
    let matched = find_partners(context, first, second, number)?;
    if matched.pairs().is_empty() {
        return Err(Error::NoMatch {
            epochs: [0, number - 1].map(|e| context.project.epochs[e].name.clone()),
            stones: [first.stones.len(), second.stones.len()],
        });
    }
    let named = |stem: &str| {
        if number == 2 {
            stem.to_owned()
        } else {
            format!("{stem}_{}", number - 1)
        }
    };
    write_readable_json(
        &context.out.join(format!("{}.json", named("matches"))),
        &matched.report,
    )?;
    if until == Until::Matched {
        return Ok(PairSummary::default());
    }
    let registered = register(context, first, second, &matched, number)?;
    let rows = stone_rows(context, first, second, &matched, &registered);
    write_stones_named(&context.out, &named("stones"), &rows)?;
    write_readable_json(
        &context.out.join(format!("{}.json", named("registration"))),
        &json!(registered.summary),
    )?;
    let change = if until > Until::Registered {
        let centres: Vec<Point3<f64>> = photos[0].views.iter().map(View::centre).collect();
        let outward = OutwardReference::Towards(&centres);
        let change = compare(context, [&first.tiled, &second.tiled], number, &outward)?;
        context.timed("write m3c2", || {
            write_change(&context.out, &named("m3c2"), &change)
        })?;
        Some(change)
    } else {
        None
    };
    let evaluation = evaluate(context, &first.stones, &rows, change.as_ref(), number);
    if let Some(evaluation) = &evaluation {
        write_readable_json(
            &context.out.join(format!("{}.json", named("evaluation"))),
            evaluation,
        )?;
    }
    Ok(PairSummary { rows, evaluation })
}

/// Epochs whose clouds lie apart cannot be compared.
fn check_overlap(context: &Context, tiled: &[Tiled]) -> Result<()> {
    let bounds = |t: &Tiled| {
        (0..t.tiles.tile_count())
            .map(|i| t.tiles.bounds(i))
            .reduce(|a, b| a.union(&b))
    };
    let boxes: Vec<Bounds> = tiled.iter().filter_map(bounds).collect();
    for (number, bounds) in boxes.iter().enumerate().skip(1) {
        if !boxes[0].intersects(bounds) {
            let names = [0, number].map(|e| &context.project.epochs[e].name);
            return Err(Error::Survey(format!(
                "epochs {:?} and {:?} do not overlap: one reaches from {:.1?} to {:.1?} m, the other from {:.1?} to {:.1?} m; \
                 are they in one frame?",
                names[0],
                names[1],
                boxes[0].min.coords.as_slice(),
                boxes[0].max.coords.as_slice(),
                bounds.min.coords.as_slice(),
                bounds.max.coords.as_slice()
            )));
        }
    }
    Ok(())
}

fn summary(context: &Context, pairs: Vec<PairSummary>) -> Summary {
    Summary {
        warnings: context.warnings.sorted(),
        pairs,
    }
}
