//! What clouds and photos say of each stone by itself, in the frame of its row.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::measure::Measured;
use crate::pipeline::steps::register::Registered;
use crate::results::{StoneRow, Tracks, most_pictured, write_tracks};
use nalgebra::{Matrix2, Vector2};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::registration::{FaceShift, StoneEvidence};

/// Writes the tracked stones of an epoch against the first, if photos took part.
///
/// Where the error of the later epoch is estimated it is taken off, as it is of the rows.
pub fn write_tracked_stones(
    context: &Context,
    later: EpochId,
    first: &Labelled,
    registered: &Registered,
    measured: &Measured,
) -> Result<()> {
    let Some(mut tracks) = registered.tracks()? else {
        return Ok(());
    };
    take_errors_off(&mut tracks, first, registered, measured);
    keep_pictures(&mut tracks, &measured.rows);
    write_tracks(&context.out, later.number(), &tracks)
}

fn take_errors_off(tracks: &mut Tracks, first: &Labelled, registered: &Registered, measured: &Measured) {
    let datum = &measured.datum;
    let errors = match datum.is_estimated() {
        true => registered.errors(),
        false => BTreeMap::new(),
    };
    let stones: BTreeMap<u32, _> = first.stones.iter().map(|s| (s.id.0, s)).collect();
    for (id, evidence) in &mut tracks.stones {
        let Some(stone) = stones.get(id) else { continue };
        let by_instruments = datum.taken_off_at(&stone.centroid);
        let Some(error) = by_instruments.or_else(|| Some(errors.get(&stone.id)?.mean)) else {
            continue;
        };
        let error = FaceFrame::from_normal(&stone.normal).face_from_world() * error;
        let of_photos = evidence
            .shifts
            .iter_mut()
            .filter(|s| s.epoch == 1)
            .map(|s| &mut s.shift);
        let together = [&mut evidence.clouds, &mut evidence.photos, &mut evidence.both];
        for shift in together.into_iter().flatten().chain(of_photos) {
            shift.shift_m[0] -= error.x;
            shift.shift_m[1] -= error.y;
        }
    }
}

/// Drops the pictures of stones beyond what the folder may hold. Loose stones are kept first, then those above
/// their limit, then those of which clouds and photos say most unlike things.
fn keep_pictures(tracks: &mut Tracks, rows: &[StoneRow]) {
    let motions: BTreeMap<u32, _> = rows.iter().map(|r| (r.stone_id, r.motion.as_ref())).collect();
    let rank = |(id, evidence): &(u32, StoneEvidence)| {
        let motion = motions.get(id).copied().flatten();
        let is = |of: fn(&crate::results::RowMotion) -> bool| motion.is_some_and(of);
        let apart = (disagreement(evidence).unwrap_or(0.0) * 1e6) as u64;
        let rank = (is(|m| m.loose), is(|m| m.significant), apart);
        (Reverse(rank), *id)
    };
    let mut pictured: Vec<_> = tracks
        .stones
        .iter()
        .filter(|s| s.1.pictures.is_some())
        .map(rank)
        .collect();
    let side_px = { tracks.stones.iter() }.find_map(|(_, s)| Some(s.pictures.as_ref()?.side_px as u32));
    pictured.sort_unstable();
    pictured.truncate(most_pictured(side_px.unwrap_or(0)));
    let kept: BTreeSet<u32> = pictured.into_iter().map(|(_, id)| id).collect();
    for (id, evidence) in &mut tracks.stones {
        if !kept.contains(id) {
            evidence.pictures = None;
        }
    }
}

/// Square of the difference of what clouds and photos say, over its variance.
fn disagreement(evidence: &StoneEvidence) -> Option<f64> {
    let (clouds, photos) = (evidence.clouds?, evidence.photos?);
    let shift = |s: &FaceShift| Vector2::from(s.shift_m);
    let covariance = |s: &FaceShift| {
        let [aa, au, uu] = s.covariance_m2;
        Matrix2::new(aa, au, au, uu)
    };
    let apart = shift(&photos) - shift(&clouds);
    let inverse = (covariance(&photos) + covariance(&clouds)).try_inverse()?;
    Some(apart.dot(&(inverse * apart)))
}
