//! The error of a later epoch against the reference, at every stone.

use super::assumptions::{Model, WIDE, whole_m};
use super::compared::Compared;
use super::component_estimate::estimate;
use super::components::{ObserverComponents, SensorClass};
use super::congruence::{reweighted, standing};
use super::contrast::contrasts;
use super::cross_check::{CrossCheck, cross_check};
use super::datum::Datum;
use super::epoch_pair::{EpochErrorParams, EpochPair, all_sights};
use super::influence::{Influence, influences};
use super::joint::JointErrors;
use super::lone_area::LoneArea;
use super::model::{Prior, Problem, Row, Solution, Unknowns};
use super::observation::Observation;
use super::relative::relative_errors;
use super::rigid::{RigidError, difference_row, neighbour_row, rigid_rows, shares};
use super::scale::ScaleError;
use super::sensors::Sharpest;
use super::sight::{SeenStone, Sight, Source};
use super::stable::stable_observations;
use crate::progress::{Interrupted, Progress};
use crate::switches::{switchable, where_on};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// Error of the later epoch minus that of the reference at a place, world, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorAt {
    /// Its expectation; a measured displacement less this is the motion.
    pub mean: Vector3<f64>,
    /// Its covariance, m^2, scaled so that 1.96 standard deviations hold 95 %.
    pub covariance: Matrix3<f64>,
}

/// What was found about a source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SourceError {
    /// Name of the source.
    pub name: String,
    /// 0 for the reference epoch, 1 for the later one.
    pub epoch: usize,
    /// Error in the middle of what it sees against the mean of its epoch's sources, world, metres.
    pub against_epoch: Vector3<f64>,
    /// Standard deviation of that per axis, metres.
    pub sd: Vector3<f64>,
}

/// Result of [`epoch_errors`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochErrors {
    /// What the error was found from.
    pub datum: Datum,
    /// Class of the sensor.
    pub class: SensorClass,
    /// Error that all sources of an epoch are assumed to share, per axis, metres.
    pub shared_error_m: f64,
    /// Variances of the sources' errors; `None` where no epoch has sources to compare.
    pub components: Option<ObserverComponents>,
    /// Dimensionless stretch in the face, one value per epoch: each source is stretched about the middle of
    /// what it sees; `None` for a sensor without one.
    #[serde(default)]
    pub stretch: Option<[f64; 2]>,
    /// Twice the log likelihood that errors of the sources gain over none.
    pub significance: f64,
    /// Comparisons of sources per epoch, and cells of stable areas that stood still.
    pub observations: [usize; 3],
    /// Stable areas that moved against the others; they are left out.
    #[serde(default)]
    pub moved_areas: Vec<usize>,
    /// The stable area that shows an error which nothing else confirms, if there is one.
    #[serde(default)]
    pub lone_area: Option<LoneArea>,
    /// What each source and each stable area does to the results.
    #[serde(default)]
    pub influences: Vec<Influence>,
    /// Per source, in their order.
    pub sources: Vec<SourceError>,
    /// The rigid part of the error over all stones.
    pub rigid: RigidError,
    /// Comparison with surfaces off the wall; only where the datum comes from the sources.
    #[serde(default)]
    pub cross_check: Option<CrossCheck>,
    /// Error at each stone, in their order.
    pub at: Vec<ErrorAt>,
    /// Where the datum is unknown and files keep no sources apart: assumed non-rigid part of an epoch's
    /// registration error, per axis, metres.
    #[serde(default)]
    pub merged_error_m: Option<f64>,
    /// Where the datum is unknown: covariance of the error at each stone, in their order, after the closest
    /// rigid motion of all stones is taken off; world, m^2. Empty otherwise.
    #[serde(default)]
    pub relative: Vec<Matrix3<f64>>,
    /// Covariance of the error at the second of two neighbours less the error at the first, world, m^2, in
    /// the order of [`EpochPair::neighbours`]; where the datum is unknown, without the rigid motion.
    #[serde(skip)]
    pub between: Vec<Matrix3<f64>>,
    /// The scale of the later epoch; `None` where it is exact. Its expectation is in `at`.
    #[serde(default)]
    pub scale: Option<ScaleError>,
    /// Covariance that the scale and the photos' interior orientation give the error at each stone, in their order,
    /// which is part of the others; world, m^2.
    #[serde(default)]
    pub shared: Vec<Matrix3<f64>>,
    /// The error at all stones together; `None` where the numbers fail.
    #[serde(skip)]
    pub joint: Option<JointErrors>,
}

