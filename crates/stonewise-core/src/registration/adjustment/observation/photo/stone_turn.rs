//! The turn of a stone in its face, as its photos show it.

use super::poses::{PoseProblem, PoseStone, Poses};
use crate::registration::adjustment::observation::normal_equations::NormalEquations;
use crate::registration::adjustment::stone_vector::StoneVector;
use crate::registration::photos::turn_by_rotation;
use nalgebra::{Matrix6, RowVector3, RowVector6};

/// Ratio of the bias of a turn to (bias of the shift / radius of the face). Parts of a face that are biased
/// independently of each other would make it one; changes on a stone are correlated over longer distances. With
/// two, 96 to 98 of 100 turns of stones that were not loose lie within 1.96 standard deviations on `dam_small`
/// and on each of three simulated walls (521 stones); with one 82 to 87.
const BIAS_OF_TURN: f64 = 2.0;

/// How far a stone's picture turned between the epochs, from the axis along to the axis up.
#[derive(Clone, Debug)]
pub(crate) struct StoneTurn {
    /// Radians.
    pub angle: f64,
    /// Variance that errors of the matches cause, rad^2.
    pub variance: f64,
    /// Derivative of the angle with respect to the stone's rotation vector.
    pub by_rotation: RowVector3<f64>,
    /// Root mean square distance of the face from its middle, metres.
    pub radius_m: f64,
}

/// Sum of weighted turns in one epoch.
#[derive(Clone, Copy)]
struct Sum {
    weight: f64,
    angle: f64,
    by_rotation: RowVector3<f64>,
}

impl PoseProblem<'_> {
    /// The turn of a stone between the epochs, poses adjusted; `None` where no photo of an epoch shows one.
    ///
    /// Errors that shift the parts of a face independently of each other turn it by their shift over its
    /// radius, so a sight's turn has the variance of its shift over the squared radius.
    pub fn turn(&self, stone: &PoseStone, weights: &[f64], poses: &Poses) -> Option<StoneTurn> {
        let radius_m = stone.track.radius_m;
        let nothing = Sum {
            weight: 0.0,
            angle: 0.0,
            by_rotation: RowVector3::zeros(),
        };
        let mut sums = [nothing; 2];
        for (sight, w) in stone.track.sights.iter().zip(weights) {
            let Some(turn) = sight.turn else { continue };
            let by_rotation = turn_by_rotation(sight.parallax);
            let rows_px = self.rows_px(sight.photo, poses).unwrap_or_default();
            let of_pose = by_rotation * stone.face_from_world * self.rotation(sight.photo, poses)
                + sight.by_rows.turn * rows_px;
            let shift_m2 = 0.5 * self.weight(sight, poses.scatter.factor).try_inverse()?.trace();
            let weight = w * radius_m * radius_m / shift_m2;
            let sum = &mut sums[self.epochs[sight.photo]];
            sum.weight += weight;
            sum.angle += weight * (turn - of_pose.x);
            sum.by_rotation += weight * by_rotation;
        }
        let [first, second] = sums;
        (first.weight > 0.0 && second.weight > 0.0).then(|| StoneTurn {
            angle: second.angle / second.weight - first.angle / first.weight,
            variance: first.weight.recip() + second.weight.recip(),
            by_rotation: second.by_rotation / second.weight,
            radius_m,
        })
    }
}

impl StoneTurn {
    fn lever(&self) -> RowVector6<f64> {
        let mut lever = RowVector6::zeros();
        lever.fixed_view_mut::<1, 3>(0, 3).copy_from(&self.by_rotation);
        lever
    }

    /// Variance of the turn that a bias of the shift with this standard deviation causes, rad^2.
    fn bias_variance(&self, bias_sd_m: f64) -> f64 {
        (BIAS_OF_TURN * bias_sd_m / self.radius_m).powi(2)
    }

    /// Standard deviation of the turn with that bias, radians.
    pub fn sd(&self, bias_sd_m: f64) -> f64 {
        (self.variance + self.bias_variance(bias_sd_m)).sqrt()
    }

