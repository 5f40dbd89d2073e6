//! Doing one unit of a plan.

use super::inputs::unchanged;
use super::plan::Plan;
use super::receipt::{Receipt, plan_file, times};
use super::stage::{Stage, Unit};
use crate::error::{Error, Result};
use crate::output::OutputFolder;
use crate::pipeline::Summary;
use crate::pipeline::clock::Clock;
use crate::pipeline::context::Context;
use crate::pipeline::look::look;
use crate::pipeline::outputs::clouds::write_clouds;
use crate::pipeline::outputs::outlines::write_stone_outlines;
use crate::pipeline::run::{
    Corrected, check_overlap, corrected, labelled, matched, measured, outlined, run_in,
};
use crate::pipeline::steps::ingest::ingest;
use crate::pipeline::steps::label::batches::LabelBatches;
use crate::pipeline::steps::label::gather_labels;
use crate::pipeline::steps::m3c2::Comparison;
use crate::pipeline::steps::offsets::label_offsets;
use crate::pipeline::steps::register::register;
use crate::pipeline::steps::segment::{segment, segment_photo};
use crate::pipeline::until::Until;
use crate::project::Project;
use crate::storage::step::code_version;
use crate::storage::store::Scope;
use std::path::Path;
use stonewise_core::change::OutwardReference;
use stonewise_core::geometry::View;
use stonewise_core::progress::Progress;

/// A unit that is done.
pub struct UnitDone {
    /// The project.
    pub project: Project,
    /// Whether it was done before.
    pub was_done: bool,
    /// What the run did as a whole, where this was its last unit.
    pub summary: Option<Summary>,
}

/// Does one unit of the plan in a results folder.
///
/// A unit that is done is left as it is. Any number of processes may do units at the same time, also the same
/// one; their files appear whole or not at all.
///
/// # Errors
/// No such unit; a unit that it needs is not done; the plan is that of other inputs, or of another program; a
/// run works in the folder; whatever the step may fail with.
pub fn do_unit(out: &Path, id: &str, progress: &dyn Progress) -> Result<UnitDone> {
    let file = plan_file(out);
    let stale = |message: &str| Error::Plan {
        path: file.clone(),
        message: message.to_owned(),
    };
    // Without a plan there is nothing to lock.
    Plan::read(out)?;
    let folder = OutputFolder::of_unit(out)?;
    let plan = Plan::read(out)?;
    let Some(unit) = plan.units.iter().find(|u| u.id == id) else {
        return Err(stale(&format!("no unit {id:?} in this plan")));
    };
    if plan.program != code_version() {
        return Err(stale(
            "the plan was made by another build of stonewise: do its units with the same, or run `stonewise plan` again",
        ));
    }
    let project = Project::read(&plan.project)?.with_parameters(&plan.parameters)?;
    let digests = unchanged(&plan.inputs, &file)?;
    if Receipt::read(out, &plan.id, id).is_some() {
        return Ok(UnitDone {
            project,
            was_done: true,
            summary: None,
        });
    }
    refuse_too_early(out, &plan, unit)?;
    let clock = Clock::start();
    let scope = Scope {
        unit: id.to_owned(),
        units: plan.units.iter().map(|u| u.id.clone()).collect(),
    };
    let summary = {
        let mut context = Context::of_unit(&project, &folder, scope, digests, progress)?;
        context.unit_times = times(out, &plan.id, plan.units.iter().map(|u| u.id.as_str()));
        do_stage(&context, unit, plan.forced)?
    };
    if summary.is_some() {
        // The last unit: all others are done, and what they left unfinished when they were killed is of no
        // use.
        folder.sweep(&project);
        folder.finish_results(true)?;
    }
    Receipt::write(out, &plan.id, id, &clock)?;
    Ok(UnitDone {
        project,
        was_done: false,
        summary,
    })
}