/// Twice the log likelihood that sources' errors must gain to be there: one sided 5 % of chi-square with one
/// degree of freedom, half of whose weight is at zero (Self & Liang 1987).
const SIGNIFICANT: f64 = 2.71;
/// Factors on the sources' errors over which their uncertainty is averaged, logarithms.
const FACTORS: [f64; 9] = [-1.2, -0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9, 1.2];
/// Factors whose posterior weight is a smaller share of the best one's are left out.
const LEAST_WEIGHT: f64 = 1e-3;
/// Rounds in which stones that are far off lose weight before the variances are estimated.
const GROSS_ROUNDS: usize = 5;
/// Error of a source on a plane as a whole, as a share of that of a single cell: most of it differs with
/// incidence and surface.
const PLANE_SHARE: f64 = 0.5;
/// Prior of a source's error where nothing but stable areas shows it, metres.
const OPEN_M: f64 = 0.03;

/// The error of the later epoch against the reference at every stone.
///
/// Where several sensors show an epoch, the sources of the sharpest one give its datum.
///
/// Cost: three evaluations of the compared stones' points; then dense algebra over the unknowns of the
/// sources.
///
/// # Errors
/// The caller stopped the work.
pub fn epoch_errors(
    pair: &EpochPair,
    params: &EpochErrorParams,
    progress: &dyn Progress,
) -> Result<EpochErrors, Interrupted> {
    let mut errors = match Sharpest::of(pair) {
        Some(sharpest) => of_sources(&sharpest.pair(pair), params, progress),
        None => of_sources(pair, params, progress),
    }?;
    progress.check()?;
    errors.add_shared(pair);
    Ok(errors)
}

/// Errors of the epochs from sources that are all used.
fn of_sources(
    pair: &EpochPair,
    params: &EpochErrorParams,
    progress: &dyn Progress,
) -> Result<EpochErrors, Interrupted> {
    let class = SensorClass::of_noise(pair.sigma_m);
    let shared_error_m = params.shared_error_m.unwrap_or(class.shared_error_m());
    let mut within: [Vec<Observation>; 2] =
        [0, 1].map(|e| contrasts(pair.sources, pair.stones, e, &params.contrasts));
    let stable = stable_observations(pair.stable, pair.sigma_m, &params.stable);
    let sights = all_sights(pair, &stable);
    let unknowns = Unknowns::new(pair.sources, &sights, class);
    let (components, significance) =
        estimated((pair.sources, &sights), &unknowns, &mut within, class, progress)?;
    let overlaps = within.iter().all(|w| !w.is_empty());
    let is_significant = overlaps && significance > SIGNIFICANT;
    let whole_m = match is_one_survey(pair) {
        true => 0.0,
        false => whole_m(
            params.shared_error_m,
            class,
            overlaps.then_some(&components),
            counts(pair),
        ),
    };

    let model = Model {
        components: match is_significant {
            true => components,
            false => opened(components),
        },
        whole: Matrix3::identity() * (whole_m * whole_m),
        open: Matrix3::identity() * (WIDE * whole_m).powi(2),
        plane_m: PLANE_SHARE * params.stable.systematic_share * pair.sigma_m,
        class,
    };
    let unknowns = unknowns.with_planes(&stable);
    let all: Vec<&Observation> = within.iter().flatten().chain(&stable).collect();
    let judging = model.widened(&unknowns, &all);
    progress.check()?;

    let (mut stable, mut moved_areas) = standing(&unknowns, &within, stable, &judging);
    let observations = [within[0].len(), within[1].len(), stable.len()];
    let datum_of = |cells: usize, overlaps: bool| {
        if cells >= params.stable.min_cells {
            Datum::Stable
        } else if overlaps && is_significant && !pair.is_aligned {
            Datum::Sources
        } else {
            Datum::Unknown
        }
    };
    let datum = datum_of(stable.len(), overlaps);

    if datum != Datum::Stable {
        stable.clear();
        moved_areas.clear();
    }

    let all: Vec<&Observation> = within.iter().flatten().chain(&stable).collect();
    let assumed = model;
    let model = match datum {
        Datum::Stable => assumed.widened(&unknowns, &all),
        Datum::Sources | Datum::Unknown => assumed,
    };
    progress.check()?;
    let reweighted = reweighted(&unknowns, &all, &model);
    let found = Averaged::new(&unknowns, &reweighted.iter().collect::<Vec<_>>(), &model);
    let rows = rigid_rows(pair, &unknowns);
    let rigid = rows.error(&found.weighted());
    let lone_area = LoneArea::among(&stable, &within, &unknowns, &assumed, &rows, &rigid);
    let datum_of = |rest: &[&Observation]| {
        let cells = rest.iter().filter(|o| o.plane().is_some()).count();
        let compares = |e: usize| {
            let mut of_stones = rest.iter().filter(|o| o.plane().is_none());
            of_stones.any(|o| pair.sources[o.sights[0].source].epoch == e)
        };
        datum_of(cells, (0..2).all(compares))
    };
    progress.check()?;
    let sizes = (&model, components.translation_m);
    let influences = influences(pair, &unknowns, &reweighted, sizes, datum_of);
    let relative = match datum {
        Datum::Unknown => relative_errors(pair, &within, &components, class, params),
        Datum::Stable | Datum::Sources => None,
    };

    let merged_error_m = relative.as_ref().and_then(|r| r.merged_error_m);
    let mut at = found.at_stones(pair, &unknowns, model.components.nugget_m[1]);
    let motions = means_of_motions(pair, &at, &rigid);
    at.iter_mut().zip(&motions).for_each(|(at, mean)| at.mean = *mean);
    let (relative, between, joint) = match relative {
        Some(relative) => (relative.at, relative.between, relative.joint),
        None => {
            let joint = found.joint(pair, &unknowns, model.components.nugget_m[1]);
            let joint = joint.map(|joint| JointErrors {
                mean_of_motions: motions,
                ..joint
            });
            (Vec::new(), found.between(pair, &unknowns), joint)
        }
    };

    let cross_check = match datum {
        Datum::Sources => cross_check(pair, &within, &rigid, &model, params),
        Datum::Stable | Datum::Unknown => None,
    };
    Ok(EpochErrors {
        datum,
        class,
        shared_error_m,
        components: overlaps.then_some(components),
        stretch: found.stretches(&unknowns).filter(|_| overlaps),
        significance,
        observations,
        moved_areas,
        lone_area,
        influences,
        sources: found.sources(pair, &unknowns),
        rigid,
        cross_check,
        at,
        merged_error_m,
        relative,
        between,
        scale: None,
        shared: Vec::new(),
        joint,
    })
}

