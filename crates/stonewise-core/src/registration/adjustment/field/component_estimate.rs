//! Estimation of the variance components by marginal likelihood.

use super::eliminate::eliminate_own_motions;
use super::field_vector::stone_from_field;
use super::prior::prior;
use super::problem::FieldProblem;
use super::solve::assemble;
use super::variance_components::{BOUNDS, COUNT, VarianceComponents};
use crate::progress::{Interrupted, Progress};
use crate::registration::least_deviance::least_deviance;

/// Variance components under which the stones' normal equations are most likely, field integrated out.
///
/// # Errors
/// The caller stopped the work.
pub(crate) fn most_likely_components(
    problem: &FieldProblem,
    progress: &dyn Progress,
) -> Result<VarianceComponents, Interrupted> {
    let count = problem.components.count();
    let value = |log: &[f64; COUNT]| {
        let components = VarianceComponents::from_log(*log, count);
        Some(deviance(problem, &components)? + components.penalty())
    };
    let log = least_deviance(problem.components.to_log(), count, &BOUNDS, value, progress)?;
    Ok(VarianceComponents::from_log(log, count))
}

/// Minus twice the log marginal likelihood of the normal equations, up to a constant, under other components
/// than the problem's.
///
/// The equations are those of the observations alone: the error in the face is among what is estimated.
pub(crate) fn deviance(problem: &FieldProblem, components: &VarianceComponents) -> Option<f64> {
    let prior = prior(problem.graph, components, &problem.ties, &problem.least);
    let prior_log_det = problem.graph.pattern.factor(&prior)?.log_det();
    let own = [
        components.own_variances(),
        problem.loose.own_variances(components),
    ];
    let (eliminated, mut evidence) = match &problem.photos {
        None => {
            let own = own.map(|own| components.with_error(own));
            (eliminate_own_motions(problem, &own), 0.0)
        }
        Some(photos) => {
            let joined = photos.join(problem, components);
            let constant = joined.iter().map(|e| e.constant).sum();
            (
                eliminate_own_motions(&problem.with_equations(&joined), &own),
                constant,
            )
        }
    };

    let normal = assemble(problem, prior, eliminated)?;
    let mut quadratic = 0.0;
    for ((state, stone), node) in normal
        .state
        .iter()
        .zip(&normal.eliminated)
        .zip(&problem.graph.nodes)
    {
        quadratic += (stone_from_field(&node.face_from_world) * state).dot(&stone.vector);
        evidence += stone.log_evidence;
    }

    Some(normal.factor.log_det() - prior_log_det - quadratic - 2.0 * evidence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::BlockMatrix;
    use crate::progress::Silent;
    use crate::registration::adjustment::field::PhotoTerms;
    use crate::registration::adjustment::field::testing::SmallWall;
    use crate::registration::adjustment::observation::NormalEquations;
    use crate::registration::adjustment::observation::photo::{BiasWeights, PoseInfluence, StonePhotos};
    use crate::registration::adjustment::stone_vector::StoneVector;
    use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Vector3, Vector6};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn dense(matrix: &BlockMatrix<9>, problem: &FieldProblem) -> DMatrix<f64> {
        let n = matrix.diagonal.len();
        let mut whole = DMatrix::zeros(9 * n, 9 * n);
        for (i, d) in matrix.diagonal.iter().enumerate() {
            whole.view_mut((9 * i, 9 * i), (9, 9)).copy_from(d);
        }
        for (block, edge) in matrix.edges.iter().zip(&problem.graph.edges) {
            let (low, high) = (9 * edge.low, 9 * edge.high);
            whole.view_mut((high, low), (9, 9)).copy_from(block);
            whole.view_mut((low, high), (9, 9)).copy_from(&block.transpose());
        }
        whole
    }

    /// All stones' frames on the diagonal.
    fn frames(problem: &FieldProblem) -> DMatrix<f64> {
        let n = problem.stones.len();
        let mut all = DMatrix::zeros(6 * n, 9 * n);
        for (i, node) in problem.graph.nodes.iter().enumerate() {
            let a = stone_from_field(&node.face_from_world);
            all.view_mut((6 * i, 9 * i), (6, 9)).copy_from(&a);
        }
        all
    }

    /// Minus twice the log likelihood of a normal variable about zero, up to a constant.
    fn normal_deviance(covariance: DMatrix<f64>, observed: &DVector<f64>) -> f64 {
        let factor = covariance.cholesky().unwrap();
        let log_det = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        log_det + observed.dot(&factor.solve(observed))
    }

    #[test]
    fn the_deviance_is_that_of_a_multivariate_normal_variable() {
        let wall = SmallWall::new(4, 3, 11);
        let problem = wall.problem(1.0);
        let (n, a) = (problem.stones.len(), frames(&problem));
        let start = VarianceComponents::start();
        let other = VarianceComponents {
            drift: [2e-3, 2e-2],
            own_m: 1e-3,
            error_m: 2e-4,
            ..start
        };
        // Observed motions scatter about zero with the covariance of field, own motion, error and noise.
        let by_definition = |components: &VarianceComponents| {
            let field = dense(
                &prior(problem.graph, components, &problem.ties, &problem.least),
                &problem,
            );
            let own = components.with_error(components.own_variances());
            let mut covariance = &a * field.try_inverse().unwrap() * a.transpose();
            let mut observed = DVector::zeros(6 * n);
            for (i, stone) in problem.stones.iter().enumerate() {
                let noise = stone.equations.information.try_inverse().unwrap();
                let mut block = covariance.view_mut((6 * i, 6 * i), (6, 6));
                block += noise + Matrix6::from_diagonal(&Vector6::from(own));
                observed
                    .rows_mut(6 * i, 6)
                    .copy_from(&(noise * stone.equations.vector));
            }
            normal_deviance(covariance, &observed)
        };
        let difference = deviance(&problem, &other).unwrap() - deviance(&problem, &start).unwrap();
        let expected = by_definition(&other) - by_definition(&start);
        assert!(
            (difference - expected).abs() < 1e-5 * expected.abs(),
            "{difference} {expected}"
        );
    }

    #[test]
    fn the_deviance_with_photos_is_that_of_both_observations() {
        let mut wall = SmallWall::new(3, 2, 4);
        // Without correlation between the face and what is across it an error in the face is plainly an error
        // there.
        for equations in &mut wall.equations {
            for (r, c) in (0..6).flat_map(|r| (0..6).map(move |c| (r, c))) {
                if [0, 1, 5].contains(&r) != [0, 1, 5].contains(&c) {
                    equations.information[(r, c)] = 0.0;
                }
            }
        }
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let photos: Vec<StonePhotos> = (0..6)
            .map(|k| {
                let m = Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0));
                let information = (m * m.transpose() + Matrix3::identity()) * 1e6;
                StonePhotos {
                    information,
                    vector: information * Vector3::from_fn(|_, _| rng.random_range(-2e-3..2e-3)),
                    place: [0.01 * f64::from(k), -0.02],
                    bias_factor: 1.0 + 0.2 * f64::from(k),
                    turn: None,
                    weights: BiasWeights::USUAL,
                    by_poses: PoseInfluence::none(),
                }
            })
            .collect();
        let origin = StoneVector::zeros();
        let mut problem = wall.problem(1.0);
        problem.photos = Some(PhotoTerms {
            stones: photos.iter().map(|p| (Some(p), origin)).collect(),
        });
        let (n, a) = (problem.stones.len(), frames(&problem));
        let start = VarianceComponents {
            appearance_m: Some(7e-4),
            ..VarianceComponents::start()
        };
        let other = VarianceComponents {
            error_m: 2e-4,
            appearance_m: Some(2e-4),
            ..start
        };
        let by_definition = |components: &VarianceComponents| {
            let field = dense(
                &prior(problem.graph, components, &problem.ties, &problem.least),
                &problem,
            );
            let mut motion = &a * field.try_inverse().unwrap() * a.transpose();
            let mut observe = DMatrix::<f64>::zeros(9 * n, 6 * n);
            let mut noise = DMatrix::<f64>::zeros(9 * n, 9 * n);
            let mut observed = DVector::<f64>::zeros(9 * n);
            let clouds_own = components.with_error([0.0; 6]);
            for (i, (stone, photos)) in problem.stones.iter().zip(&photos).enumerate() {
                let mut block = motion.view_mut((6 * i, 6 * i), (6, 6));
                block += Matrix6::from_diagonal(&Vector6::from(components.own_variances()));
                observe.view_mut((9 * i, 6 * i), (6, 6)).fill_with_identity();
                observe
                    .view_mut((9 * i + 6, 6 * i), (3, 6))
                    .copy_from(&StonePhotos::lever(photos.place));
                let of_clouds = stone.equations.information.try_inverse().unwrap();
                observed
                    .rows_mut(9 * i, 6)
                    .copy_from(&(of_clouds * stone.equations.vector));
                let error = Matrix6::from_diagonal(&Vector6::from(clouds_own));
                noise
                    .view_mut((9 * i, 9 * i), (6, 6))
                    .copy_from(&(of_clouds + error));
                let of_photos = photos.information.try_inverse().unwrap();
                observed
                    .rows_mut(9 * i + 6, 3)
                    .copy_from(&(of_photos * photos.vector));
                let bias = components.appearance_m().powi(2) * photos.bias_factor;
                let bias = Matrix3::from_diagonal(&Vector3::new(bias, bias, 0.0));
                noise
                    .view_mut((9 * i + 6, 9 * i + 6), (3, 3))
                    .copy_from(&(of_photos + bias));
            }
            let covariance = &observe * motion * observe.transpose() + noise;
            normal_deviance(covariance, &observed)
        };
        let difference = deviance(&problem, &other).unwrap() - deviance(&problem, &start).unwrap();
        let expected = by_definition(&other) - by_definition(&start);
        assert!(
            (difference - expected).abs() < 1e-4 * expected.abs(),
            "{difference} {expected}"
        );
    }

    #[test]
    fn components_from_which_a_survey_was_drawn_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut gauss = || stonewise_testing::normal(&mut rng);
        let truth = VarianceComponents {
            drift: [1.6e-2, 3e-2],
            own_m: 2e-3,
            ..VarianceComponents::start()
        };
        let mut wall = SmallWall::new(14, 10, 1);
        let problem = wall.problem(1.0);
        let field = dense(
            &prior(problem.graph, &truth, &problem.ties, &problem.least),
            &problem,
        );
        let root = field.cholesky().unwrap();
        let white = DVector::from_fn(9 * 140, |_, _| gauss());
        let drawn = frames(&problem) * root.l().transpose().solve_upper_triangular(&white).unwrap();
        let own = truth.with_error(truth.own_variances());
        let weights = Vector6::<f64>::from([1e8, 1e8, 1e8, 1e7, 1e7, 1e7]);
        let equations: Vec<NormalEquations> = (0..140)
            .map(|i| {
                let moved = Vector6::from_fn(|k, _| {
                    drawn[6 * i + k] + gauss() * own[k].sqrt() + gauss() / weights[k].sqrt()
                });
                NormalEquations {
                    information: Matrix6::from_diagonal(&weights),
                    vector: weights.component_mul(&moved),
                    constant: 0.0,
                }
            })
            .collect();
        wall.equations = equations;
        let mut problem = wall.problem(1.0);
        // As in the adjustment: some calls, each from where the last ended.
        for _ in 0..3 {
            problem.components = most_likely_components(&problem, &Silent).unwrap();
        }
        let found = problem.components;
        let ratios = [
            found.drift[0] / truth.drift[0],
            found.drift[1] / truth.drift[1],
            found.own_m / truth.own_m,
            found.own_rad / truth.own_rad,
        ];
        assert!(ratios.iter().all(|r| r.ln().abs() < 0.4), "{ratios:?}");
    }

    struct Stopped;

    impl Progress for Stopped {
        fn begin(&self, _what: &str, _total: u64) {}
        fn advance(&self, _units: u64) {}
        fn is_cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn the_estimate_ends_once_the_caller_stops_it() {
        let wall = SmallWall::new(4, 3, 1);
        let stopped = most_likely_components(&wall.problem(1.0), &Stopped);
        assert_eq!(stopped.err(), Some(Interrupted));
    }
}
