//! The rows of the stone table.

use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::r#match::Matched;
use crate::pipeline::steps::register::Registered;
use crate::results::records::Datum;
use crate::results::{Facade, Reference, StoneRow};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use stonewise_core::geometry::SmallMotion;
use stonewise_core::registration::observers::ErrorAt;
use stonewise_core::stone::{MatchOutcome, PairResult, Stone, common_motion};

/// One row for each stone of the first epoch.
pub fn stone_rows(
    epochs: [&Labelled; 2],
    matched: &Matched,
    registered: &Registered,
    datum: &Datum,
    facade: &Facade,
) -> Vec<StoneRow> {
    let [first, second] = epochs.map(|e| &e.stones);
    let (edited, carried) = (epochs.map(|e| &e.edited), epochs.map(|e| &e.carried));
    let partners: BTreeMap<_, _> = second.iter().map(|s| (s.id, s)).collect();
    let outcomes: BTreeMap<_, _> = matched.report.outcomes.iter().copied().collect();
    let motions: BTreeMap<_, _> = registered.results.iter().map(|r| (r.first, r)).collect();
    let common = common_motion(first, &motions);
    let errors = match datum.is_estimated() {
        true => registered.errors(),
        false => BTreeMap::new(),
    };
    let row = |stone: &Stone| {
        let outcome = outcomes.get(&stone.id)?;
        let partner = match outcome {
            MatchOutcome::Matched { second } => partners.get(second).copied(),
            MatchOutcome::Unmatched(_) => None,
        };
        let error = errors.get(&stone.id).copied();
        let reference = match (error, datum.covariance_at(&stone.centroid)) {
            (Some(error), Some(_)) => Reference {
                motion: Vector3::zeros(),
                covariance: error.covariance,
            },
            (None, Some(covariance)) => Reference {
                motion: Vector3::zeros(),
                covariance,
            },
            (_, None) => against(common.as_ref(), stone),
        };
        let pair = motions.get(&stone.id).map(|pair| corrected(pair, error));
        let place = facade.place(&stone.centroid);
        let row = StoneRow::new(stone, outcome, partner, pair.as_ref(), &reference, &place);
        let of_partner = || edited[1].get(&partner?.id);
        let from = carried[0].get(&stone.id);
        let from = from.or_else(|| carried[1].get(&partner?.id));
        Some(StoneRow {
            edited: edited[0].get(&stone.id).or_else(of_partner).copied(),
            carried_from: from.map(|&epoch| epoch as u32),
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

/// The motion less the error of the later epoch there.
fn corrected(pair: &PairResult, error: Option<&ErrorAt>) -> PairResult {
    let mut pair = pair.clone();
    if let (Ok(motion), Some(error)) = (&mut pair.motion, error) {
        motion.displacement -= error.mean;
        motion.second_from_first.translation.vector -= error.mean;
    }
    pair
}

/// The common motion at a stone with the error of its estimate.
fn against(common: Option<&SmallMotion>, stone: &Stone) -> Reference {
    common.map_or_else(Reference::default, |common| Reference {
        motion: common.at(&stone.centroid),
        covariance: common.covariance_at(&stone.centroid),
    })
}