/// The error of each stone's motion, from that of its points: the rigid part as it is, the rest as the solution follows
/// it.
fn means_of_motions(pair: &EpochPair, points: &[ErrorAt], rigid: &RigidError) -> Vec<Vector3<f64>> {
    let rigidly: Vec<Vector3<f64>> = pair.stones.iter().map(|s| rigid.at(&s.centroid)).collect();
    let rest: Vec<Vector3<f64>> = points.iter().zip(&rigidly).map(|(p, r)| p.mean - r).collect();
    let followed = pair.followed(vec![rest]).concat();
    rigidly.iter().zip(followed).map(|(r, f)| r + f).collect()
}

/// Whether sources of the later epoch have the error of sources of the reference.
fn is_one_survey(pair: &EpochPair) -> bool {
    pair.sources.iter().any(|s| s.same_as.is_some())
}

/// Number of sources of each epoch.
fn counts(pair: &EpochPair) -> [usize; 2] {
    [0, 1].map(|e| pair.sources.iter().filter(|s| s.epoch == e).count())
}

/// The components, and twice what they gain in log likelihood over sources without errors; disturbed stones
/// lose weight on the way.
///
/// # Errors
/// The caller stopped the work.
fn estimated(
    (sources, sights): (&[Source], &[Sight]),
    unknowns: &Unknowns,
    within: &mut [Vec<Observation>; 2],
    class: SensorClass,
    progress: &dyn Progress,
) -> Result<(ObserverComponents, f64), Interrupted> {
    let expected = ObserverComponents::expected(class);
    if within.iter().all(Vec::is_empty) {
        return Ok((expected, 0.0));
    }
    leave_out_gross(unknowns, within, &expected);
    let mut components = expected;

    for round in 0..2 {
        let all: Vec<&Observation> = within.iter().flatten().collect();
        let compared = Compared::of(sources, sights, &all);
        let of_compared = Unknowns::new(&compared.sources, &compared.sights, class);
        let observations: Vec<&Observation> = compared.observations.iter().collect();
        components = estimate(&Problem::new(&of_compared, &observations), class, progress)?;
        let problem = Problem::new(unknowns, &all);
        let prior = Prior::new(&components, 0.0);
        if round == 0
            && let Some(mean) = problem.mean(&prior, &components)
        {
            let weights = problem.weights(&mean, &components);
            within
                .iter_mut()
                .flatten()
                .zip(weights)
                .for_each(|(o, w)| o.weight = w);
        }
    }

    let all: Vec<&Observation> = within.iter().flatten().collect();
    let problem = Problem::new(unknowns, &all);
    let deviance = |c: &ObserverComponents| problem.deviance(&Prior::new(c, 0.0), c);
    let gain = deviance(&components.scaled(1e-3))
        .zip(deviance(&components))
        .map_or(0.0, |(without, with)| without - with);
    Ok((components, gain))
}

