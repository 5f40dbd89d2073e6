//! The rows of the stone table.

use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::r#match::Matched;
use crate::pipeline::steps::register::Registered;
use crate::results::records::Datum;
use crate::results::{Facade, Reference, StoneRow, Term};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::epoch::Pair;
use stonewise_core::geometry::SmallMotion;
use stonewise_core::stone::{MatchOutcome, Stone, common_motion};

/// One row for each stone of the first epoch.
pub fn stone_rows(
    epochs: Pair<&Labelled>,
    matched: &Matched,
    registered: &Registered,
    datum: &Datum,
    facade: &Facade,
) -> Vec<StoneRow> {
    let Pair { first, later } = epochs.map(|e| &e.stones);
    let (edited, carried) = (epochs.map(|e| &e.edited), epochs.map(|e| &e.carried));
    let partners: BTreeMap<_, _> = later.iter().map(|s| (s.id, s)).collect();
    let outcomes: BTreeMap<_, _> = matched.report.outcomes.iter().copied().collect();
    let motions: BTreeMap<_, _> = registered.results.iter().map(|r| (r.first, r)).collect();
    let common = common_motion(first, &motions);
    let errors = match datum.is_estimated() {
        true => registered.errors(),
        false => BTreeMap::new(),
    };
    let deformed = registered.deformation.iter().flat_map(|d| &d.stones);
    let deformed: BTreeMap<_, _> = deformed.map(|s| (s.stone, s)).collect();
    let relative = registered.relative_errors();

    let scale = registered.epoch_errors.as_ref().and_then(|e| e.scale.as_ref());
    let by_scale = |stone: &Stone| scale.map_or_else(Vector3::zeros, |scale| scale.at(&stone.centroid));
    let shared = registered.shared_errors();
    let shared = |stone: &Stone| shared.get(&stone.id).map_or_else(Matrix3::zeros, |s| **s);
    // `whole`: covariance of the error of the epochs, whatever its cause.
    let terms = |stone: &Stone, whole: Matrix3<f64>| {
        let of_scale = scale.map_or_else(Matrix3::zeros, |scale| scale.covariance_at(&stone.centroid));
        let shared = shared(stone);
        vec![
            (Term::Scale, of_scale),
            (Term::Photos, shared - of_scale),
            (Term::Registration, whole - shared),
        ]
    };

    // Stones turn with the rigid part of the error; how its drifts turn single stones is not estimated.
    let turn = registered.epoch_errors.as_ref();
    let turn: Vector3<f64> =
        turn.map_or_else(Vector3::zeros, |e| e.rigid.error.fixed_rows::<3>(3).into_owned());

    let row = |stone: &Stone| {
        let outcome = outcomes.get(&stone.id)?;
        let partner = match outcome {
            MatchOutcome::Matched { second } => partners.get(second).copied(),
            MatchOutcome::Unmatched(_) => None,
        };
        let reference = match (datum.covariance_at(&stone.centroid), datum.rotation_covariance()) {
            (Some(covariance), Some(rotation_covariance)) => {
                let error = errors.get(&stone.id);
                Reference {
                    error: error.map_or_else(|| by_scale(stone), |e| e.mean),
                    turn: error.map_or_else(Vector3::zeros, |_| turn),
                    motion: Vector3::zeros(),
                    terms: terms(
                        stone,
                        error.map_or_else(|| covariance + shared(stone), |e| e.covariance),
                    ),
                    rotation_covariance,
                }
            }
            _ => {
                let relative = relative
                    .get(&stone.id)
                    .map_or_else(Vec::new, |r| terms(stone, **r));
                Reference {
                    error: by_scale(stone),
                    ..Reference::against(common.as_ref(), stone, relative)
                }
            }
        };
        let pair = motions.get(&stone.id).copied();
        let place = facade.place(&stone.centroid);
        let row = StoneRow::new(stone, outcome, partner, pair, &reference, &place);
        let row = match deformed.get(&stone.id).filter(|_| row.motion.is_some()) {
            Some(deformation) => row.with_deformation(&stone.normal, deformation),
            None => row,
        };
        let of_partner = || edited.later.get(&partner?.id);
        let from = carried.first.get(&stone.id);
        let from = from.or_else(|| carried.later.get(&partner?.id));
        Some(StoneRow {
            edited: edited.first.get(&stone.id).or_else(of_partner).copied(),
            carried_from: from.map(|epoch| epoch.number() as u32),
            ..row
        })
    };

    first.iter().filter_map(row).collect()
}

/// The common rigid motion of the measured stones that are not loose, which motions are tested against where
/// the datum is unknown.
pub fn motion_in_common(first: &Labelled, registered: &Registered) -> Option<SmallMotion> {
    common_motion(
        &first.stones,
        &registered.results.iter().map(|r| (r.first, r)).collect(),
    )
}
