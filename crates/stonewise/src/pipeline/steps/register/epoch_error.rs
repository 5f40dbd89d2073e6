//! The error that all motions of an epoch share, as its sources and areas off the wall show it.

use super::datum::is_one_survey;
use super::network::{has_unknown_photos, photo_network};
use super::off_wall::OffWall;
use super::registered::{Registered, STEP};
use super::scale::known_scale;
use super::sights::Sights;
use super::tracked;
use crate::error::Result;
use crate::pipeline::graph::Run;
use crate::pipeline::steps::label::Labelled;
use crate::storage::step::StepDir;
use crate::texts::notices::TOO_MANY_SOURCES;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::registration::JointMotions;
use stonewise_core::registration::observers::{EpochErrorParams, EpochPair, Response, epoch_errors};

/// Estimates that error, and adds it to the covariances of neighbours. `step`: folder of what photos show; `joint`: the last
/// solution of the adjustment.
pub(super) fn add_epoch_error(
    run: &Run,
    epochs: Pair<EpochId>,
    labelled: Pair<&Labelled>,
    matches: &[(StoneId, StoneId)],
    registered: &mut Registered,
    (step, joint): (&StepDir, Option<&JointMotions>),
) -> Result<()> {
    let context = run.context;
    let project = context.project;
    let params = &project.settings.registration;
    let is_known =
        params.epoch_error_m.is_some() || !params.stable.is_empty() || is_one_survey(project, epochs);
    let off_wall = match params.auto_stable || !is_known {
        true => OffWall::find(labelled, context.progress)?,
        false => OffWall::default(),
    };
    registered.off_wall = off_wall.areas().to_vec();
    let sights = Sights::gather(project, epochs, labelled, matches, &off_wall, context.progress)?;

    for (id, count) in epochs.into_array().into_iter().zip(sights.too_many) {
        if let Some(count) = count {
            let message = TOO_MANY_SOURCES.say(&[("n", count.to_string().into())]);
            context.warnings.notice(STEP, &project.epochs[id].name, message);
        }
    }

    let neighbours = registered.neighbours_among(&sights.stones);
    let tracks = tracked::read(step.path())?;
    let network = photo_network(run, epochs, (&sights.stones, &sights.seen), tracks.as_ref())?;
    let pair = EpochPair {
        sources: &sights.sources,
        stones: &sights.seen,
        neighbours: &neighbours,
        stable: &sights.stable,
        offered: &sights.offered,
        sigma_m: registered.noise_m(),
        response: joint.map(|motions| Response {
            motions,
            stones: &sights.stones,
        }),
        is_aligned: project.is_aligned(epochs.later),
        network: network.as_ref(),
        has_unknown_photos: has_unknown_photos(run, epochs)?,
        scale: known_scale(project, epochs, labelled, network.as_ref())?,
    };

    let observers = EpochErrorParams {
        shared_error_m: params.epoch_error_m.or(params.observers.shared_error_m),
        ..params.observers.clone()
    };
    let errors = epoch_errors(&pair, &observers, context.progress)?;
    registered.add_registration(&errors.between);
    registered.epoch_errors = Some(errors);
    registered.error_stones = sights.stones;
    Ok(())
}
