//! Doubts about the results of a pair of epochs as a whole.

mod check;
mod fit;
mod labels;
mod motions;
mod registration;
mod rules;
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
use std::sync::Arc;
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
    let (context, registered) = (run.context, run.registered(later)?);
    note_registration(context, later, &registered, &run.measured(later)?.datum);
    for (epoch, votes) in votes(run, later)? {
        if let Some(missed) = votes.missed(Fit::of(&registered)) {
            context.warnings.notice(DOUBTS.name, epoch, missed);
        }
    }
    for (epoch, check) in &*run.checks(later)? {
        if let Some(doubt) = &check.doubt {
            context.warnings.doubt(DOUBTS.name, epoch, doubt.clone());
        }
    }
    Ok(())
}

impl Run<'_> {
    /// The checks of a later epoch, each with the name of the epoch that it is about.
    fn checks(&self, later: EpochId) -> Result<Arc<Vec<(String, Check)>>> {
        self.once(&DOUBTS, later, || checks(self, later))
    }

    /// The checks of a later epoch as registration.json has them.
    pub fn check_records(&self, later: EpochId) -> Result<Vec<CheckRecord>> {
        let language = self.context.project.settings.report.language;
        let checks = self.checks(later)?;
        let record = |(epoch, check): &(String, Check)| check.record(epoch, language);
        Ok(checks.iter().map(record).collect())
    }
}

fn checks(run: &Run, later: EpochId) -> Result<Vec<(String, Check)>> {
    let context = run.context;
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    let (rows, fit) = (&measured.rows, Fit::of(&registered));
    let mut all = beside(context, later, &*run.offsets(later)?);
    let votes = votes(run, later)?.into_iter();
    all.extend(votes.filter_map(|(epoch, votes)| Some((epoch, votes.check(fit)?))));
    let of_motions = [
        unsettled(&registered, fit),
        few_measured(rows, fit),
        run.walls_m2(EpochId::REFERENCE)?
            .and_then(|walls_m2| uncovered(rows, walls_m2)),
        Some(refused(rows)),
        blind(&registered, rows, fit),
        turned(rows),
    ];
    let of_epochs = match known_motion(context.project, later).is_some() {
        // A prescribed motion moves all points, those off the wall too, which would otherwise show a wrong
        // registration or scale.
        true => [None, None],
        false => [misregistered(context, &registered), stretched(&registered)],
    };
    let of_later = of_motions.into_iter().chain(of_epochs).flatten();
    let name = &context.project.epochs[later].name;
    all.extend(of_later.map(|check| (name.clone(), check)));
    Ok(all)
}

/// The votes of the photos on the stones of each epoch that has photos.
fn votes(run: &Run, later: EpochId) -> Result<Vec<(String, Votes)>> {
    let labelled = run.labelled_pair(later)?;
    let epochs = run.context.project.epochs.pair(later).zip(labelled).into_iter();
    // The first epoch takes part in every pair; views fit the clouds that they were made of.
    let with_photos = epochs
        .skip(usize::from(later != EpochId::at(1)))
        .filter(|(epoch, _)| epoch.photos.is_some());
    Ok(with_photos
        .filter_map(|(epoch, labels)| Some((epoch.name.clone(), Votes::of(&labels.stones)?)))
        .collect())
}

/// See [`registration::misregistered`]. Where the stones aligned the epochs, nothing is claimed that surfaces off
/// the wall could contradict.
fn misregistered(context: &Context, registered: &Registered) -> Option<Check> {
    let params = &context.project.settings.registration;
    let check = registered.epoch_errors.as_ref()?.cross_check.as_ref()?;
    let check = Some(check).filter(|_| params.align == Align::None)?;
    registration::misregistered(params.epoch_error_m, check)
}
