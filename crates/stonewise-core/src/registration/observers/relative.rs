//! What the epochs' registration leaves uncertain of motions against each other where nothing shows the datum.

use super::components::{MergedDrift, ObserverComponents, SensorClass};
use super::epoch_pair::{EpochErrorParams, EpochPair, all_sights};
use super::joint::JointErrors;
use super::model::{Prior, Problem, Row, Solution, Unknowns};
use super::observation::Observation;
use super::rigid::{RigidRows, difference_row, neighbour_row, rigid_rows};
use super::sight::Source;
use nalgebra::{Dyn, Matrix3, Matrix6, OMatrix, SMatrix, U6};
use rayon::prelude::*;

/// Covariances of the later epoch's error after the closest rigid motion of all stones is taken off.
pub(super) struct RelativeErrors {
    /// Assumed non-rigid part of the registration error of an epoch without sources, per axis, metres; `None`
    /// where both epochs keep sources apart.
    pub merged_error_m: Option<f64>,
    /// At each stone, world, m^2.
    pub at: Vec<Matrix3<f64>>,
    /// Covariance of the difference between two neighbours, world, m^2.
    pub between: Vec<Matrix3<f64>>,
    /// The error at all stones together, the rigid motion not taken off.
    pub joint: Option<JointErrors>,
}

/// The covariances for the stones and neighbours of `pair`.
///
/// `within`: comparisons of sources, where there are any; an epoch without sources has the error that is
/// assumed of merged points. `None` where the numbers fail.
pub(super) fn relative_errors(
    pair: &EpochPair,
    within: &[Vec<Observation>; 2],
    components: &ObserverComponents,
    class: SensorClass,
    params: &EpochErrorParams,
) -> Option<RelativeErrors> {
    // A merged epoch consists of several stations or strips: points measured at the same time need not lie
    // together, so that its error varies with place, not with time.
    let is_merged = |epoch: usize| pair.sources.iter().filter(|s| s.epoch == epoch).count() == 1;
    let sources: Vec<Source> = pair
        .sources
        .iter()
        .map(|s| Source {
            has_times: s.has_times && !is_merged(s.epoch),
            ..s.clone()
        })
        .collect();
    let unknowns = Unknowns::new(&sources, &all_sights(pair, &[]), class);
    let merged = match pair.has_unknown_photos {
        true => MergedDrift::OF_PHOTOS,
        false => class.merged(),
    };
    let sd_m = params.merged_error_m.unwrap_or(merged.sd_m);

    let prior = Prior {
        merged: Some(MergedDrift { sd_m, ..merged }),
        ..Prior::new(components, 0.0)
    };
    let all: Vec<&Observation> = within.iter().flatten().collect();
    let solution = Problem::new(&unknowns, &all).solve(&prior, components)?;
    let rigid = Rigid::new(rigid_rows(pair, &unknowns), &solution);
    let row = |k: usize| difference_row(&pair.stones[k], pair.sources, &unknowns);
    let lever = |k: usize| rigid.rows.lever(&pair.stones[k].centroid);
    let at = |k: usize| rigid.relative(&row(k), &lever(k), &solution);
    let between = |stones: &[usize; 2]| {
        let [first, second] = *stones;
        let difference = neighbour_row(pair, stones, &unknowns);
        rigid.relative(&difference, &(lever(second) - lever(first)), &solution)
    };

    let count = pair.stones.len();
    let joint = JointErrors::new(
        (0..count).map(row).collect(),
        &[(1.0, &solution.mean, &solution.covariance)],
        vec![Matrix3::zeros(); count],
        false,
    );

    Some(RelativeErrors {
        joint,
        merged_error_m: (0..2).any(is_merged).then_some(sd_m),
        at: (0..pair.stones.len()).into_par_iter().map(at).collect(),
        between: pair.neighbours.par_iter().map(between).collect(),
    })
}

/// The rigid part of the error as a function of the unknowns, with its second moments.
struct Rigid {
    rows: RigidRows,
    /// Second moments of the unknowns and the rigid motion.
    cross: OMatrix<f64, Dyn, U6>,
    /// Second moments of the rigid motion.
    own: Matrix6<f64>,
}

impl Rigid {
    fn new(rows: RigidRows, solution: &Solution) -> Self {
        let n = solution.mean.len();
        let mut of_unknowns = OMatrix::<f64, U6, Dyn>::zeros(n);
        for (first, part) in rows.of_unknowns() {
            of_unknowns.fixed_view_mut::<6, 3>(0, first).copy_from(&part);
        }
        let mean = &of_unknowns * &solution.mean;
        let cross = &solution.covariance * of_unknowns.transpose() + &solution.mean * mean.transpose();
        let own = &of_unknowns * &cross;
        Self {
            rows,
            cross,
            own: own.fixed_view::<6, 6>(0, 0).into_owned(),
        }
    }

    /// Second moments of a linear function of the unknowns minus the rigid motion times `lever`. Second moments
    /// instead of covariances, because the estimated error is not subtracted from the motions.
    fn relative(&self, row: &Row, lever: &SMatrix<f64, 3, 6>, solution: &Solution) -> Matrix3<f64> {
        let (mean, covariance) = solution.function(row);
        let own = covariance + mean * mean.transpose();
        let cross: SMatrix<f64, 3, 6> = row
            .iter()
            .map(|(a, of_a)| of_a * self.cross.fixed_view::<3, 6>(*a, 0))
            .sum();
        let with_rigid = cross * lever.transpose();
        let sum = own - with_rigid - with_rigid.transpose() + lever * self.own * lever.transpose();
        0.5 * (sum + sum.transpose())
    }
}
