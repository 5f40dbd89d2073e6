//! Errors that the points of a stone share with those of its neighbours, over octaves of length, as the motions
//! show them.

use super::state::Adjustment;
use super::tracking::PhotoPart;
use crate::geometry::SmallMotion;
use crate::statistics::{UPPER_95, component_median, quantile};
use crate::switches::switchable;
use nalgebra::{DMatrix, Matrix3, MatrixXx3, Point3, Vector3};
use statrs::distribution::{ContinuousCDF, Normal};

/// Share of the stones by which the scatter of their motions is measured.
const HELD: f64 = 0.95;
/// Stones that stand for errors as large as expected before those of the survey count: as many as a rigid motion
/// has unknowns.
const PRIOR_STONES: f64 = 6.0;

/// Errors that points share beyond what the cells of a stone show, in the frame of any stone.
///
/// How large an octave is follows from heights, and so from errors out of the face. Errors of a cloud that was computed
/// from photos lie along its rays, so that those in the face are much smaller, and what photos measure takes little
/// part in them. How much smaller, the motions themselves show: whatever stones do, their motions scatter at least as
/// much as their errors. The variances on each axis are therefore no larger than the motions allow.
#[derive(Clone, Copy)]
pub(super) struct Octaves {
    /// Variance of one octave on any axis as heights show it, m^2.
    expected_m2: f64,
    /// Number of octaves from the distance of neighbours to the wall.
    count: f64,
    /// Variance out of the face of what the points of a stone share with no other, m^2.
    of_stone_m2: f64,
    /// Factor on the variance along, up and out that the motions show, at most one.
    shown: Vector3<f64>,
    /// The same, if the errors of the poses that follow errors of the points explain nothing of the motions.
    shown_at_most: Vector3<f64>,
}

/// A motion by which the errors are measured.
pub(super) struct Shown {
    /// Where, world, metres.
    pub place: Point3<f64>,
    /// World, metres.
    pub displacement: Vector3<f64>,
    pub face_from_world: Matrix3<f64>,
    /// Expected variances of the errors along, up and out, m^2.
    pub expected_m2: Vector3<f64>,
}

impl Octaves {
    /// The octaves that heights alone show: alike on all axes.
    fn expected(adjustment: &Adjustment) -> Self {
        let one = adjustment.shared_variances(1.0);
        Self {
            expected_m2: one[0],
            count: adjustment.octaves(),
            of_stone_m2: one[2] - one[0],
            shown: Vector3::repeat(1.0),
            shown_at_most: Vector3::repeat(1.0),
        }
    }

    /// The octaves as large as the motions of stones that are not loose allow. `displacement`: of a stone in its frame.
    pub fn of(adjustment: &Adjustment, displacement: impl Fn(usize) -> Option<Vector3<f64>>) -> Self {
        let expected = Self::expected(adjustment);
        switchable!("octaves_shown", expected);
        let free_rotation = adjustment.params.free_rotation;
        // The fitted rigid motion absorbs the longest octave, so the residuals do not show it.
        let absorbed = f64::from(u8::from(free_rotation));
        let scattered = Self {
            count: (expected.count - absorbed).max(1.0),
            ..expected
        };
        let parts: Vec<Option<PhotoPart>> = (0..adjustment.stones.len())
            .map(|i| adjustment.photo_part(i))
            .collect();
        let of_motions = |by_poses: Option<&ByPoses>| {
            let motion = |i: usize| {
                let node = &adjustment.prior.graph.nodes[i];
                let face_from_world = node.face_from_world;
                let part = parts[i].as_ref();
                let of_points = scattered.over_all(part).diagonal();
                let by_poses = part.zip(by_poses);
                Some(Shown {
                    place: node.centroid,
                    displacement: face_from_world.transpose() * displacement(i)?,
                    face_from_world,
                    expected_m2: by_poses.map_or(of_points, |(part, by_poses)| {
                        of_points + by_poses.about_mean(part, &face_from_world)
                    }),
                })
            };
            let motions: Vec<Shown> = (0..adjustment.stones.len()).filter_map(motion).collect();
            shown(&motions, &common(&motions, free_rotation))
        };
        let shown_at_most = of_motions(None);
        let by_poses = ByPoses::of(adjustment, &parts, &expected.one().diagonal());
        Self {
            shown: by_poses.map_or(shown_at_most, |by| of_motions(Some(&by))),
            shown_at_most,
            ..expected
        }
    }

    /// Upper bound of the octaves: as large as the motions allow without the errors of the poses. The number of patches
    /// of a wall with independent errors is not known, so the test of its shape uses this bound.
    pub fn at_most(&self) -> Self {
        Self {
            shown: self.shown_at_most,
            ..*self
        }
    }

