//! Covariances of the motions of neighbours relative to each other.

use super::estimate::{Estimate, widening};
use super::field::stone_from_field;
use super::solution::Solution;
use super::state::Adjustment;
use super::stone_vector::Matrix9;
use crate::statistics::{UPPER_95, student_95};
use crate::stone::{Contrast, PairResult};
use nalgebra::Matrix3;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

/// Covariances of the displacements of neighbours relative to each other, where both were measured.
///
/// A stone's motion is x = B A f + e. f is the field at the stone, A turns it into a motion of the stone, B
/// is the share with which the stone follows it, and e holds the stone's own motion and its error. Neighbours
/// share the error of f; the covariance between them is B_i A_i Q_ij A_j' B_j' with the blocks Q_ij of the
/// inverse normal matrix. They also share errors of the poses. Points share errors over octaves of length;
/// only the shortest octave counts for each stone, because neighbours have the longer ones in common.
///
/// Each stone that photos show also adds the least appearance bias (`LEAST_APPEARANCE_M`). The field averages
/// biases over neighbours as if they were independent normal errors, but light and shadow shift a few stones
/// by many times the usual bias.
///
/// The distributions of the ties between neighbours and of the errors of single photos have heavy tails, but
/// the covariance of f is that of a normal distribution with the weights that result from them. The
/// covariance is therefore scaled so that 1.96 standard deviations contain 95 % of the distribution of the
/// ties.
pub(crate) fn contrasts(
    adjustment: &Adjustment,
    solution: &Solution,
    results: &[PairResult],
) -> Vec<Contrast> {
    let shared = adjustment.shared_variances(1.0);
    let estimates: Vec<Option<Estimate>> = results
        .par_iter()
        .enumerate()
        .map(|(i, r)| {
            r.motion
                .as_ref()
                .ok()
                .map(|_| adjustment.estimate(i, solution, &shared))
        })
        .collect();
    let tails = tail_factor(adjustment.params.tie_freedom);
    let own = Matrix3::from_diagonal(&nalgebra::Vector3::new(shared[0], shared[1], shared[2]));
    let edges = adjustment.graph.edges.par_iter().enumerate();
    let contrast = |(k, edge): (usize, &super::field::Edge)| {
        let [low, high] = [edge.low, edge.high];
        let [a, b] = [estimates[low].as_ref()?, estimates[high].as_ref()?];
        let frames = [low, high].map(|i| &adjustment.graph.nodes[i].face_from_world);
        let between = between(frames, [a, b], &solution.field.inverse.edges[k].transpose());
        let spread = in_world(frames[0], &translation(a)) + in_world(frames[1], &translation(b))
            - between
            - between.transpose();
        let both_missed = a.missed + b.missed;
        Some(Contrast {
            stones: [low, high].map(|i| results[i].first),
            covariance: without_negative(&spread) * (widening(both_missed) * tails)
                + in_world(frames[0], &own)
                + in_world(frames[1], &own)
                + in_world(frames[0], &adjustment.least_photo_error(low))
                + in_world(frames[1], &adjustment.least_photo_error(high))
                + of_poses(adjustment, [low, high]),
        })
    };
    edges.filter_map(contrast).collect()
}

/// Factor on a variance with which 1.96 standard deviations contain 95 % of a t distribution with these
/// degrees of freedom.
fn tail_factor(freedom: f64) -> f64 {
    let normal = Normal::standard().inverse_cdf(UPPER_95);
    (student_95(freedom, normal) / normal).powi(2)
}

/// Covariance of a stone's translation, not widened for the chance that it is loose.
fn translation(estimate: &Estimate) -> Matrix3<f64> {
    estimate.covariance.fixed_view::<3, 3>(0, 0) / widening(estimate.missed)
}

/// Covariance between two stones' translations, world, from the covariance between the field at the first and
/// the field at the second.
fn between(frames: [&Matrix3<f64>; 2], estimates: [&Estimate; 2], field: &Matrix9) -> Matrix3<f64> {
    let [a, b] = [0, 1].map(|k| estimates[k].by_field * stone_from_field(frames[k]));
    let local = a * field * b.transpose();
    frames[0].transpose() * local.fixed_view::<3, 3>(0, 0) * frames[1]
}

