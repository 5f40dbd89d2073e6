//! Covariances of the motions of neighbours relative to each other.

use super::estimate::Estimate;
use super::field::{Edge, Matrix9, stone_from_field};
use super::octaves::Octaves;
use super::solution::Solution;
use super::state::Adjustment;
use super::tracking::PhotoPart;
use crate::linalg::without_negative;
use crate::statistics::{UPPER_95, student_95};
use crate::stone::{MotionFailure, NeighbourCovariance, PairResult};
use nalgebra::{DMatrix, Matrix3};
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
pub(crate) fn neighbour_covariances(
    adjustment: &Adjustment,
    solution: &Solution,
    results: &[PairResult],
    estimates: &[Result<Estimate, MotionFailure>],
    (octaves, poses): (&Octaves, &DMatrix<f64>),
) -> Vec<NeighbourCovariance> {
    let tails = tail_factor(adjustment.params.tie_freedom);
    let octave = octaves.one() + octaves.of_stone();
    let measured: Vec<Option<Measured>> = estimates
        .par_iter()
        .enumerate()
        .map(|(i, estimate)| {
            let estimate = estimate.as_ref().ok().filter(|_| results[i].motion.is_ok())?;
            Some(Measured::new(adjustment, i, estimate, (&octave, poses)))
        })
        .collect();

    let of_edge = |(k, edge): (usize, &Edge)| {
        let [a, b] = [measured[edge.low].as_ref()?, measured[edge.high].as_ref()?];
        let between = between([a, b], &solution.field.inverse.edges[k].transpose());
        let spread = a.translation + b.translation - between - between.transpose();
        let mut stones = [edge.low, edge.high].map(|i| results[i].first);
        stones.sort_unstable();
        Some(NeighbourCovariance {
            stones,
            covariance: without_negative(&spread) * tails
                + a.octave
                + b.octave
                + a.least_photo_error
                + b.least_photo_error
                + of_poses([a, b], poses),
        })
    };

    let edges = adjustment.prior.graph.edges.par_iter().enumerate();
    edges.filter_map(of_edge).collect()
}

/// What a measured stone contributes to the covariance with each neighbour; in world coordinates.
struct Measured<'a> {
    estimate: &'a Estimate,
    face_from_world: &'a Matrix3<f64>,
    photos: Option<PhotoPart<'a>>,
    translation: Matrix3<f64>,
    /// Covariance of the shortest octave of the errors that its points share.
    octave: Matrix3<f64>,
    least_photo_error: Matrix3<f64>,
    /// Covariance that errors of the poses cause.
    of_poses: Matrix3<f64>,
}

impl<'a> Measured<'a> {
    /// `octave`: of the errors that points share; `poses`: of the poses' errors.
    fn new(
        adjustment: &'a Adjustment,
        i: usize,
        estimate: &'a Estimate,
        (octave, poses): (&Matrix3<f64>, &DMatrix<f64>),
    ) -> Self {
        let face_from_world = &adjustment.prior.graph.nodes[i].face_from_world;
        let in_world = |covariance: &Matrix3<f64>| face_from_world.transpose() * covariance * face_from_world;
        let photos = adjustment.photo_part(i);
        let translation = estimate.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let of_photos = |covariance: &dyn Fn(&PhotoPart) -> Matrix3<f64>| {
            in_world(&photos.as_ref().map_or_else(Matrix3::zeros, covariance))
        };
        Self {
            estimate,
            face_from_world,
            translation: in_world(&translation),
            octave: in_world(octave),
            least_photo_error: of_photos(&|part| part.least_error()),
            of_poses: of_photos(&|part| part.pose_covariance(part, poses)),
            photos,
        }
    }
}

/// Factor on a variance with which 1.96 standard deviations contain 95 % of a t distribution with these
/// degrees of freedom.
fn tail_factor(freedom: f64) -> f64 {
    let normal = Normal::standard().inverse_cdf(UPPER_95);
    (student_95(freedom, normal) / normal).powi(2)
}

/// Covariance between two stones' translations, world, from the covariance between the field at the first and
/// the field at the second.
fn between([a, b]: [&Measured; 2], field: &Matrix9) -> Matrix3<f64> {
    let [by_first, by_second] = [a, b].map(|s| s.estimate.by_field * stone_from_field(s.face_from_world));
    let local = by_first * field * by_second.transpose();
    a.face_from_world.transpose() * local.fixed_view::<3, 3>(0, 0) * b.face_from_world
}

/// Covariance of the difference of two displacements that errors of the poses cause, world.
fn of_poses([a, b]: [&Measured; 2], poses: &DMatrix<f64>) -> Matrix3<f64> {
    let local = match [&a.photos, &b.photos] {
        [Some(first), Some(second)] => first.pose_covariance(second, poses),
        _ => Matrix3::zeros(),
    };
    let between = a.face_from_world.transpose() * local * b.face_from_world;
    without_negative(&(a.of_poses + b.of_poses - between - between.transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::estimate::by_field;
    use crate::registration::adjustment::observation::NormalEquations;
    use crate::registration::adjustment::stone_vector::StoneVector;
    use nalgebra::{Matrix6, Rotation3, Vector6};
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
        let observed: [Matrix6<f64>; 2] = [0, 1].map(|_| Matrix6::from_column_slice(spd(6, 1e6).as_slice()));
        let own: [f64; 6] = std::array::from_fn(|k| 1e-7 * (k + 1) as f64);
        let frames = [[0.3, -0.2, 0.9], [-0.4, 0.1, 0.2]]
            .map(|[r, p, y]| Rotation3::from_euler_angles(r, p, y).into_inner());
        let fields = frames.map(|frame| stone_from_field(&frame));
        // Unknowns: both fields, both own motions.
        let mut normal = DMatrix::<f64>::zeros(30, 30);
        normal.view_mut((0, 0), (18, 18)).copy_from(&prior);
        let motions = [0, 1].map(|i| {
            let mut motion = DMatrix::<f64>::zeros(6, 30);
            motion.view_mut((0, 9 * i), (6, 9)).copy_from(&fields[i]);
            motion.view_mut((0, 18 + 6 * i), (6, 6)).fill_with_identity();
            motion
        });
        for (i, motion) in motions.iter().enumerate() {
            normal += motion.transpose() * observed[i] * motion;
            (0..6).for_each(|k| normal[(18 + 6 * i + k, 18 + 6 * i + k)] += 1.0 / own[k]);
        }
        let inverse = normal.try_inverse().unwrap();
        let expected = &motions[0] * &inverse * motions[1].transpose();
        let expected = frames[0].transpose() * expected.fixed_view::<3, 3>(0, 0) * frames[1];
        let field = Matrix9::from_fn(|r, c| inverse[(r, 9 + c)]);
        let estimates = observed.map(|information| Estimate {
            mean: StoneVector::from(Vector6::zeros()),
            covariance: Matrix6::zeros(),
            relative_covariance: Matrix3::zeros(),
            p_tied: 1.0,
            by_field: by_field(
                &NormalEquations {
                    information,
                    vector: Vector6::zeros(),
                    constant: 0.0,
                },
                &own,
            ),
        });
        let measured = [0, 1].map(|k| Measured {
            estimate: &estimates[k],
            face_from_world: &frames[k],
            photos: None,
            translation: Matrix3::zeros(),
            octave: Matrix3::zeros(),
            least_photo_error: Matrix3::zeros(),
            of_poses: Matrix3::zeros(),
        });
        let found = between([&measured[0], &measured[1]], &field);
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
