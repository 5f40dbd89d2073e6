//! Doubts about the results of a pair of epochs as a whole.

mod labels;
mod motions;
mod registration;
mod scale;
mod turn;

use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::offsets::LabelOffsets;
use crate::pipeline::steps::register::Registered;
use crate::results::StoneRow;
use crate::results::records::Datum;
use crate::texts::Said;
use labels::{beside, torn};
use motions::{blind, few_measured, unsettled};
use scale::stretched;
use turn::turned;

/// Warns where the motions of a pair of epochs cannot be relied on.
pub fn note_doubts(
    context: &Context,
    number: usize,
    labelled: [&Labelled; 2],
    offsets: &LabelOffsets,
    (registered, datum): (&Registered, &Datum),
    rows: &[StoneRow],
) {
    let epoch = &context.project.epochs[number - 1].name;
    // The first epoch takes part in every pair.
    let first_time = usize::from(number > 2);
    for (which, labels) in [0, number - 1].into_iter().zip(labelled).skip(first_time) {
        if let Some(message) = torn(&labels.stones) {
            let name = &context.project.epochs[which].name;
            context.warnings.doubt("label", name, message);
        }
    }
    for (name, message) in beside(context, number, offsets) {
        context.warnings.doubt("label", name, message);
    }
    let of_motions = [
        unsettled(registered),
        few_measured(rows),
        blind(registered, rows),
        turned(rows),
    ];
    let of_epochs = match is_prescribed(context, number) {
        true => [None, None],
        false => [misregistered(context, registered), stretched(rows, datum)],
    };
    for message in of_motions.into_iter().chain(of_epochs).flatten() {
        context.warnings.doubt("register", epoch, message);
    }
}

/// Whether the project prescribes a motion of one of the two epochs. It moves all points, those off the wall
/// too, which would otherwise show a wrong registration or scale.
fn is_prescribed(context: &Context, number: usize) -> bool {
    [0, number - 1]
        .into_iter()
        .any(|e| context.project.epochs[e].motion.is_some())
}

/// See [`registration::misregistered`].
fn misregistered(context: &Context, registered: &Registered) -> Option<Said> {
    let check = registered.epoch_errors.as_ref()?.cross_check.as_ref()?;
    registration::misregistered(context.project.settings.registration.epoch_error_m, check)
}
