//! Stable areas that show an error of the epoch which nothing confirms.

use super::assumptions::Model;
use super::congruence::reweighted;
use super::model::{Problem, Unknowns};
use super::observation::Observation;
use super::rigid::{RigidError, RigidRows};
use nalgebra::{Cholesky, Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Standard deviations by which what an area shows departs from what is expected without it, beyond which the area may
/// have moved itself as well.
const SURPRISING: f64 = 4.0;

/// A stable area without which the error of the epoch would be another one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoneArea {
    /// Which of the stable areas.
    pub area: usize,
    /// What it adds to the error in the middle of the stones, world, metres.
    pub shift: Vector3<f64>,
    /// Length of this in standard deviations of the error without the area.
    pub standard_deviations: f64,
}

impl LoneArea {
    /// The area that departs most from what everything else says of the error, if it departs by more than four standard
    /// deviations. With the area as the only evidence, an error of the registration cannot be distinguished from a
    /// motion of the area.
    ///
    /// `model`: with the error that is assumed of the epoch; `found`: the error with all areas.
    pub(super) fn among(
        stable: &[Observation],
        within: &[Vec<Observation>; 2],
        unknowns: &Unknowns,
        model: &Model,
        rows: &RigidRows,
        found: &RigidError,
    ) -> Option<Self> {
        let areas: BTreeSet<usize> = stable.iter().filter_map(|o| Some(o.plane()?.area)).collect();
        let of_area = |area: usize| {
            let others = stable.iter().filter(|o| o.plane().is_none_or(|p| p.area != area));
            let rest: Vec<&Observation> = within.iter().flatten().chain(others).collect();
            let model = model.widened(unknowns, &rest);
            let weighted = reweighted(unknowns, &rest, &model);
            let (prior, components) = model.scaled(1.0);
            let problem = Problem::new(unknowns, &weighted.iter().collect::<Vec<_>>());
            let without = rows.error(&[(1.0, &problem.solve(&prior, &components)?)]);
            let shift: Vector3<f64> = (found.error - without.error).fixed_rows::<3>(0).into_owned();
            let covariance: Matrix3<f64> = without.covariance.fixed_view::<3, 3>(0, 0).into_owned();
            let square = shift.dot(&Cholesky::new(covariance)?.solve(&shift));
            Some(Self {
                area,
                shift,
                standard_deviations: square.sqrt(),
            })
        };
        let all = areas.into_iter().filter_map(of_area);
        all.filter(|a| a.standard_deviations > SURPRISING)
            .max_by(|a, b| a.standard_deviations.total_cmp(&b.standard_deviations))
    }
}
