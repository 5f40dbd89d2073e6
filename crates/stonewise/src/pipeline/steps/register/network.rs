//! The photos from which the clouds of two epochs were computed, and what they show of tracked stones.

use super::datum::is_one_survey;
use crate::error::Result;
use crate::pipeline::graph::Run;
use crate::project::Origin;
use crate::results::Tracks;
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::{FaceFrame, View};
use stonewise_core::id::StoneId;
use stonewise_core::registration::observers::{NetworkShift, PhotoNetwork, SeenStone};

/// The network of the photos; `None` where no cloud comes from photos that the project names, or both epochs are parts of
/// one survey, whose cloud is bent alike. `stones`: what is seen of these; `tracks`: what photos show of them.
pub(super) fn photo_network(
    run: &Run,
    epochs: Pair<EpochId>,
    stones: (&[StoneId], &[SeenStone]),
    tracks: Option<&Tracks>,
) -> Result<Option<PhotoNetwork>> {
    let project = run.context.project;
    if is_one_survey(project, epochs) {
        return Ok(None);
    }
    // Photos of an epoch that was scanned bend nothing, but they are counted where stones were tracked.
    let mut counts = [0; 2];
    let mut photos = [Vec::new(), Vec::new()];
    for (k, id) in epochs.into_array().into_iter().enumerate() {
        let epoch = &project.epochs[id];
        if epoch.photos.is_none() {
            continue;
        }
        let posed = run.posed(id)?;
        counts[k] = posed.photo_count();
        if epoch.found_origin()? == Some(Origin::Photos) {
            photos[k] = posed.views[..counts[k]].to_vec();
        }
    }
    if photos.iter().all(Vec::is_empty) {
        return Ok(None);
    }
    let cameras = [0, 1].map(|k| photos[k].iter().map(|view: &View| &view.camera));
    let is_joint = project.is_one_bundle(epochs.into_array(), cameras);
    let mut network = PhotoNetwork {
        photos,
        is_joint,
        shifts: Vec::new(),
    };
    network.shifts = tracks.map_or_else(Vec::new, |tracks| shifts(&network, counts[0], stones, tracks));
    Ok(Some(network))
}

/// Whether a cloud of these epochs was computed from photos that the project does not name.
pub(super) fn has_unknown_photos(run: &Run, epochs: Pair<EpochId>) -> Result<bool> {
    let project = run.context.project;
    for id in epochs.into_array() {
        let epoch = &project.epochs[id];
        if epoch.photos.is_none() && epoch.found_origin()? == Some(Origin::Photos) {
            return Ok(!is_one_survey(project, epochs));
        }
    }
    Ok(false)
}

/// What photos of these epochs show of tracked stones. `before`: photos of the first epoch, which are counted first.
fn shifts(
    network: &PhotoNetwork,
    before: usize,
    (ids, seen): (&[StoneId], &[SeenStone]),
    tracks: &Tracks,
) -> Vec<NetworkShift> {
    let places: BTreeMap<u32, usize> = ids.iter().map(|id| id.0).zip(0..).collect();
    let mut all = Vec::new();
    for (id, evidence) in &tracks.stones {
        let Some(&stone) = places.get(id) else { continue };
        let frame = FaceFrame::from_normal(&seen[stone].normal).face_from_world();
        for shown in evidence.shifts.iter().filter(|s| s.weight > 0.0) {
            let photo = shown.photo - shown.epoch * before;
            if photo < network.photos[shown.epoch].len() {
                let [aa, au, uu] = shown.shift.covariance_m2;
                all.push(NetworkShift {
                    stone,
                    epoch: shown.epoch,
                    photo,
                    axes: [0, 1].map(|axis| frame.row(axis).transpose()),
                    shift_m: Vector2::from(shown.shift.shift_m),
                    covariance_m2: Matrix2::new(aa, au, au, uu) / shown.weight,
                });
            }
        }
    }
    all
}
