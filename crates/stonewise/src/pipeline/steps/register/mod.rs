//! The motion of every matched stone.

mod datum;
mod epoch_error;
mod estimate;
mod mean_motion;
mod network;
mod notices;
mod off_wall;
mod pairs;
mod photos;
mod registered;
mod scale;
mod sights;
mod tracked;
mod windows;

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::r#match::MATCH;
use crate::pipeline::until::Until;
use crate::storage::step::Key;
pub use datum::datum;
use epoch_error::add_epoch_error;
use estimate::estimate;
pub use notices::{name_of, note_registration};
use photos::tracks_photos;
pub use registered::Registered;
use registered::STEP;
pub use scale::length_influences;
use std::collections::BTreeSet;
use std::sync::Arc;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::id::StoneId;
use stonewise_core::registration::deformation;
use stonewise_core::stone::MotionFailure;

/// Measures the motion of every matched stone.
pub static REGISTER: Step = Step {
    name: STEP,
    phase: Some(Phase::Measure),
    about: About::Later,
    needs: &[Need::same(&MATCH)],
    wanted: |until| until >= Until::Registered,
    cost: Some(|sizes, epoch| Cost::of(8, POINT_BYTES * sizes.pair_points(epoch))),
    make: |run, epoch| run.registered(epoch).map(drop),
    ..Step::PLAIN
};

/// Memory of the step for each point of both epochs, bytes: 4.1 to 5.1 GB were measured for 67 million.
const POINT_BYTES: u64 = 80;

impl Run<'_> {
    /// The motions of a later epoch.
    pub fn registered(&self, later: EpochId) -> Result<Arc<Registered>> {
        self.once(&REGISTER, later, || {
            let labelled = self.labelled_pair(later)?;
            // The pairs themselves, not how they were found: other parameters of the matching that find the same
            // pairs cost nothing.
            let matches = self.matched(later)?.pairs();
            let labelled = labelled.each_ref().map(|l| &**l);
            self.registered_between(since_reference(later), labelled, &matches)
        })
    }

    /// The motions of these stones between two epochs of which the first need not be the reference.
    pub fn registered_between(
        &self,
        epochs: Pair<EpochId>,
        labelled: Pair<&Labelled>,
        matches: &[(StoneId, StoneId)],
    ) -> Result<Registered> {
        let mut registered = register(self, epochs, labelled, matches)?;
        let limit_m = self.context.project.settings.carry.max_height_m;
        drop_contradictions(limit_m, labelled, &mut registered);
        Ok(registered)
    }
}

/// The reference and a later epoch.
pub fn since_reference(later: EpochId) -> Pair<EpochId> {
    Pair::new(EpochId::REFERENCE, later)
}

fn register(
    run: &Run,
    epochs: Pair<EpochId>,
    labelled: Pair<&Labelled>,
    matches: &[(StoneId, StoneId)],
) -> Result<Registered> {
    let key = key(run, epochs, labelled, matches)?;
    let since = match epochs.first.is_reference() {
        true => String::new(),
        false => format!("-since-{}", epochs.first),
    };
    let step = run.context.step(
        &format!("{STEP}-{}{since}", epochs.later),
        key,
        |step, warnings| {
            let (mut registered, joint) = estimate(run, epochs, labelled, matches, step, warnings)?;
            add_epoch_error(
                run,
                epochs,
                labelled,
                matches,
                &mut registered,
                (step, joint.as_ref()),
            )?;
            if let Some(joint) = joint {
                let errors = registered.epoch_errors.as_ref().and_then(|e| e.joint.as_ref());
                let errors = errors.map(|e| (e, registered.error_stones.as_slice()));
                registered.deformation = Some(deformation(&joint, errors, run.context.progress)?);
            }
            write_json(&step.file(MOTIONS), &registered)
        },
    )?;

    Ok(Registered {
        folder: step.path().to_path_buf(),
        ..read_json(&step.file(MOTIONS))?
    })
}

/// What the step found, in its folder.
const MOTIONS: &str = "motions.json";

fn key(
    run: &Run,
    epochs: Pair<EpochId>,
    labelled: Pair<&Labelled>,
    matches: &[(StoneId, StoneId)],
) -> Result<Key> {
    let project = run.context.project;
    let params = &project.settings.registration;
    let mut inputs = Vec::from(labelled.map(|l| l.key.as_str().to_owned()).into_array());
    if tracks_photos(project, epochs) {
        for epoch in epochs.into_array() {
            let posed = run.posed(epoch)?;
            for photo in &posed.photos[..posed.photo_count()] {
                inputs.push(run.context.digest(&photo.path)?);
            }
        }
    }
    let same_survey = project.epochs[epochs.later].same_survey_as;
    let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
    let origins = epochs.map(|e| {
        let epoch = &project.epochs[e];
        (epoch.origin, epoch.bundle.clone())
    });
    let distances = project
        .distances
        .iter()
        .filter(|d| epochs.into_array().contains(&d.epoch));
    let distances: Vec<String> = distances
        .map(|d| format!("{:?}", (d.epoch, d.ends, d.length_m, d.sd_m)))
        .collect();
    let stated = (origins.into_array(), distances);
    Ok(Key::new(STEP, &(params, matches, same_survey, stated), &inputs))
}

/// Removes the motions of carried stones that moved against their neighbours by more than this, metres. A
/// stone was looked for where its neighbours predict it; if it seems to be farther away, its points belong to
/// something else.
fn drop_contradictions(limit_m: f64, labelled: Pair<&Labelled>, registered: &mut Registered) {
    let carried = labelled.map(|l| &l.carried);
    let mut dropped = BTreeSet::new();
    for pair in &mut registered.results {
        let is_carried = carried.first.contains_key(&pair.first) || carried.later.contains_key(&pair.second);
        if is_carried && pair.motion.as_ref().is_ok_and(|m| m.relative.norm() > limit_m) {
            pair.motion = Err(MotionFailure::Disagreement);
            dropped.insert(pair.first);
        }
    }
    let is_measured = |stone: &StoneId| !dropped.contains(stone);
    registered
        .neighbours
        .retain(|pair| pair.stones.iter().all(is_measured));
}