/// Covariance of the difference of two displacements that errors of the poses cause, world.
fn of_poses(adjustment: &Adjustment, stones: [usize; 2]) -> Matrix3<f64> {
    let block = |a: usize, b: usize| {
        let [from, to] = [a, b].map(|k| &adjustment.graph.nodes[stones[k]].face_from_world);
        from.transpose() * adjustment.pose_covariance(stones[a], stones[b]) * to
    };
    let between = block(0, 1);
    without_negative(&(block(0, 0) + block(1, 1) - between - between.transpose()))
}

fn in_world(face_from_world: &Matrix3<f64>, covariance: &Matrix3<f64>) -> Matrix3<f64> {
    face_from_world.transpose() * covariance * face_from_world
}

/// Symmetric, and without the negative eigenvalues that rounding leaves.
fn without_negative(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = (0.5 * (covariance + covariance.transpose())).symmetric_eigen();
    let values = eigen.eigenvalues.map(|v| v.max(0.0));
    eigen.eigenvectors * Matrix3::from_diagonal(&values) * eigen.eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::estimate::by_field;
    use crate::registration::adjustment::observation::NormalEquations;
    use crate::registration::adjustment::stone_vector::{StoneVector, Vector9};
    use nalgebra::{DMatrix, Rotation3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Two stones with fields, own motions and observations of both, all unknowns in one dense matrix.
    #[test]
    fn neighbours_share_what_the_dense_inverse_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut spd = |size: usize, scale: f64| {
            let m = DMatrix::from_fn(size, size, |_, _| rng.random_range(-1.0..1.0));
            (&m * m.transpose() + DMatrix::identity(size, size)) * scale
        };
        let prior = spd(18, 1e5);
        let observed: [Matrix9; 2] = [0, 1].map(|_| Matrix9::from_column_slice(spd(9, 1e6).as_slice()));
        let own: [f64; 9] = std::array::from_fn(|k| 1e-7 * (k + 1) as f64);
        let frames = [[0.3, -0.2, 0.9], [-0.4, 0.1, 0.2]]
            .map(|[r, p, y]| Rotation3::from_euler_angles(r, p, y).into_inner());
        let fields = frames.map(|frame| stone_from_field(&frame));
        // Unknowns: both fields, both own motions.
        let mut normal = DMatrix::<f64>::zeros(36, 36);
        normal.view_mut((0, 0), (18, 18)).copy_from(&prior);
        let motions = [0, 1].map(|i| {
            let mut motion = DMatrix::<f64>::zeros(9, 36);
            motion.view_mut((0, 9 * i), (9, 9)).copy_from(&fields[i]);
            motion.view_mut((0, 18 + 9 * i), (9, 9)).fill_with_identity();
            motion
        });
        for (i, motion) in motions.iter().enumerate() {
            normal += motion.transpose() * observed[i] * motion;
            (0..9).for_each(|k| normal[(18 + 9 * i + k, 18 + 9 * i + k)] += 1.0 / own[k]);
        }
        let inverse = normal.try_inverse().unwrap();
        let expected = &motions[0] * &inverse * motions[1].transpose();
        let expected = frames[0].transpose() * expected.fixed_view::<3, 3>(0, 0) * frames[1];
        let field = Matrix9::from_fn(|r, c| inverse[(r, 9 + c)]);
        let estimates = observed.map(|information| Estimate {
            mean: StoneVector::from(Vector9::zeros()),
            covariance: Matrix9::zeros(),
            relative_covariance: Matrix3::zeros(),
            missed: 0.0,
            by_field: by_field(
                &NormalEquations {
                    information,
                    vector: Vector9::zeros(),
                    constant: 0.0,
                },
                &own,
            ),
        });
        let found = between([&frames[0], &frames[1]], [&estimates[0], &estimates[1]], &field);
        assert!(
            (found - expected).norm() < 1e-6 * expected.norm(),
            "{found} {expected}"
        );
    }

    #[test]
    fn heavy_tails_widen_to_their_quantile() {
        // Tables of quantiles at 97.5 %: 3.1824 for t with three degrees of freedom, 1.96 for the normal law.
        assert!((tail_factor(3.0) - (3.1824f64 / 1.959_96).powi(2)).abs() < 1e-3);
        assert!((tail_factor(1e7) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn rounding_leaves_no_negative_variance() {
        let turn = Rotation3::from_euler_angles(0.1, 0.2, 0.3).into_inner();
        let made = |values: [f64; 3]| turn * Matrix3::from_diagonal(&values.into()) * turn.transpose();
        let found = without_negative(&made([2.0, 1.0, -1e-3]));
        assert!((found - made([2.0, 1.0, 0.0])).norm() < 1e-12);
    }
}
