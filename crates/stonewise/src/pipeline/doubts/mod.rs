//! Doubts about the results of a pair of epochs as a whole.

mod check;
mod fit;
mod labels;
mod motions;
mod registration;
mod scale;
mod turn;

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::steps::known_motion::known_motion;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::steps::offsets::OFFSETS;
use crate::pipeline::steps::register::{Registered, note_registration};
use crate::pipeline::until::Until;
use crate::results::records::CheckRecord;
use crate::settings::Align;
use check::Check;
use fit::Fit;
use labels::{Votes, beside};
use motions::{blind, few_measured, refused, uncovered, unsettled};
use scale::stretched;
use stonewise_core::epoch::EpochId;
use turn::turned;

/// Warns where the motions of a later epoch cannot be relied on.
pub static DOUBTS: Step = Step {
    name: "doubts",
    about: About::Later,
    needs: &[Need::same(&MEASURE), Need::same(&OFFSETS)],
    wanted: |until| until >= Until::Registered,
    make: note_doubts,
    ..Step::PLAIN
};

fn note_doubts(run: &Run, later: EpochId) -> Result<()> {
    let (context, labelled) = (run.context, run.labelled_pair(later)?);
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    note_registration(context, later, &registered, &measured.datum);
    let epochs = context.project.epochs.pair(later);
    let fit = Fit::of(&registered);
    // The first epoch takes part in every pair.
    let first_time = usize::from(later != EpochId::at(1));
    // Views fit the clouds that they were made of.
    let with_photos = epochs.zip(labelled).into_iter().skip(first_time);
    for (epoch, labels) in with_photos.filter(|(epoch, _)| epoch.photos.is_some()) {
        match Votes::of(&labels.stones) {
            Some(votes) if votes.are_torn(fit) => {
                context.warnings.doubt("label", &epoch.name, votes.torn(fit));
            }
            Some(votes) if votes.are_few() => {
                context.warnings.notice("label", &epoch.name, votes.missed(fit));
            }
            _ => {}
        }
    }
    for (name, message) in beside(context, later, &*run.offsets(later)?) {
        context.warnings.doubt("label", name, message);
    }
    for doubt in checks(run, later)?.into_iter().filter_map(|check| check.doubt) {
        context.warnings.doubt("register", &epochs.later.name, doubt);
    }
    Ok(())
}

/// The checks of a later epoch, as registration.json has them.
pub fn check_records(run: &Run, later: EpochId) -> Result<Vec<CheckRecord>> {
    Ok(checks(run, later)?.iter().map(Check::record).collect())
}

fn checks(run: &Run, later: EpochId) -> Result<Vec<Check>> {
    let context = run.context;
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    let (rows, fit) = (&measured.rows, Fit::of(&registered));
    let of_motions = [
        unsettled(&registered, fit),
        few_measured(rows, fit),
        run.walls_m2(EpochId::REFERENCE)?
            .and_then(|walls_m2| uncovered(rows, walls_m2)),
        refused(rows),
        blind(&registered, rows, fit),
        turned(rows),
    ];
    let of_epochs = match known_motion(context.project, later).is_some() {
        // A prescribed motion moves all points, those off the wall too, which would otherwise show a wrong
        // registration or scale.
        true => [None, None],
        false => [misregistered(context, &registered), stretched(&registered)],
    };
    Ok(of_motions.into_iter().chain(of_epochs).flatten().collect())
}

/// See [`registration::misregistered`]. Where the stones aligned the epochs, nothing is claimed that surfaces off
/// the wall could contradict.
fn misregistered(context: &Context, registered: &Registered) -> Option<Check> {
    let params = &context.project.settings.registration;
    let check = registered.epoch_errors.as_ref()?.cross_check.as_ref()?;
    let check = Some(check).filter(|_| params.align == Align::None)?;
    registration::misregistered(params.epoch_error_m, check)
}