    /// Log likelihood as a quadratic about the motion `origin`, for this standard deviation of the appearance
    /// bias. The constant holds what depends on the bias.
    pub fn normal_equations(&self, origin: &StoneVector, bias_sd_m: f64) -> NormalEquations {
        let bias = self.bias_variance(bias_sd_m);
        let information = (self.variance + bias).recip();
        let lever = self.lever();
        let apart = self.angle - (lever * origin.unknowns()).x;
        NormalEquations {
            information: lever.transpose() * information * lever,
            vector: lever.transpose() * (information * apart),
            constant: -0.5 * ((1.0 + bias / self.variance).ln() + information * apart * apart),
        }
    }

    /// Expected square of the bias over its variance before it is weighted, given the motion
    /// `expected` from all other observations, with this covariance; `bias_sd_m`: standard deviation of the
    /// bias before it is weighted, metres.
    pub fn bias_square(
        &self,
        bias_sd_m: f64,
        weight: f64,
        expected: &StoneVector,
        covariance: &Matrix6<f64>,
    ) -> f64 {
        let lever = self.lever();
        let shown = self.angle - (lever * expected.unknowns()).x;
        let variance = self.variance + (lever * covariance * lever.transpose()).x;
        let prior = self.bias_variance(bias_sd_m);
        let spread = (variance.recip() + weight / prior).recip();
        let bias = spread * shown / variance;
        (bias * bias + spread) / prior
    }
}

