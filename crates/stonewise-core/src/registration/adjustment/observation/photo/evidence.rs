//! What clouds and photos say of a stone each by itself, for reports.

use crate::registration::photos::FacePictures;
use crate::stone::StoneMotion;
use nalgebra::{Matrix2, Matrix3, Matrix3x6, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// A displacement along and up the face.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaceShift {
    /// Along, up, metres.
    pub shift_m: [f64; 2],
    /// Its covariance: along along, along up, up up, m^2.
    pub covariance_m2: [f64; 3],
}

impl FaceShift {
    /// The displacement of a place on a stone's face that follows from the stone's motion; `None` where a
    /// number is not finite. `motion` is in the world frame. `place`: along, up, metres from the centroid.
    pub(crate) fn of_motion(
        motion: &StoneMotion,
        face_from_world: &Matrix3<f64>,
        place: [f64; 2],
    ) -> Option<Self> {
        let arm = face_from_world.transpose() * Vector3::new(place[0], place[1], 0.0);
        let shift = face_from_world * (motion.displacement + motion.rotation.cross(&arm));
        let mut lever = Matrix3x6::zeros();
        lever.fixed_view_mut::<3, 3>(0, 0).copy_from(face_from_world);
        let of_rotation = -face_from_world * arm.cross_matrix();
        lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&of_rotation);
        let covariance = lever * motion.covariance * lever.transpose();
        Self::new(&shift.xy(), &covariance.fixed_view::<2, 2>(0, 0).into_owned())
    }

    /// `None` where a number is not finite.
    pub(crate) fn new(shift: &Vector2<f64>, covariance: &Matrix2<f64>) -> Option<Self> {
        let numbers = shift.iter().chain(covariance.iter());
        let is_finite = { numbers }.all(|v| v.is_finite());
        is_finite.then(|| Self {
            shift_m: [shift.x, shift.y],
            covariance_m2: [covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]],
        })
    }
}

/// The displacement that one photo shows of a stone, its pose and the height of the stone's face adjusted.
///
/// Photos of the first epoch show how far they agree with each other about no displacement, those of the
/// second about the displacement that the photos together show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotoShift {
    /// Which of the photos.
    pub photo: usize,
    /// 0: of the first epoch, 1: of the second.
    pub epoch: usize,
    /// The displacement; its covariance is that of the match, from the residuals of all matches.
    #[serde(flatten)]
    pub shift: FaceShift,
    /// Weight of the photo, about one; small where it contradicts the others.
    pub weight: f64,
}

/// What clouds and photos say of a tracked stone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoneEvidence {
    /// The place on the face whose displacement all these are: along, up, metres from the centroid.
    pub place: [f64; 2],
    /// Displacement by the stone's own points alone; `None` where they show none.
    pub clouds: Option<FaceShift>,
    /// Displacement by the photos alone, appearance bias included in its covariance, errors of the poses not.
    pub photos: Option<FaceShift>,
    /// Displacement as adjusted from both and from the neighbours, without errors of the epochs' registration;
    /// `None` where the stone was not measured.
    pub both: Option<FaceShift>,
    /// What each photo shows, in the order of the photos' epochs.
    pub shifts: Vec<PhotoShift>,
    /// What was matched, if pictures were asked for.
    pub pictures: Option<FacePictures>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{FaceFrame, Rigid3};
    use crate::stone::SharedParts;
    use nalgebra::Matrix6;

    #[test]
    fn a_place_moves_with_the_turns_of_its_stone() {
        let face_from_world = FaceFrame::from_normal(&Vector3::new(0.8, 0.5, 0.2)).face_from_world();
        let place = [0.11, -0.07];
        let motion = |displacement: Vector3<f64>, rotation: Vector3<f64>| StoneMotion {
            second_from_first: Rigid3::identity(),
            displacement,
            rotation,
            covariance: Matrix6::from_fn(|r, c| {
                if r == c {
                    1.0 + r as f64
                } else {
                    0.1 * (r + c) as f64
                }
            }),
            shared: SharedParts::default(),
            relative: Vector3::zeros(),
            relative_covariance: Matrix3::zeros(),
            loose: false,
            p_loose: None,
            observability: 1.0,
            rmse_m: 0.0,
        };
        let at = |x: &[f64; 6]| {
            let m = motion(Vector3::new(x[0], x[1], x[2]), Vector3::new(x[3], x[4], x[5]));
            FaceShift::of_motion(&m, &face_from_world, place).unwrap()
        };
        // A turn about the normal takes a place along and up to minus up and along.
        let turn = face_from_world.transpose() * Vector3::new(0.0, 0.0, 0.01);
        let turned = at(&[0.0, 0.0, 0.0, turn.x, turn.y, turn.z]).shift_m;
        assert!(
            (turned[0] - 0.0007).abs() < 1e-12 && (turned[1] - 0.0011).abs() < 1e-12,
            "{turned:?}"
        );
        // The covariance follows from how each of the six numbers moves the place.
        let steps = [0, 1, 2, 3, 4, 5].map(|k| {
            let mut x = [0.0; 6];
            x[k] = 1.0;
            Vector2::from(at(&x).shift_m)
        });
        let covariance = motion(Vector3::zeros(), Vector3::zeros()).covariance;
        let mut expected = Matrix2::zeros();
        for r in 0..6 {
            for c in 0..6 {
                expected += steps[r] * steps[c].transpose() * covariance[(r, c)];
            }
        }
        let [aa, au, uu] = at(&[0.0; 6]).covariance_m2;
        let found = Matrix2::new(aa, au, au, uu);
        assert!(
            (found - expected).norm() < 1e-12 * expected.norm(),
            "{found} {expected}"
        );
    }
}
