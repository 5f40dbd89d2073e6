//! Test whether surfaces that are not used as stable areas agree with the error found from the sources.

use super::assumptions::Model;
use super::congruence::{reweighted, standing};
use super::epoch_pair::{EpochErrorParams, EpochPair, all_sights};
use super::model::{Problem, Unknowns};
use super::observation::Observation;
use super::rigid::{RigidError, rigid_rows};
use super::stable::stable_observations;
use crate::statistics::chi_square_p;
use nalgebra::{Cholesky, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// The later epoch's error as surfaces off the wall show it, and as it was found without them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CrossCheck {
    /// Number of plane cells that agree on one error.
    pub cells: usize,
    /// Error of the later epoch minus that of the reference in the middle of the stones, if these surfaces
    /// did not move; world, metres. Along directions that the surfaces do not show, it tends to zero, with a
    /// large uncertainty.
    pub error: Vector3<f64>,
    /// Error of the later epoch minus that of the reference in the middle of the stones, found without these surfaces;
    /// world, metres.
    pub found: Vector3<f64>,
    /// Covariance of `found`, m^2.
    pub covariance: Matrix3<f64>,
    /// Probability of a difference as large as this one if the surfaces did not move and the covariance is
    /// right.
    pub p: f64,
}

/// Compares the error found with what surfaces off the wall show ([`EpochPair::offered`]).
///
/// `found`: the rigid part of the error without these surfaces; `model`: the model with which it was found.
/// For the error that the surfaces show, the error of the epoch as a whole is left open, and areas that moved
/// against the others are left out. Both errors use the same comparisons within the epochs. Their covariances
/// are added as if they were independent, which makes the test conservative.
///
/// `None` where fewer than [`StableParams::min_cells`](super::StableParams) cells are left.
pub(super) fn cross_check(
    pair: &EpochPair,
    within: &[Vec<Observation>; 2],
    found: &RigidError,
    model: &Model,
    params: &EpochErrorParams,
) -> Option<CrossCheck> {
    let offered = stable_observations(pair.offered, pair.sigma_m, &params.stable);
    if offered.len() < params.stable.min_cells {
        return None;
    }
    let unknowns =
        Unknowns::new(pair.sources, &all_sights(pair, &offered), model.class).with_planes(&offered);
    let all: Vec<&Observation> = within.iter().flatten().chain(&offered).collect();
    let judging = model.widened(&unknowns, &all);
    let (kept, _) = standing(&unknowns, within, offered, &judging);
    if kept.len() < params.stable.min_cells {
        return None;
    }
    let all: Vec<&Observation> = within.iter().flatten().chain(&kept).collect();
    let weighted = reweighted(&unknowns, &all, &judging);

    let (prior, components) = judging.opened();
    let problem = Problem::new(&unknowns, &weighted.iter().collect::<Vec<_>>());
    let solution = problem.solve(&prior, &components)?;
    let shown = rigid_rows(pair, &unknowns).error(&[(1.0, &solution)]);
    let shift = |error: &RigidError| error.error.fixed_rows::<3>(0).into_owned();
    let of_shift = |error: &RigidError| error.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let difference = shift(&shown) - shift(found);
    let factor = Cholesky::new(of_shift(found) + of_shift(&shown))?;
    let chi_square = difference.dot(&factor.solve(&difference));

    Some(CrossCheck {
        cells: kept.len(),
        error: shift(&shown),
        found: shift(found),
        covariance: of_shift(found),
        p: chi_square_p(chi_square, 3),
    })
}