    /// Covariance of one octave.
    pub fn one(&self) -> Matrix3<f64> {
        self.shown(&(Matrix3::identity() * self.expected_m2))
    }

    /// Covariance of what the points of a stone share with no other.
    pub fn of_stone(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, self.of_stone_m2))
    }

    /// Covariance over all octaves, against the other epoch; `photos`: their part in the motion.
    ///
    /// Photos share the errors of the points only through the poses, and over one octave: an error over the length of
    /// a stone (of a mask, or from a stain) affects photos and points alike. Light shifts neighbours alike, so that the
    /// least bias of appearance is shared over all octaves, too.
    pub fn over_all(&self, photos: Option<&PhotoPart>) -> Matrix3<f64> {
        let octaves = |count: f64| Matrix3::identity() * (count * self.expected_m2);
        self.shown(&match photos {
            Some(photos) => {
                octaves(1.0) + photos.left_of(&octaves(self.count - 1.0)) + photos.least_error() * self.count
            }
            None => octaves(self.count),
        })
    }

    /// Covariance of the errors of the photos' poses, including those caused by errors of the points; an empty matrix
    /// where no photos are used.
    pub fn of_poses(&self, adjustment: &Adjustment) -> DMatrix<f64> {
        let photos = adjustment.photos.as_ref();
        photos.map_or_else(|| DMatrix::zeros(0, 0), |p| p.of_poses(&self.one().diagonal()))
    }

    /// What the motions show of a covariance of such errors.
    pub fn shown(&self, expected: &Matrix3<f64>) -> Matrix3<f64> {
        let root = Matrix3::from_diagonal(&self.shown.map(f64::sqrt));
        root * expected * root
    }
}

/// Errors of the poses that follow errors of the points: in the stones' displacements and in the mean of these.
struct ByPoses {
    /// Covariance of the poses' errors.
    poses: DMatrix<f64>,
    /// Covariance of these errors with the mean displacement, world.
    with_mean: MatrixXx3<f64>,
    /// Covariance of the mean displacement, world.
    of_mean: Matrix3<f64>,
}

impl ByPoses {
    /// `None` where photos take no part. `parts`: of the stones; `octave_m2`: variances of one octave along, up, out.
    fn of(adjustment: &Adjustment, parts: &[Option<PhotoPart>], octave_m2: &Vector3<f64>) -> Option<Self> {
        let poses = adjustment.photos.as_ref()?.by_octaves(octave_m2);
        let mut mean = MatrixXx3::zeros(poses.nrows());
        let mut count: f64 = 0.0;
        for (node, part) in adjustment.prior.graph.nodes.iter().zip(parts) {
            let Some(part) = part else {
                continue;
            };
            count += 1.0;
            for (unknown, by) in part.by_poses() {
                let mut row = mean.row_mut(unknown);
                row += (node.face_from_world.transpose() * by).transpose();
            }
        }
        mean /= count.max(1.0);
        let with_mean = &poses * &mean;
        Some(Self {
            of_mean: mean.transpose() * &with_mean,
            poses,
            with_mean,
        })
    }

    /// Variances of a stone's displacement about the mean, in its frame.
    fn about_mean(&self, part: &PhotoPart, face_from_world: &Matrix3<f64>) -> Vector3<f64> {
        let with_mean = part
            .by_poses()
            .map(|(unknown, by)| by * self.with_mean.row(unknown));
        let with_mean = with_mean.sum::<Matrix3<f64>>() * face_from_world.transpose();
        let of_mean = face_from_world * self.of_mean * face_from_world.transpose();
        (part.pose_covariance(part, &self.poses) - with_mean - with_mean.transpose() + of_mean).diagonal()
    }
}

/// The motion that most stones have in common: a translation, or a rigid motion where epochs may be turned against each
/// other.
fn common(motions: &[Shown], free_rotation: bool) -> SmallMotion {
    let rigid = || SmallMotion::common(motions.iter().map(|m| (m.place, m.displacement)));
    free_rotation.then(rigid).flatten().unwrap_or_else(|| {
        let displacements: Vec<Vector3<f64>> = motions.iter().map(|m| m.displacement).collect();
        SmallMotion::shift(component_median(&displacements))
    })
}