/// Takes the weight off stones that are far off whatever rigid errors the sources have, so that they do not make the
/// variances large.
fn leave_out_gross(unknowns: &Unknowns, within: &mut [Vec<Observation>; 2], expected: &ObserverComponents) {
    switchable!("obs_gross");
    let prior = Prior::new(&opened(*expected), 0.0);
    for _ in 0..GROSS_ROUNDS {
        let all: Vec<&Observation> = within.iter().flatten().collect();
        let problem = Problem::new(unknowns, &all);
        let weights = problem
            .mean(&prior, expected)
            .map(|mean| problem.gross_weights(&mean, expected));
        let Some(weights) = weights else {
            return;
        };
        let observations = within.iter_mut().flatten();
        observations.zip(&weights).for_each(|(o, w)| o.weight = *w);
        if weights.iter().all(|w| *w == 1.0) {
            return;
        }
    }
}

/// Components of sources whose errors only stable areas show.
fn opened(components: ObserverComponents) -> ObserverComponents {
    ObserverComponents {
        translation_m: OPEN_M,
        rotation_m: OPEN_M,
        ..components
    }
}

/// Solutions for several sizes of the sources' errors, with their posterior weights.
struct Averaged {
    solutions: Vec<(f64, Solution)>,
}

impl Averaged {
    fn new(unknowns: &Unknowns, observations: &[&Observation], model: &Model) -> Self {
        let problem = Problem::new(unknowns, observations);
        let deviances: Vec<(f64, f64)> = FACTORS
            .map(|f| where_on("obs_average", f, 0.0))
            .par_iter()
            .filter_map(|log| {
                let (prior, components) = model.scaled(log.exp());
                let deviance = problem.deviance(&prior, &components)?;
                Some((*log, deviance + components.penalty(model.class)))
            })
            .collect();
        let best = deviances.iter().map(|d| d.1).fold(f64::INFINITY, f64::min);
        let solved: Vec<(f64, Solution)> = deviances
            .into_par_iter()
            .map(|(log, deviance)| (log, (-0.5 * (deviance - best)).exp()))
            .filter(|(_, weight)| *weight > LEAST_WEIGHT)
            .filter_map(|(log, weight)| {
                let (prior, components) = model.scaled(log.exp());
                Some((weight, problem.solve(&prior, &components)?))
            })
            .collect();
        let sum: f64 = solved.iter().map(|s| s.0).sum();
        Self {
            solutions: solved.into_iter().map(|(w, s)| (w / sum, s)).collect(),
        }
    }

    /// A linear function of the unknowns: mean, and covariance that holds 95 % within 1.96 standard
    /// deviations.
    fn function(&self, row: &Row) -> ErrorAt {
        let parts: Vec<(f64, Vector3<f64>, Matrix3<f64>)> = self
            .solutions
            .iter()
            .map(|(w, s)| {
                let (mean, covariance) = s.function(row);
                (*w, mean, covariance)
            })
            .collect();
        let mean: Vector3<f64> = parts.iter().map(|(w, m, _)| m * *w).sum();
        let covariance: Matrix3<f64> = parts
            .iter()
            .map(|(w, m, c)| (c + (m - mean) * (m - mean).transpose()) * *w)
            .sum();
        let variances: Vec<(f64, f64)> = parts.iter().map(|(w, _, c)| (*w, c.trace() / 3.0)).collect();
        ErrorAt {
            mean,
            covariance: covariance * tail_factor(&variances),
        }
    }

