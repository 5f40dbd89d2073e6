//! What each source and each stable area does to the results: reliability (Baarda 1968), and the motions without it.
//!
//! Let N be the normal equations of all observations with their prior, m = N^-1 v the unknowns, and (D, d) what one
//! source or area adds to N and v. Without it
//!
//! ```text
//! m' - m = (N - D)^-1 (D m - d) = Q_T (S^-1 (S^-1 - D)^-1) (D m - d),   Q = N^-1
//! ```
//!
//! with Q_T the columns of Q of the unknowns T that D touches, and S their block: N is not solved again. Weights and
//! variances are those of the solution with all observations. The sum of redundancy numbers, tr(Q_vv P), is the number of
//! differences less tr(D S).

use super::assumptions::Model;
use super::datum::Datum;
use super::epoch_pair::EpochPair;
use super::model::{Part, Problem, Solution, Unknowns};
use super::observation::Observation;
use super::rigid::difference_row;
use super::sight::{SeenStone, SourcePoints};
use crate::cloud::Cloud;
use crate::geometry::{DisplacementSample, SmallMotion};
use crate::linalg::DenseFactor;
use crate::statistics::NONCENTRALITY;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// An offset is seen along a direction where it is known to this, metres.
const SEEN_M: f64 = 0.01;

/// A shift of each stone's motion, world, metres; `None` for a stone that is not measured.
type Shifts = Vec<Option<Vector3<f64>>>;

/// What takes part in the datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Member {
    /// A source, by its number among [`EpochErrors::sources`](super::EpochErrors::sources).
    Source(usize),
    /// One of the stable areas.
    Area(usize),
}

/// What a source or stable area does to the results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Influence {
    /// Of which.
    pub of: Member,
    /// Sum of the redundancy numbers of the differences in which it takes part.
    pub redundancy: f64,
    /// Smallest offset of it as a whole that a test against all others finds, with a significance level of 0.1 % and a
    /// power of 80 %, in the direction in which it is found worst of those that it shows, metres; `None` where it shows
    /// none.
    pub smallest_blunder_m: Option<f64>,
    /// What leaving it out adds to the motion of each stone, in their order, world, metres; `None` for a stone that nothing
    /// else shows in its epoch. Absent where the datum would be unknown.
    pub shifts: Option<Vec<Option<Vector3<f64>>>>,
}

/// The influence of every source and of every stable area in use; none where the numbers fail, and where sources of
/// both epochs share their errors.
///
/// `observations`: with their weights; `usual_m`: standard deviation by which sources differ from each other, per axis,
/// metres; `datum_of`: where the datum comes from with some of the observations.
///
/// Cost: one solution of the normal equations, and for each source or area the cube of the number of unknowns that its
/// differences touch.
pub(super) fn influences(
    pair: &EpochPair,
    unknowns: &Unknowns,
    observations: &[Observation],
    (model, usual_m): (&Model, f64),
    datum_of: impl Fn(&[&Observation]) -> Datum + Sync,
) -> Vec<Influence> {
    if pair.sources.iter().any(|s| s.same_as.is_some()) {
        return Vec::new();
    }
    let (prior, components) = model.scaled(1.0);
    let all: Vec<&Observation> = observations.iter().collect();
    let problem = Problem::new(unknowns, &all);
    let Some(solution) = problem.solve(&prior, &components) else {
        return Vec::new();
    };

    let sources = (0..pair.sources.len()).map(Member::Source);
    let areas: BTreeSet<usize> = all.iter().filter_map(|o| Some(o.plane()?.area)).collect();
    let members: Vec<Member> = sources.chain(areas.into_iter().map(Member::Area)).collect();
    let of_member = |member: &Member| {
        let mut rest: Vec<_> = all.iter().map(|o| without(o, *member)).collect();
        let part = |rest: &[Option<Cow<Observation>>]| {
            let changed = all
                .iter()
                .zip(rest)
                .filter(|(_, r)| !matches!(r, Some(Cow::Borrowed(_))));
            let (before, after): (Vec<&Observation>, Vec<_>) = changed.unzip();
            let after: Vec<&Observation> = after.into_iter().flatten().map(|o| &**o).collect();
            Problem::new(unknowns, &before).beyond(&Problem::new(unknowns, &after), &components)
        };
        let own = part(&rest)?;
        let datum = datum_of(&rest.iter().flatten().map(|o| &**o).collect::<Vec<_>>());
        if datum != Datum::Stable {
            rest.iter_mut()
                .filter(|o| o.as_ref().is_some_and(|o| o.plane().is_some()))
                .for_each(|o| *o = None);
        }
        let change = match datum {
            Datum::Unknown => None,
            Datum::Stable | Datum::Sources => change(&solution, &part(&rest)?),
        };

        let variance = match *member {
            Member::Source(source) => {
                let first = unknowns.translation(source);
                let own = solution.covariance.fixed_view::<3, 3>(first, first).into_owned();
                let from_others = own.try_inverse()? - Matrix3::identity() / prior.translation_m.powi(2);
                largest_seen(&from_others).map(|variance| variance + usual_m * usual_m)
            }
            Member::Area(area) => {
                let is_of = |o: &Observation| o.plane().is_some_and(|p| p.area == area);
                largest_seen(&problem.motion_of(&solution, &components, is_of).0)
            }
        };
        Some(Influence {
            of: *member,
            redundancy: own.differences as f64
                - own.information.component_mul(&covariance(&solution, &own)).sum(),
            smallest_blunder_m: variance.map(|variance| NONCENTRALITY * variance.sqrt()),
            shifts: change.map(|change| shifts(pair, unknowns, *member, &change)),
        })
    };
    let mut found: Vec<Influence> = members.par_iter().filter_map(of_member).collect();
    follow(pair, &mut found);
    found
}

