//! From the adjusted network to one row per pair, with tests and uncertainties.

use super::equations::Motion9;
use super::field::{self, Field, StoneTerm};
use super::graph::Edge;
use super::network::{Network, Terms};
use super::params::{Break, NetworkParams, NetworkReport};
use super::track::Track;
use crate::geometry::Rigid3;
use crate::stone::{MotionFailure, PairResult, StoneMotion};
use nalgebra::{Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A cell whose epochs differ by this many times the expected variance shows two surfaces (1 in 400 by chance).
const BAD_CELL: f64 = 9.0;
/// A face of which this share shows two surfaces is not the same stone twice.
const BAD_SHARE: f64 = 0.25;
/// At least so many cells: one alone may be that of a neighbour which did not move along.
const BAD_CELLS: usize = 2;
/// The same share where the stone is thought loose: what still disagrees at its own optimum was not moved, but spoilt.
const BAD_SHARE_LOOSE: f64 = 0.2;
/// Factor by which the bending's variance is raised in the test for loose stones.
const BENDING_SLACK: f64 = 100.0;
/// Squared jump over the variance that a whole tie gives it: chance alone exceeds it once in a million ties.
const BREAK_EXCESS: f64 = 30.0;
/// A tie weaker than this is broken.
const BROKEN: f64 = 0.1;

/// Results of the last iteration.
pub(super) fn report(
    network: &Network,
    last: Option<(Terms, Field)>,
    params: &NetworkParams,
    iterations: usize,
    converged: bool,
) -> NetworkReport {
    let (terms, field) = match last {
        Some((t, f)) => (t, Some(f)),
        None => (
            Terms {
                tight: Vec::new(),
                free: Vec::new(),
            },
            None,
        ),
    };
    let mut results = Vec::new();
    let mut breaks = Vec::new();
    let mut common_covariance = Matrix3::zeros();
    if let Some(field) = &field {
        let shared = network.shared_variances(network.octaves(), params);
        let p_values = own_motion_tests(network, &terms, field, params);
        let loose = loose_stones(network, &p_values, params);
        results = (0..terms.tight.len())
            .map(|i| {
                let tested = (p_values[i].unwrap_or(1.0), loose[i]);
                result(network, i, &terms, field, tested, &shared, params)
            })
            .collect();
        breaks = find_breaks(network, field, &loose);
        let own = network.components.own_variances();
        let variance: f64 = (0..3).map(|k| own[k] + shared[k]).fold(0.0, f64::max);
        common_covariance =
            field.mean_covariance + Matrix3::identity() * (variance / results.len().max(1) as f64);
    }
    let moved: Vec<Vector3<f64>> = results
        .iter()
        .filter_map(|r| {
            r.motion
                .as_ref()
                .ok()
                .filter(|m| !m.loose)
                .map(|m| m.displacement)
        })
        .collect();
    let common_motion = moved.iter().sum::<Vector3<f64>>() / moved.len().max(1) as f64;
    NetworkReport {
        loose: results
            .iter()
            .filter(|r| r.motion.as_ref().is_ok_and(|m| m.loose))
            .count(),
        results,
        sigma_m: network.noise.sigma_m,
        roughness_m: network.noise.tau_m,
        cell_m: network.layout.cell_m,
        correlation_factor: network.correlation.factor(),
        components: network.components,
        common_motion,
        common_covariance,
        iterations,
        converged,
        breaks,
    }
}

/// Tests each stone against its neighbours: probability of so large a departure where it moves with them. `None` where its
/// points say nothing.
fn own_motion_tests(
    network: &Network,
    terms: &Terms,
    field: &Field,
    params: &NetworkParams,
) -> Vec<Option<f64>> {
    let mut own = network.components.own_variances();
    // A bent face is not a loose stone: bending is left free.
    own[6..].iter_mut().for_each(|v| *v *= BENDING_SLACK);
    for (v, shared) in own.iter_mut().zip(network.shared_variances(1.0, params)) {
        *v += shared;
    }
    (0..terms.tight.len())
        .map(|i| {
            let (misfit, freedom) = field::posterior(&terms.tight[i], &field.from_others[i], &own).misfit;
            let law = ChiSquared::new(freedom as f64).ok()?;
            (freedom > 0 && network.survey.stones[i].usable).then(|| law.sf(misfit))
        })
        .collect()
}

/// Stones that are loose, with the false discovery rate controlled (Benjamini & Hochberg 1995).
///
/// Significance alone is not enough: scans show departures of tenths of a millimetre that come from how stations
/// overlap. A stone is loose if it also moved as loose stones do more probably than as its neighbours.
fn loose_stones(network: &Network, p_values: &[Option<f64>], params: &NetworkParams) -> Vec<bool> {
    let mut sorted: Vec<(f64, usize)> = p_values
        .iter()
        .enumerate()
        .filter_map(|(i, p)| Some(((*p)?, i)))
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let tests = sorted.len() as f64;
    let last = sorted
        .iter()
        .enumerate()
        .rposition(|(k, p)| p.0 <= params.false_discovery_rate * (k + 1) as f64 / tests);
    let mut loose = surely_loose(network, params.false_discovery_rate);
    for &(_, i) in sorted.iter().take(last.map_or(0, |k| k + 1)) {
        loose[i] |= network.beliefs.tight[i] < 0.5;
    }
    loose
}

/// Stones followed to their own optimum, as many as can be called loose so that the mean probability of an error among them is no
/// more than `rate` (Newton et al. 2004).
fn surely_loose(network: &Network, rate: f64) -> Vec<bool> {
    let mut followed: Vec<(f64, usize)> = network
        .free
        .iter()
        .enumerate()
        .filter(|(_, free)| free.is_some())
        .map(|(i, _)| (network.beliefs.tight[i], i))
        .collect();
    followed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut loose = vec![false; network.free.len()];
    let mut errors = 0.0;
    for (k, &(tight, i)) in followed.iter().enumerate() {
        errors += tight;
        if errors > rate * (k + 1) as f64 {
            break;
        }
        loose[i] = true;
    }
    loose
}

fn result(
    network: &Network,
    i: usize,
    terms: &Terms,
    field: &Field,
    tested: (f64, bool),
    shared: &[f64; 9],
    params: &NetworkParams,
) -> PairResult {
    let stone = &network.survey.stones[i];
    let motion = match judge(network, i, params) {
        Some(failure) => Err(failure),
        None => observable(motion(network, i, terms, field, tested, shared), params.max_sd_m),
    };
    PairResult {
        first: stone.first,
        second: stone.second,
        motion,
    }
}

/// Refuses a motion whose weakest direction neither the stone nor its neighbours show.
fn observable(motion: StoneMotion, max_sd_m: f64) -> Result<StoneMotion, MotionFailure> {
    let eigen = motion
        .covariance
        .fixed_view::<3, 3>(0, 0)
        .into_owned()
        .symmetric_eigen();
    let worst = eigen.eigenvalues.imax();
    if eigen.eigenvalues[worst] > max_sd_m * max_sd_m {
        let direction = eigen.eigenvectors.column(worst).into_owned();
        return Err(MotionFailure::Unobservable { direction });
    }
    Ok(motion)
}

/// Why a stone has no motion.
fn judge(network: &Network, i: usize, params: &NetworkParams) -> Option<MotionFailure> {
    let stone = &network.survey.stones[i];
    if !stone.usable {
        let [first, second] = stone.counts;
        return Some(MotionFailure::TooFewPoints {
            first,
            second,
            needed: params.min_points,
        });
    }
    let Some(e) = track(network, i).equations() else {
        return Some(MotionFailure::NotConverged);
    };
    let cells = e.differences.len() as f64;
    let limit = BAD_CELL * network.correlation.factor();
    let bad = e.differences.iter().filter(|d| **d > limit).count();
    let bad_share = bad as f64 / cells.max(1.0);
    let share = if network.beliefs.tight[i] < 0.5 {
        BAD_SHARE_LOOSE
    } else {
        BAD_SHARE
    };
    if e.overlap < params.min_overlap || (bad >= BAD_CELLS && bad_share > share) {
        return Some(MotionFailure::Disagreement);
    }
    None
}

/// The motion that the stone more probably made: its own or the field's.
fn track(network: &Network, i: usize) -> &Track {
    match &network.free[i] {
        Some(free) if network.beliefs.tight[i] < 0.5 => free,
        _ => &network.tight[i],
    }
}

fn motion(
    network: &Network,
    i: usize,
    terms: &Terms,
    field: &Field,
    (own_motion_p, loose): (f64, bool),
    shared: &[f64; 9],
) -> StoneMotion {
    let node = &network.graph.nodes[i];
    let world = node.face_from_world.transpose();
    let posterior = network.estimate(i, terms, field);
    let x = posterior.mean + network.common_in(i);
    let displacement = world * x.fixed_rows::<3>(0);
    let rotation = world * x.fixed_rows::<3>(3);
    let turned = UnitQuaternion::from_scaled_axis(rotation);
    let arm = node.centroid.coords;
    let mut covariance = Matrix6::zeros();
    let mut local = posterior.covariance;
    for (k, variance) in shared.iter().enumerate() {
        local[(k, k)] += variance;
    }
    for (r, c) in [(0, 0), (0, 3), (3, 0), (3, 3)] {
        let block = world * local.fixed_view::<3, 3>(r, c) * world.transpose();
        covariance.fixed_view_mut::<3, 3>(r, c).copy_from(&block);
    }
    let prediction = &field.from_others[i];
    let expected = world * (prediction.mean.fixed_rows::<3>(0) + network.common_in(i).fixed_rows::<3>(0));
    let spread = world * prediction.covariance.fixed_view::<3, 3>(0, 0) * world.transpose();
    StoneMotion {
        second_from_first: Rigid3::from_parts(Translation3::from(arm + displacement - turned * arm), turned),
        displacement,
        rotation,
        covariance,
        relative: displacement - expected,
        relative_covariance: covariance.fixed_view::<3, 3>(0, 0) + spread,
        own_motion_p,
        loose,
        observability: observability(&terms.tight[i]),
        rmse_m: track(network, i).equations().map_or(f64::NAN, |e| e.rms_m),
    }
}

/// Smallest over largest eigenvalue of the displacement's information, rotation and bending free.
fn observability(term: &StoneTerm) -> f64 {
    let h = &term.information;
    let rest = h.fixed_view::<6, 6>(3, 3).into_owned() + Matrix6::identity() * 1e-9;
    let Some(factor) = rest.cholesky() else { return 0.0 };
    let cross = h.fixed_view::<6, 3>(3, 0).into_owned();
    let own = h.fixed_view::<3, 3>(0, 0) - cross.transpose() * factor.solve(&cross);
    let values = own.symmetric_eigenvalues();
    if values.max() > 0.0 {
        (values.min().max(0.0) / values.max()).sqrt()
    } else {
        0.0
    }
}

/// Ties between stones that are not loose, over which the field jumps: those that a line of break parts, and single ones that broke
/// with a jump far beyond what a whole tie allows.
fn find_breaks(network: &Network, field: &Field, loose: &[bool]) -> Vec<Break> {
    let drift = network.components.drift;
    let is_broken = |e: usize, edge: &Edge, jump: &Vector3<f64>| {
        if network.beliefs.parted[e] {
            return network.lines.iter().any(|line| {
                let sign =
                    f64::from(u8::from(line.side[edge.high])) - f64::from(u8::from(line.side[edge.low]));
                sign * jump.dot(&line.jump) > 0.5 * line.jump.norm_squared()
            });
        }
        let local = edge.face_from_world * jump;
        let [inside, outside] = drift.map(|q| q * (edge.length_m.powi(3) / 12.0).sqrt());
        let excess = local.xy().norm_squared() / inside.powi(2) + (local.z / outside).powi(2);
        network.beliefs.tie[e] < BROKEN && excess > BREAK_EXCESS
    };
    network
        .graph
        .edges
        .iter()
        .enumerate()
        .filter(|(_, edge)| !loose[edge.low] && !loose[edge.high])
        .filter_map(|(e, edge)| {
            let (low, high) = (&field.state[edge.low], &field.state[edge.high]);
            let part = |state: &Motion9, k: usize| state.fixed_rows::<3>(k).into_owned();
            let mean_gradient = |k: usize| 0.5 * (part(low, k) + part(high, k));
            let explained = mean_gradient(3) * edge.step[0] + mean_gradient(6) * edge.step[1];
            let jump = part(high, 0) - part(low, 0) - explained;
            is_broken(e, edge, &jump).then(|| Break {
                from: network.survey.stones[edge.low].first,
                to: network.survey.stones[edge.high].first,
                jump,
            })
        })
        .collect()
}