    /// `across_m`: independent error of each source at each stone, out of its face.
    fn at_stones(&self, pair: &EpochPair, unknowns: &Unknowns, across_m: f64) -> Vec<ErrorAt> {
        let at = |stone: &SeenStone| {
            let mut error = self.function(&difference_row(stone, pair.sources, unknowns));
            error.covariance += of_stone_alone(stone, pair, across_m);
            error
        };
        pair.stones.par_iter().map(at).collect()
    }

    /// The error at all stones together.
    fn joint(&self, pair: &EpochPair, unknowns: &Unknowns, across_m: f64) -> Option<JointErrors> {
        let stones = pair.stones.iter();
        let rows = stones.clone().map(|s| difference_row(s, pair.sources, unknowns));
        let weighted: Vec<_> = self
            .solutions
            .iter()
            .map(|(w, s)| (*w, &s.mean, &s.covariance))
            .collect();
        let own = stones.map(|s| of_stone_alone(s, pair, across_m)).collect();
        JointErrors::new(rows.collect(), &weighted, own, true)
    }

    /// Covariances between neighbours, without the independent error of each source at each stone.
    fn between(&self, pair: &EpochPair, unknowns: &Unknowns) -> Vec<Matrix3<f64>> {
        let difference =
            |stones: &[usize; 2]| self.function(&neighbour_row(pair, stones, unknowns)).covariance;
        pair.neighbours.par_iter().map(difference).collect()
    }

    /// The mean stretch of each epoch.
    fn stretches(&self, unknowns: &Unknowns) -> Option<[f64; 2]> {
        let parts: Option<Vec<[f64; 2]>> = self
            .solutions
            .iter()
            .map(|(w, s)| Some(unknowns.stretches(&s.mean)?.map(|k| k * w)))
            .collect();
        parts.map(|list| [0, 1].map(|e| list.iter().map(|p| p[e]).sum()))
    }

    /// The solutions with their weights.
    fn weighted(&self) -> Vec<(f64, &Solution)> {
        self.solutions.iter().map(|(w, s)| (*w, s)).collect()
    }

    fn sources(&self, pair: &EpochPair, unknowns: &Unknowns) -> Vec<SourceError> {
        let of_epoch = |e: usize| -> Vec<usize> {
            (0..pair.sources.len())
                .filter(|&s| pair.sources[s].epoch == e)
                .collect()
        };
        let describe = |(s, source): (usize, &Source)| {
            let all = of_epoch(source.epoch);
            let share = 1.0 / all.len() as f64;
            let mut row: Row = all
                .iter()
                .map(|&o| (unknowns.translation(o), Matrix3::identity() * -share))
                .collect();
            row.push((unknowns.translation(s), Matrix3::identity()));
            let found = self.function(&row);
            SourceError {
                name: source.name.clone(),
                epoch: source.epoch,
                against_epoch: found.mean,
                sd: found.covariance.diagonal().map(|v| v.max(0.0).sqrt()),
            }
        };
        pair.sources.iter().enumerate().map(describe).collect()
    }
}

/// Covariance of the independent errors of the sources at a stone, `across_m` out of its face. In the face a stone
/// follows its neighbours, and what the field does not share counts there as an error of its observations already.
fn of_stone_alone(stone: &SeenStone, pair: &EpochPair, across_m: f64) -> Matrix3<f64> {
    let squares: f64 = shares(stone, pair.sources).iter().map(|s| s * s).sum();
    stone.normal * stone.normal.transpose() * (across_m.powi(2) * squares)
}

/// Factor on the mean variance of a mixture of centred normal laws, (share, variance) each, by which 1.96
/// standard deviations hold 95 %.
fn tail_factor(parts: &[(f64, f64)]) -> f64 {
    let mean: f64 = parts.iter().map(|(w, v)| w * v).sum();
    let Ok(law) = Normal::new(0.0, 1.0) else {
        return 1.0;
    };
    if !(mean.is_finite() && mean > 0.0) {
        return 1.0;
    }
    let beyond = |limit: f64| -> f64 {
        parts
            .iter()
            .filter(|(_, v)| *v > 0.0)
            .map(|(w, v)| w * 2.0 * law.cdf(-limit / v.sqrt()))
            .sum()
    };
    let (mut low, mut high) = (0.0, 20.0 * mean.sqrt());
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if beyond(middle) > 0.05 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let quantile = -law.inverse_cdf(0.025);
    (high / quantile).powi(2) / mean
}