/// What is left of an observation without a source or area.
fn without<'a>(observation: &'a Observation, member: Member) -> Option<Cow<'a, Observation>> {
    match member {
        Member::Area(area) => {
            let is_of = observation.plane().is_some_and(|p| p.area == area);
            (!is_of).then_some(Cow::Borrowed(observation))
        }
        Member::Source(source) => {
            let count = observation.sights.len();
            let kept: Vec<usize> = (0..count)
                .filter(|&k| observation.sights[k].source != source)
                .collect();
            match kept.len() {
                n if n == count => Some(Cow::Borrowed(observation)),
                0 | 1 => None,
                _ => Some(Cow::Owned(observation.among(&kept))),
            }
        }
    }
}

/// Covariance of the unknowns that a part touches.
fn covariance(solution: &Solution, part: &Part) -> DMatrix<f64> {
    let count = part.unknowns.len();
    DMatrix::from_fn(count, count, |r, c| {
        solution.covariance[(part.unknowns[r], part.unknowns[c])]
    })
}

/// The unknowns without a part less those with it.
fn change(solution: &Solution, part: &Part) -> Option<DVector<f64>> {
    let mean = DVector::from_iterator(
        part.unknowns.len(),
        part.unknowns.iter().map(|&u| solution.mean[u]),
    );
    if part.unknowns.is_empty() {
        return Some(DVector::zeros(solution.mean.len()));
    }
    let with = DenseFactor::of(&covariance(solution, part))?;
    let less = DenseFactor::of(&(with.inverse() - &part.information))?;
    let change = with.solve(&less.solve(&(&part.information * mean - &part.vector)));
    let mut all = DVector::zeros(solution.mean.len());
    for (&unknown, by) in part.unknowns.iter().zip(&change) {
        all.axpy(*by, &solution.covariance.column(unknown), 1.0);
    }
    Some(all)
}

/// What a change of the unknowns adds to the motion of each stone's points, metres: a source that is left out does not
/// show them any more.
fn shifts(pair: &EpochPair, unknowns: &Unknowns, member: Member, change: &DVector<f64>) -> Shifts {
    let shift = |stone: &SeenStone| {
        let left = match member {
            Member::Source(source) => Cow::Owned(seen_without(stone, source)),
            Member::Area(_) => Cow::Borrowed(stone),
        };
        let is_seen = |epoch: usize| left.sights.iter().any(|s| pair.sources[s.source].epoch == epoch);
        let row = difference_row(&left, pair.sources, unknowns);
        let error = row.iter().map(|(first, by)| by * change.fixed_rows::<3>(*first));
        (is_seen(0) && is_seen(1)).then(|| -error.sum::<Vector3<f64>>())
    };
    pair.stones.iter().map(shift).collect()
}

/// A stone as all sources but one show it, without points.
fn seen_without(stone: &SeenStone, source: usize) -> SeenStone {
    let others = stone.sights.iter().filter(|s| s.source != source);
    let sights = others.map(|s| SourcePoints {
        points: Cloud::new(stone.centroid, Vec::new()),
        ..*s
    });
    SeenStone {
        sights: sights.collect(),
        ..*stone
    }
}

/// Makes the shifts of points those of motions: the rigid part as it is, the rest as the solution follows it.
fn follow(pair: &EpochPair, found: &mut [Influence]) {
    let all: Vec<&mut Shifts> = found.iter_mut().filter_map(|i| i.shifts.as_mut()).collect();
    if all.is_empty() {
        return;
    }
    let rigid: Vec<Option<SmallMotion>> = all.iter().map(|shifts| rigid_part(pair, shifts)).collect();
    let at = |rigid: &Option<SmallMotion>, stone: &SeenStone| {
        let rigid = rigid.as_ref();
        rigid.map_or_else(Vector3::zeros, |rigid| rigid.at(&stone.centroid))
    };
    let rest = |(shifts, rigid): (&&mut Shifts, &Option<SmallMotion>)| -> Vec<Vector3<f64>> {
        let rest = |(stone, shift): (&SeenStone, &Option<Vector3<f64>>)| {
            shift.map_or_else(Vector3::zeros, |shift| shift - at(rigid, stone))
        };
        pair.stones.iter().zip(shifts.iter()).map(rest).collect()
    };
    let followed = pair.followed(all.iter().zip(&rigid).map(rest).collect());
    for ((shifts, rigid), followed) in all.into_iter().zip(&rigid).zip(followed) {
        for ((shift, stone), rest) in shifts.iter_mut().zip(pair.stones).zip(followed) {
            // To the micrometre, because a file keeps one for each stone and member.
            *shift = shift.map(|_| (at(rigid, stone) + rest).map(|m| (1e6 * m).round() / 1e6));
        }
    }
}

/// The rigid motion closest to the shifts.
fn rigid_part(pair: &EpochPair, shifts: &Shifts) -> Option<SmallMotion> {
    let samples = pair.stones.iter().zip(shifts).filter_map(|(stone, shift)| {
        Some(DisplacementSample {
            place: stone.centroid,
            displacement: (*shift)?,
            covariance: Matrix3::identity(),
        })
    });
    SmallMotion::fit(&samples.collect::<Vec<_>>())
}

/// Largest variance of an offset, by its information, along the directions that are seen; `None` where none is.
fn largest_seen(information: &Matrix3<f64>) -> Option<f64> {
    let eigen = (0.5 * (information + information.transpose())).symmetric_eigenvalues();
    let seen = eigen.iter().filter(|value| **value * SEEN_M * SEEN_M > 1.0);
    seen.map(|value| value.recip()).max_by(f64::total_cmp)
}