fn refuse_too_early(out: &Path, plan: &Plan, unit: &Unit) -> Result<()> {
    let is_missing = |id: &&String| Receipt::read(out, &plan.id, id).is_none();
    let first: Vec<String> = unit.needs.iter().filter(is_missing).cloned().collect();
    match first.is_empty() {
        true => Ok(()),
        false => Err(Error::UnitFirst {
            unit: unit.id.clone(),
            first,
        }),
    }
}

fn do_stage(context: &Context, unit: &Unit, forced: bool) -> Result<Option<Summary>> {
    let epoch = unit.epoch.unwrap_or(1);
    match unit.stage {
        Stage::Ingest => ingest(context, epoch).map(drop)?,
        Stage::SegmentPhoto => segment_photo(context, epoch, unit.part.unwrap_or(0))?,
        Stage::Segment => segment(context, epoch).map(drop)?,
        Stage::LabelPrepare | Stage::LabelTiles | Stage::Label => labels(context, epoch, unit)?,
        Stage::Stones => labelled(context, epoch).map(drop)?,
        Stage::Outlines => write_stone_outlines(context, &corrected(context)?.labelled[0])?,
        Stage::Match => pair(context, epoch)?,
        Stage::Offsets | Stage::Register => {
            let Corrected { photos, labelled, .. } = corrected(context)?;
            let (first, second) = (&labelled[0], &labelled[epoch - 1]);
            let matched = matched(context, first, second, epoch)?;
            match unit.stage {
                Stage::Offsets => label_offsets(context, first, second, &matched, epoch).map(drop)?,
                _ => register(
                    context,
                    [&photos[0], &photos[epoch - 1]],
                    [first, second],
                    &matched,
                    epoch,
                )
                .map(drop)?,
            }
        }
        Stage::M3c2Tiles | Stage::M3c2 => compare(context, epoch, unit)?,
        Stage::Clouds => clouds(context, epoch)?,
        Stage::Report => {
            look(context, forced)?;
            return run_in(context, Until::Reported).map(Some);
        }
    }
    Ok(None)
}

fn labels(context: &Context, epoch: usize, unit: &Unit) -> Result<()> {
    let (ingested, photos) = (ingest(context, epoch)?, segment(context, epoch)?);
    let count = unit.parts.unwrap_or(1);
    let batches = LabelBatches::new(context, epoch, &ingested, &photos, count);
    match unit.stage {
        Stage::LabelPrepare => batches.prepare().map(drop),
        Stage::LabelTiles => batches.batch(unit.part.unwrap_or(0)).map(drop),
        _ => gather_labels(context, epoch, &ingested, &photos, count),
    }
}

fn pair(context: &Context, epoch: usize) -> Result<()> {
    let Corrected { labelled, .. } = corrected(context)?;
    let (first, second) = (&labelled[0], &labelled[epoch - 1]);
    check_overlap(context, &[(&first.ingested, 1), (&second.ingested, epoch)])?;
    matched(context, first, second, epoch).map(drop)
}

fn compare(context: &Context, epoch: usize, unit: &Unit) -> Result<()> {
    let centres: Vec<_> = segment(context, 1)?.views.iter().map(View::centre).collect();
    let clouds = [ingest(context, 1)?, ingest(context, epoch)?];
    let outward = OutwardReference::Towards(&centres);
    let comparison = Comparison::new(context, clouds.each_ref(), epoch, &outward);
    let count = unit.parts.unwrap_or(1);
    match unit.stage {
        Stage::M3c2Tiles => comparison.batch(unit.part.unwrap_or(0), count).map(drop),
        _ => comparison.gather(count),
    }
}

fn clouds(context: &Context, epoch: usize) -> Result<()> {
    let Corrected {
        photos,
        labelled,
        edited,
    } = corrected(context)?;
    let own = &labelled[epoch - 1];
    if epoch > 1 {
        return write_clouds(context, epoch, own, None);
    }
    let (_, facade) = outlined(context, own, edited)?;
    let matched = matched(context, own, &labelled[1], 2)?;
    let measured = measured(
        context,
        [&photos[0], &photos[1]],
        [own, &labelled[1]],
        &matched,
        &facade,
        2,
    )?;
    write_clouds(context, epoch, own, Some(&measured.rows))
}