/// Factors on the expected variances of errors, per axis of the face, with which normal errors hold 95 % of the
/// motions about the common one; at most one.
///
/// A median and a quantile: stones that moved on their own do not matter as long as they are few, and if they are
/// many the factor is too large, but never more than one.
fn shown(motions: &[Shown], common: &SmallMotion) -> Vector3<f64> {
    let limit = Normal::standard().inverse_cdf(UPPER_95);
    Vector3::from_fn(|axis, _| {
        let apart = |m: &Shown| {
            let apart = m
                .face_from_world
                .row(axis)
                .transpose()
                .dot(&(m.displacement - common.at(&m.place)));
            let sd = m.expected_m2[axis].sqrt();
            (sd > 0.0).then(|| apart.abs() / sd)
        };
        let mut apart: Vec<f64> = motions.iter().filter_map(apart).collect();
        if apart.is_empty() {
            return 1.0;
        }
        apart.sort_by(f64::total_cmp);
        let count = apart.len() as f64;
        let ratio = (quantile(&apart, HELD) / limit).powi(2);
        ((PRIOR_STONES + count * ratio) / (PRIOR_STONES + count)).min(1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use stonewise_testing::normal;

    /// Stones whose frames turn about the vertical, as on a curved wall, with errors of these standard deviations
    /// along, up and out, where one millimetre is expected, beside a motion of each.
    fn motions(count: usize, sd_m: [f64; 3], moved: impl Fn(usize) -> Vector3<f64>) -> Vec<Shown> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let stone = |i: usize| {
            let face_from_world = Rotation3::from_euler_angles(0.0, 0.0, 0.01 * i as f64).into_inner();
            let error = Vector3::from(sd_m).map(|sd| sd * normal(&mut rng));
            Shown {
                place: Point3::new(0.0, 0.1 * i as f64, (0.7 * i as f64).sin()),
                displacement: face_from_world.transpose() * error + moved(i),
                face_from_world,
                expected_m2: Vector3::repeat(1e-6),
            }
        };
        (0..count).map(stone).collect()
    }

    /// What motions in one frame show.
    fn apart(motions: &[Shown]) -> Vector3<f64> {
        shown(motions, &common(motions, false))
    }

    #[test]
    fn the_scatter_of_a_wall_that_moved_as_one_gives_its_errors_on_each_axis() {
        let sd_m = [2e-4, 1e-4, 7e-4];
        for moved in [Vector3::zeros(), Vector3::new(0.03, -0.02, 0.05)] {
            let found = apart(&motions(2000, sd_m, |_| moved)).map(f64::sqrt);
            for k in 0..3 {
                let by_prior = (6.0 + 2000.0 * (1e3 * sd_m[k]).powi(2)) / 2006.0;
                assert!((found[k] / by_prior.sqrt() - 1.0).abs() < 0.06, "{found}");
            }
        }
    }

    #[test]
    fn a_few_stones_that_moved_change_little_and_many_leave_what_is_expected() {
        let step = |share: usize| {
            move |i: usize| Vector3::new(0.0, 0.0, 0.01) * f64::from(u8::from(i.is_multiple_of(share)))
        };
        let [still, few, many] = [usize::MAX, 50, 4].map(|share| {
            // Stone 0 is in every share.
            apart(&motions(1000, [3e-4; 3], step(share)))
        });
        assert!((few.z / still.z).sqrt() < 1.25, "{still} {few}");
        assert!(many.z > 0.999 && many.x < 0.2, "{many}");
    }

    #[test]
    fn a_turned_epoch_leaves_what_its_errors_show() {
        let sd_m = [2e-4, 1e-4, 7e-4];
        let still = motions(300, sd_m, |_| Vector3::zeros());
        let turn = Vector3::new(4e-4, -3e-4, 6e-4);
        let mut turned = motions(300, sd_m, |_| Vector3::zeros());
        for motion in &mut turned {
            motion.displacement += Vector3::new(0.1, 0.2, -0.3) + turn.cross(&motion.place.coords);
        }
        let found = shown(&turned, &common(&turned, true));
        assert!((found - apart(&still)).norm() < 0.02, "{found} {}", apart(&still));
        assert!(apart(&turned).min() > 0.999);
    }

    #[test]
    fn a_bulge_and_larger_errors_than_expected_leave_what_is_expected() {
        let bulge = |i: usize| Vector3::new(0.0, 0.0, 0.02 * (i as f64 / 60.0).sin());
        assert!(apart(&motions(300, [1e-4; 3], bulge)).z > 0.999);
        assert_eq!(
            apart(&motions(300, [3e-3; 3], |_| Vector3::zeros())),
            Vector3::repeat(1.0)
        );
    }

    #[test]
    fn few_stones_and_no_errors_at_all_leave_what_is_expected() {
        let few = apart(&motions(3, [0.0; 3], |_| Vector3::zeros()));
        assert!((few - Vector3::repeat(6.0 / 9.0)).norm() < 1e-12);
        assert_eq!(apart(&[]), Vector3::repeat(1.0));
        let mut exact = motions(20, [1e-4; 3], |_| Vector3::zeros());
        exact.iter_mut().for_each(|m| m.expected_m2 = Vector3::zeros());
        assert_eq!(apart(&exact), Vector3::repeat(1.0));
    }
}