#[cfg(test)]
mod tests {
    use super::super::poses::{CloudMotion, Scatter};
    use super::*;
    use crate::geometry::{Camera, FaceFrame, Rigid3, View};
    use crate::id::ImageId;
    use crate::registration::photos::{FaceMotion, Photo, PhotoStatus, Sight, Track};
    use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Point3, Vector2, Vector3, Vector6};

    const CENTRES: [[f64; 3]; 4] = [
        [6.0, -2.0, 0.5],
        [7.0, 1.0, 1.0],
        [6.5, 0.0, -1.0],
        [7.0, 2.0, 0.0],
    ];

    fn sight(photo: usize, at: &Point3<f64>, turn_to_face: &Matrix3<f64>) -> Sight {
        let centre = Point3::from(CENTRES[photo]);
        let look = Rigid3::face_towards(&centre, &Point3::new(0.0, 0.3, -0.5), &Vector3::z()).inverse();
        let camera = Photo {
            name: String::new(),
            epoch: 0,
            camera: Box::new(View {
                image: ImageId(0),
                name: String::new(),
                camera: Camera::pinhole(2000, 1500, 2000.0),
                cam_from_world: look,
            }),
        };
        Sight {
            photo,
            shift: Vector2::zeros(),
            covariance: Matrix2::identity() * 1e-8,
            turn: Some(0.0),
            parallax: camera.parallax(at, turn_to_face).unwrap(),
            by_rows: camera.by_rows(at, turn_to_face).unwrap(),
            correlation: 0.9,
        }
    }

    fn track(sights: Vec<Sight>, place: [f64; 2]) -> Track {
        Track {
            likeness: 10.0,
            status: PhotoStatus::Tracked,
            sights,
            place,
            radius_m: 0.1,
            apart_m: [0.0; 2],
            start: FaceMotion::none(),
            pictures: None,
        }
    }

    fn stone<'a>(track: &'a Track, at: &Point3<f64>, turn_to_face: &'a Matrix3<f64>) -> PoseStone<'a> {
        PoseStone {
            track,
            centroid: *at,
            face_from_world: turn_to_face,
            clouds: CloudMotion {
                mean: Vector3::zeros(),
                covariance: Matrix3::identity(),
            },
        }
    }

    /// Corrections of four photos' own unknowns and of those that they share; `rows` scales those that shift
    /// rows, `pose` scales all others.
    fn poses(pose: f64, rows: f64) -> Poses {
        let count = problem(&[Point3::origin(); 4], Point3::origin()).unknowns();
        let correction = |k: usize| {
            let is_of_rows = (k < 32 && k % 8 >= 6) || k >= count - 4;
            if is_of_rows {
                rows * (((k * 5) % 7) as f64 - 3.0)
            } else {
                pose * (((k * 7) % 11) as f64 - 5.0)
            }
        };
        Poses {
            corrections: DVector::from_fn(count, |k, _| correction(k)),
            covariance: DMatrix::zeros(count, count),
            scatter: Scatter {
                factor: 1.0,
                rows_px: [1.0; 2],
            },
            weights: vec![vec![1.0; 4]],
            trust: vec![1.0],
        }
    }

    /// Two photos an epoch at `centres`.
    fn problem(centres: &[Point3<f64>], middle: Point3<f64>) -> PoseProblem<'_> {
        PoseProblem {
            centres,
            epochs: &[0, 0, 1, 1],
            scales: &[[0.003, 6.0]; 4],
            pose_error_px: 0.5,
            rolling_shutter: true,
            stones: Vec::new(),
            middle,
            extent_m: 2.0,
        }
    }

    /// Error of the turn of a stone that turned by 4 mrad, and the turn of the last photo.
    fn error(poses: &Poses) -> [f64; 2] {
        let turn_to_face = FaceFrame::from_normal(&Vector3::new(0.9, 0.1, 0.3)).face_from_world();
        let centres = CENTRES.map(Point3::from);
        let centroid = Point3::new(0.1, -0.3, 0.4);
        let problem = problem(&centres, Point3::new(0.0, 0.0, 1.0));
        // Differences of the shifts over the face, whose antisymmetric part is the turn.
        let by_shifts = |photo: usize| {
            let shift = |place: [f64; 2]| {
                let at = centroid + turn_to_face.transpose() * Vector3::new(place[0], place[1], 0.0);
                let track = track(Vec::new(), place);
                // The sight has no shift: what the poses make of it is missing.
                -problem.residual(
                    &stone(&track, &centroid, &turn_to_face),
                    &sight(photo, &at, &turn_to_face),
                    &Vector6::zeros(),
                    &poses.scatter,
                    &poses.corrections,
                )
            };
            let step = 1e-4;
            let along = shift([step, 0.0]) - shift([-step, 0.0]);
            let up = shift([0.0, step]) - shift([0.0, -step]);
            (along.y - up.x) / (4.0 * step)
        };
        // The second epoch's faces turned by 4 mrad beside that.
        let sights = (0..4).map(|photo| Sight {
            turn: Some(by_shifts(photo) + if photo < 2 { 0.0 } else { 0.004 }),
            ..sight(photo, &centroid, &turn_to_face)
        });
        let track = track(sights.collect(), [0.0; 2]);
        let stone = stone(&track, &centroid, &turn_to_face);
        let found = problem.turn(&stone, &[1.0; 4], poses).unwrap();
        [found.angle - 0.004, by_shifts(3)]
    }

    #[test]
    fn the_turn_by_a_pose_is_that_of_the_shifts_by_it_and_is_taken_off() {
        let [error_of_poses, turn] = error(&poses(1.0, 0.0));
        assert!(
            turn.abs() > 1e-3 && error_of_poses.abs() < 1e-7,
            "{turn} {error_of_poses}"
        );
        // `by_rows.turn` neglects that the size of a pixel changes over an oblique face.
        let [error_of_rows, turn] = error(&poses(0.0, 0.1));
        assert!(
            turn.abs() > 1e-4 && error_of_rows.abs() < 0.15 * turn.abs(),
            "{turn} {error_of_rows}"
        );
    }

    #[test]
    fn a_turn_is_as_uncertain_as_shifts_of_the_parts_of_a_face() {
        // Four sights of 0.1 mm and a floor of 0.06 mm each, at a radius of 10 cm, two in each epoch.
        let centres = CENTRES.map(Point3::from);
        let turn_to_face = FaceFrame::from_normal(&Vector3::x()).face_from_world();
        let at = Point3::origin();
        let track = track((0..4).map(|p| sight(p, &at, &turn_to_face)).collect(), [0.0; 2]);
        let problem = problem(&centres, at);
        let stone = stone(&track, &at, &turn_to_face);
        let found = problem.turn(&stone, &[1.0; 4], &poses(0.0, 0.0)).unwrap();
        let expected = (1e-8 + 3.6e-9) / 0.01;
        assert!(
            (found.variance - expected).abs() < 1e-9 * expected,
            "{}",
            found.variance
        );
        // Without sights of one epoch there is none.
        assert!(
            problem
                .turn(&stone, &[0.0, 0.0, 1.0, 1.0], &poses(0.0, 0.0))
                .is_none()
        );
    }
}
