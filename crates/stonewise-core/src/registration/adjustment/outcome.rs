//! From the adjusted stones to one row per pair, with tests and uncertainties.

use super::bodies::{bodies, refuse_unconfirmed};
use super::breaks::find_breaks;
use super::candidate::Moving;
use super::covered::{covered, leave_out_covered};
use super::estimate::Estimate;
use super::joint::joint_motions;
use super::joint_motions::JointMotions;
use super::neighbour_covariances::neighbour_covariances;
use super::observation::NormalEquations;
use super::observation::surface::Equations;
use super::octaves::Octaves;
use super::params::{AdjustmentReport, Break};
use super::significance::loose_stones;
use super::solution::Solution;
use super::state::Adjustment;
use crate::geometry::Rigid3;
use crate::stone::{MotionFailure, NeighbourCovariance, PairResult, SharedParts, StoneMotion};
use crate::switches::is_on;
use nalgebra::{DMatrix, Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// A cell whose epochs differ by this many times the expected variance shows two surfaces (1 in 400 by
/// chance).
const BAD_CELL: f64 = 9.0;
/// A face of which this share shows two surfaces is not the same stone twice.
const BAD_SHARE: f64 = 0.25;
/// At least this many cells: one alone may be that of a neighbour which did not move along.
const BAD_CELLS: usize = 2;
/// The share in place of [`BAD_SHARE`] where the stone is probably loose: at its own optimum, remaining disagreement
/// means a wrong mask.
const BAD_SHARE_LOOSE: f64 = 0.2;
/// Sum of 4^-k: what all octaves of length together leave in the mean over the wall, in variances of one.
const OCTAVES_IN_MEAN: f64 = 4.0 / 3.0;
/// Information that keeps rotations solvable where no point determines them; far below any that counts.
const RIDGE: f64 = 1e-9;

/// What the last iteration says of the stones; nothing where there was none.
#[derive(Default)]
struct Found {
    results: Vec<PairResult>,
    breaks: Vec<Break>,
    neighbours: Vec<NeighbourCovariance>,
    common_covariance: Matrix3<f64>,
    joint: Option<JointMotions>,
}

/// Results of the last iteration; `None`: there was none.
pub(crate) fn report(
    adjustment: &Adjustment,
    last: Option<&Solution>,
    iterations: usize,
    converged: bool,
) -> AdjustmentReport {
    let found = last.map_or_else(Found::default, |solution| Found::of(adjustment, solution));
    let motions = || found.results.iter().filter_map(|r| r.motion.as_ref().ok());
    let moved: Vec<Vector3<f64>> = motions().filter(|m| !m.loose).map(|m| m.displacement).collect();
    AdjustmentReport {
        loose: motions().filter(|m| m.loose).count(),
        photos: adjustment.photo_report(&found.results),
        results: found.results,
        sigma_m: adjustment.surface.noise.sigma_m,
        roughness_m: adjustment.surface.noise.tau_m,
        cell_m: adjustment.surface.layout.cell_m,
        correlation_factor: adjustment.surface.correlation.factor(),
        components: adjustment.prior.components,
        common_motion: moved.iter().sum::<Vector3<f64>>() / moved.len().max(1) as f64,
        common_covariance: found.common_covariance,
        iterations,
        converged,
        breaks: found.breaks,
        neighbours: found.neighbours,
        joint: found.joint,
    }
}

impl Found {
    fn of(adjustment: &Adjustment, solution: &Solution) -> Self {
        let loose = loose_stones(adjustment);
        let shared = adjustment.shared_variances(1.0);
        let covered = covered(adjustment);
        let estimates = estimates(adjustment, solution, &shared, &covered);
        let octaves = Octaves::of(adjustment, |i| {
            let estimate = estimates[i].as_ref().ok().filter(|_| !loose[i])?;
            Some((estimate.mean + adjustment.prior.common_in(i)).translation())
        });
        let poses = octaves.of_poses(adjustment);
        let mut results = results(adjustment, solution, &loose, &estimates, (&octaves, &poses));
        leave_out_covered(&covered, &mut results);
        refuse_unconfirmed(adjustment, &mut results);
        Self {
            breaks: find_breaks(adjustment, &solution.field.state, |i| loose[i]),
            neighbours: neighbour_covariances(adjustment, solution, &results, &estimates, (&octaves, &poses)),
            common_covariance: common_covariance(adjustment, solution, &shared),
            joint: Some(joint_motions(
                adjustment,
                solution,
                &results,
                &estimates,
                &octaves.at_most(),
            )),
            results,
        }
    }
}

/// Covariance of the mean motion: of the field's mean, of the mean of what stones do and err on their own,
/// and of errors that points share over whole octaves of length. Of these the longest is one error of the
/// whole wall, the next has four patches, and so on: 1 + 1/4 + 1/16 + ... of an octave's variance is left in
/// the mean.
///
/// `shared`: variances of errors that all points of a stone share, over one octave.
fn common_covariance(adjustment: &Adjustment, solution: &Solution, shared: &[f64; 6]) -> Matrix3<f64> {
    let own = adjustment.prior.own_variances();
    let octave = shared[0];
    let of_stone = (0..3).map(|k| own[k] + shared[k] - octave).fold(0.0, f64::max);
    let stones = adjustment.stones.len().max(1) as f64;
    solution.field.mean_covariance + Matrix3::identity() * (of_stone / stones + OCTAVES_IN_MEAN * octave)
}

/// The stones' motions, or why there is none; `shared`: variances of errors that all points of a stone share,
/// against its neighbours.
fn estimates(
    adjustment: &Adjustment,
    solution: &Solution,
    shared: &[f64; 6],
    covered: &[bool],
) -> Vec<Result<Estimate, MotionFailure>> {
    let across = adjustment.moved_across(solution);
    let estimate = |i: usize| match failure(adjustment, i) {
        Some(failure) => Err(failure),
        None if covered[i] => Err(MotionFailure::Disagreement),
        None => Ok(adjustment.estimate(i, solution, shared, across[i].as_ref())),
    };
    (0..adjustment.stones.len())
        .into_par_iter()
        .map(estimate)
        .collect()
}

fn results(
    adjustment: &Adjustment,
    solution: &Solution,
    loose: &[bool],
    estimates: &[Result<Estimate, MotionFailure>],
    (octaves, poses): (&Octaves, &DMatrix<f64>),
) -> Vec<PairResult> {
    let shared = adjustment.shared_variances(1.0);
    let bodies = bodies(adjustment);
    let stones = adjustment.stones.par_iter().zip(estimates).enumerate();
    stones
        .map(|(i, (stone, estimate))| PairResult {
            first: stone.info.first,
            second: stone.info.second,
            body: bodies[i],
            motion: match estimate {
                Err(failure) => Err(failure.clone()),
                Ok(estimate) => {
                    let motion = motion(
                        adjustment,
                        i,
                        solution,
                        loose[i],
                        estimate,
                        (&shared, octaves, poses),
                    );
                    observable(motion, adjustment.params.max_sd_m)
                }
            },
        })
        .collect()
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
fn failure(adjustment: &Adjustment, i: usize) -> Option<MotionFailure> {
    let (stone, params) = (&adjustment.stones[i], &adjustment.params);
    if !stone.info.usable {
        let [first, second] = stone.info.counts;
        return Some(MotionFailure::TooFewPoints {
            first,
            second,
            needed: params.min_points,
        });
    }
    let Some(e) = stone.more_probable().surface.equations() else {
        return Some(MotionFailure::NotConverged);
    };
    let share = match stone.moving() == Moving::OnOwn {
        true => BAD_SHARE_LOOSE,
        false => BAD_SHARE,
    };
    let disagrees = shows_two_surfaces(e, adjustment.surface.correlation.small, share);
    if e.overlap < params.min_overlap || disagrees {
        return Some(MotionFailure::Disagreement);
    }
    stone.moves.then_some(MotionFailure::NotConverged)
}

/// Whether more than a share of a stone's cells shows two surfaces; `inflation`: factor on the expected
/// variances of small cells.
fn shows_two_surfaces(equations: &Equations, inflation: f64, share: f64) -> bool {
    let cells = equations.differences.len() as f64;
    let limit = BAD_CELL * inflation;
    let bad = equations.differences.iter().filter(|d| **d > limit).count();
    is_on("two_surfaces") && bad >= BAD_CELLS && bad as f64 / cells.max(1.0) > share
}

/// `shared`: variances of errors that all points of a stone share; those of the translation come from the octaves.
fn motion(
    adjustment: &Adjustment,
    i: usize,
    solution: &Solution,
    is_loose: bool,
    estimate: &Estimate,
    (shared, octaves, poses): (&[f64; 6], &Octaves, &DMatrix<f64>),
) -> StoneMotion {
    let node = &adjustment.prior.graph.nodes[i];
    let world = node.face_from_world.transpose();
    let x = estimate.mean + adjustment.prior.common_in(i);
    let displacement = world * x.translation();
    let rotation = world * x.rotation();
    let turned = UnitQuaternion::from_scaled_axis(rotation);
    let arm = node.centroid.coords;
    let mut local = estimate.covariance;
    for (k, variance) in shared.iter().enumerate().skip(3) {
        local[(k, k)] += variance;
    }
    let photos = adjustment.photo_part(i);
    let of_points = octaves.over_all(photos.as_ref()) + octaves.of_stone();
    let of_poses = photos.map_or_else(Matrix3::zeros, |photos| photos.pose_covariance(&photos, poses));
    let mut translation = local.fixed_view_mut::<3, 3>(0, 0);
    translation += of_points + of_poses;
    let covariance = in_world(&local, &world);
    let prediction = &solution.field.from_others[i];
    let common = adjustment.prior.common_in(i).translation();
    let expected = world * (prediction.mean.fixed_rows::<3>(0) + common);
    let equations = adjustment.stones[i].more_probable().surface.equations();

    StoneMotion {
        second_from_first: Rigid3::from_parts(Translation3::from(arm + displacement - turned * arm), turned),
        displacement,
        rotation,
        covariance,
        shared: SharedParts {
            points: world * of_points * world.transpose(),
            poses: world * of_poses * world.transpose(),
        },
        relative: displacement - expected,
        relative_covariance: world * estimate.relative_covariance * world.transpose(),
        loose: is_loose,
        p_loose: Some(adjustment.p_loose(&adjustment.stones[i])),
        observability: observability(&solution.equations[i].with_field),
        rmse_m: equations.map_or(f64::NAN, |e| e.rms_m),
    }
}

/// Covariance of (displacement, rotation) in world axes from that of a stone's unknowns.
fn in_world(local: &Matrix6<f64>, world: &Matrix3<f64>) -> Matrix6<f64> {
    let mut both = Matrix6::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(world);
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(world);
    both * local * both.transpose()
}

/// Square root of the smallest over the largest eigenvalue of the displacement's information, the rotation
/// free.
fn observability(equations: &NormalEquations) -> f64 {
    let h = &equations.information;
    let rest = h.fixed_view::<3, 3>(3, 3).into_owned() + Matrix3::identity() * RIDGE;
    let Some(factor) = rest.cholesky() else { return 0.0 };
    let cross = h.fixed_view::<3, 3>(3, 0).into_owned();
    let own = h.fixed_view::<3, 3>(0, 0) - cross.transpose() * factor.solve(&cross);
    let values = own.symmetric_eigenvalues();
    if values.max() > 0.0 {
        (values.min().max(0.0) / values.max()).sqrt()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::observation::surface::without_points;
    use nalgebra::{Rotation3, Vector6};

    #[test]
    fn observability_is_that_of_the_inverse_covariance_of_the_displacement() {
        let m = Matrix6::from_fn(|r, c| ((r * 5 + c * 11) % 7) as f64 - 3.0);
        let information = m * m.transpose() + Matrix6::identity();
        let equations = NormalEquations {
            information,
            vector: Vector6::zeros(),
            constant: 0.0,
        };
        let covariance = information
            .try_inverse()
            .unwrap()
            .fixed_view::<3, 3>(0, 0)
            .into_owned();
        let values = covariance.symmetric_eigenvalues();
        let expected = (values.min() / values.max()).sqrt();
        assert!((observability(&equations) - expected).abs() < 1e-6);
        assert_eq!(observability(&NormalEquations::nothing()), 0.0);
    }

    #[test]
    fn a_share_of_bad_cells_shows_two_surfaces_and_one_cell_does_not() {
        let with = |bad: usize, good: usize| Equations {
            differences: [vec![40.0; bad], vec![1.0; good]].concat(),
            ..without_points()
        };
        assert!(shows_two_surfaces(&with(6, 14), 1.0, BAD_SHARE));
        assert!(!shows_two_surfaces(&with(5, 15), 1.0, BAD_SHARE));
        assert!(shows_two_surfaces(&with(5, 15), 1.0, BAD_SHARE_LOOSE));
        assert!(!shows_two_surfaces(&with(6, 14), 5.0, BAD_SHARE));
        assert!(!shows_two_surfaces(&with(1, 2), 1.0, BAD_SHARE));
    }

    #[test]
    fn covariances_turn_with_their_axes() {
        let turn = Rotation3::from_euler_angles(0.3, -0.2, 0.9).into_inner();
        let m = Matrix6::from_fn(|r, c| ((r * 3 + c * 7) % 5) as f64);
        let local = m * m.transpose();
        let found = in_world(&local, &turn);
        for (r, c) in [(0, 0), (0, 3), (3, 0), (3, 3)] {
            let expected = turn * local.fixed_view::<3, 3>(r, c) * turn.transpose();
            assert!((found.fixed_view::<3, 3>(r, c) - expected).norm() < 1e-9 * expected.norm());
        }
    }

    #[test]
    fn a_motion_is_refused_along_its_weakest_direction() {
        let motion = |sd: f64| StoneMotion {
            second_from_first: Rigid3::identity(),
            displacement: Vector3::zeros(),
            rotation: Vector3::zeros(),
            covariance: Matrix6::from_diagonal(&nalgebra::Vector6::new(1e-6, sd * sd, 1e-6, 1.0, 1.0, 1.0)),
            shared: SharedParts::default(),
            relative: Vector3::zeros(),
            relative_covariance: Matrix3::zeros(),
            loose: false,
            p_loose: None,
            observability: 1.0,
            rmse_m: 0.0,
        };
        assert!(observable(motion(0.019), 0.02).is_ok());
        let Err(MotionFailure::Unobservable { direction }) = observable(motion(0.021), 0.02) else {
            panic!("a motion known to 21 mm was reported")
        };
        assert!(direction.y.abs() > 0.999);
    }
}
