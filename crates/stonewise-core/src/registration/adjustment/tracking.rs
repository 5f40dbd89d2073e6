//! Stones tracked in the photos from where the clouds put them.

use super::candidate::{CandidateMotion, Moving};
use super::error::AdjustError;
use super::field::{LEAST_APPEARANCE_M, Prediction, START_APPEARANCE_M, log_odds_of_loose, posterior};
use super::observation::NormalEquations;
use super::observation::photo::{
    CloudMotion, FaceShift, PhotoModel, PhotoReport, StoneInPhotos, StonePhotos,
};
use super::solution::Solution;
use super::state::{Adjustment, StoneState};
use super::stone_vector::StoneVector;
use super::survey::Points;
use crate::registration::photos::{FaceMotion, PhotoSource, PhotoStatus, Track, Tracker};
use crate::registration::points::{PairPoints, PairSource};
use crate::stone::PairResult;
use crate::switches::switchable;
use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3};
use rayon::prelude::*;

/// Rotation of a stone before its points are looked at, radians: ten times what loose stones do.
const OPEN_RAD: f64 = 0.2;
/// Standard deviations of the clouds' place within which a stone is sought.
const SEARCH_SDS: f64 = 3.0;

/// What is known of a stone's rotation before its points are looked at: information, and information times it, about the
/// common motion.
struct Turn {
    information: Matrix3<f64>,
    vector: Vector3<f64>,
}

impl Turn {
    /// Next to nothing.
    fn open() -> Self {
        Self {
            information: Matrix3::identity() * OPEN_RAD.powi(-2),
            vector: Vector3::zeros(),
        }
    }

    /// What the other stones predict of a stone that moves with them.
    fn predicted(prediction: &Prediction, own: &[f64; 6]) -> Option<Self> {
        let own = Matrix3::from_diagonal(&Vector3::new(own[3], own[4], own[5]));
        let covariance = own + prediction.covariance.fixed_view::<3, 3>(3, 3);
        let information = covariance.cholesky()?.inverse();
        Some(Self {
            information,
            vector: information * prediction.mean.fixed_rows::<3>(3),
        })
    }
}

/// The part of the photos in a stone's displacement.
pub(crate) struct PhotoPart<'a> {
    stone: &'a StonePhotos,
    /// Share of the photos in the displacement.
    share: Matrix3<f64>,
}

impl PhotoPart<'_> {
    /// Covariance between two stones' displacements that errors of the poses cause, each stone in its own
    /// frame; with itself, the covariance of one displacement. The stones share these errors, so no number of
    /// stones averages them away.
    ///
    /// `poses`: covariance of the poses' errors.
    pub fn pose_covariance(&self, other: &Self, poses: &DMatrix<f64>) -> Matrix3<f64> {
        let by_photos = self.stone.by_poses.covariance_with(&other.stone.by_poses, poses);
        self.share * by_photos * other.share.transpose()
    }

    /// The unknowns of the poses, and the stone's displacement, in its frame, by each of them.
    pub fn by_poses(&self) -> impl Iterator<Item = (usize, Vector3<f64>)> + '_ {
        let by_photos = self.stone.by_poses.by_unknown();
        by_photos.map(|(unknown, by)| (unknown, self.share * by))
    }

    /// What is left of an error of the points in the stone's displacement, in its frame.
    pub fn share_of_points(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.share
    }

    /// What is left of a covariance of errors of the points in the stone's displacement, in its frame: the
    /// photos share them only through the poses.
    pub fn left_of(&self, of_points: &Matrix3<f64>) -> Matrix3<f64> {
        let rest = self.share_of_points();
        rest * of_points * rest.transpose()
    }

    /// Covariance of the stone's displacement, in its frame, that the least appearance bias causes.
    pub fn least_error(&self) -> Matrix3<f64> {
        let variance = LEAST_APPEARANCE_M.powi(2) * self.stone.bias_factor;
        let bias = Matrix3::from_diagonal(&Vector3::new(variance, variance, 0.0));
        self.share * bias * self.share.transpose()
    }
}

impl Adjustment {
    /// Tracks every stone, batch by batch.
    pub fn track<S: PairSource>(
        &mut self,
        points: &Points<S>,
        photos: &dyn PhotoSource<S::Error>,
    ) -> Result<(), AdjustError<S::Error>> {
        let mut tracks: Vec<Track> = Vec::with_capacity(self.stones.len());
        let surroundings = self.surroundings();
        let progress = points.progress;
        progress.begin("track stones in photos", self.stones.len() as u64);

        // One batch at a time: its stones' parts of photos need more memory than its points.
        for (batch, range) in points.batches.iter().enumerate() {
            let chips = photos.load(batch).map_err(AdjustError::Source)?;
            debug_assert_eq!(chips.len(), range.len());
            let track = |i: usize, pair: &PairPoints| {
                let search_m = self.search_m(i, photos);
                let from = |start: FaceMotion| {
                    let tracker = Tracker {
                        pair,
                        face_from_world: &self.prior.graph.nodes[i].face_from_world,
                        start,
                        search_m,
                        photos: photos.photos(),
                        chips: &chips[i - range.start],
                        params: photos.params(),
                        picture_px: photos.picture_px(),
                    };
                    tracker.track()
                };
                let own = self.face_motion(i);
                let elsewhere = self.starts_elsewhere(i, &own, surroundings[i], search_m);
                Track::best_of(from(own), elsewhere.into_iter().map(from))
            };
            let found = points.of_stones(&[batch], |_| true, track)?;
            tracks.extend(found.into_iter().map(|(_, track)| track));
            progress.advance(range.len() as u64);
        }

        for (i, track) in tracks.iter().enumerate() {
            let found = track.start.translation;
            let reach_m = self.search_m(i, photos).max(self.params.max_step_m);
            let is_far = (found - self.face_motion(i).translation).norm() > reach_m;
            if track.status == PhotoStatus::Tracked && is_far {
                self.put(i, StoneVector::from_translation(found));
            }
        }

        let stones = self.stones_in_photos(|i| tracks[i].place, |_| None);
        self.photos = Some(PhotoModel::new(
            photos.params().clone(),
            photos.photos(),
            &stones,
            tracks,
        ));
        self.prior.components.appearance_m = Some(START_APPEARANCE_M);
        Ok(())
    }

    /// Adjusts the photos' poses to where the clouds now put the stones; the weights of the stones' biases
    /// follow from the last solution.
    pub fn update_photos(&mut self, last: Option<&Solution>) {
        let Some(mut photos) = self.photos.take() else {
            return;
        };
        let own = self.prior.own_variances();
        let turn = |i: usize| {
            let prediction = &last?.field.from_others[i];
            (self.stones[i].moving() == Moving::WithField).then(|| Turn::predicted(prediction, &own))?
        };
        let stones = self.stones_in_photos(|i| photos.place(i), turn);
        let lengths = (self.step_m().unwrap_or(f64::INFINITY), self.octaves());
        photos.update(&stones, self.prior.components.appearance_m(), lengths);
        if let Some(solution) = last {
            let shared = self.shared_variances(1.0);
            photos.weigh(|i, stone, moving| {
                let (expected, covariance) = self.motion_without_photos(i, moving, solution, &shared);
                stone.bias_square(
                    self.prior.components.appearance_m(),
                    moving,
                    &expected,
                    &covariance,
                )
            });
        }
        self.photos = Some(photos);
    }

    /// A stone's motion from its points and the other stones, and its covariance.
    fn motion_without_photos(
        &self,
        i: usize,
        moving: Moving,
        solution: &Solution,
        shared: &[f64; 6],
    ) -> (StoneVector, Matrix6<f64>) {
        let stone = &self.stones[i];
        let (candidate, own) = match moving {
            Moving::WithField => (&stone.with_field, self.prior.own_variances()),
            Moving::OnOwn => (
                stone.on_own.as_ref().unwrap_or(&stone.with_field),
                self.prior.loose_variances(),
            ),
        };
        let own = std::array::from_fn(|k| own[k] + shared[k]);
        let equations = self.observed_by_clouds(i, candidate, self.prior.components.error_m);
        let known = posterior(&equations, &solution.field.from_others[i], &own);
        (known.mean + self.prior.common_in(i), known.covariance)
    }

    /// What the stones' own points say, moving with the field.
    pub fn cloud_equations(&self, error_m: f64) -> Vec<NormalEquations> {
        let stones = self.stones.par_iter().enumerate();
        stones
            .map(|(i, s)| self.observed_by_clouds(i, &s.with_field, error_m))
            .collect()
    }

    /// How far a stone that moves with the field may have slid in the face without being found out, metres:
    /// what passes for an error of the clouds may be a slide, and so may what passes for an appearance bias;
    /// it is both where both are there.
    pub fn undetected_slide_m(&self, i: usize) -> f64 {
        switchable!("slide", 0.0);
        let error_m = self.prior.components.error_m;
        match self.photos.as_ref().and_then(|p| p.stone(i)) {
            Some(photos) => {
                error_m.min(photos.bias_sd_m(self.prior.components.appearance_m(), Moving::WithField))
            }
            None => error_m,
        }
    }

    /// The part of the photos in a stone's displacement; `None` where they show nothing of it, or where
    /// neither photos nor points determine it.
    pub fn photo_part(&self, i: usize) -> Option<PhotoPart<'_>> {
        let stone = self.photos.as_ref()?.stone(i)?;
        let (information, _, _) =
            stone.with_bias(self.prior.components.appearance_m(), self.stones[i].moving());
        let by_clouds = self
            .cloud_motion(i, [0.0; 2])
            .and_then(|c| c.covariance.try_inverse())
            .unwrap_or_else(Matrix3::zeros);
        let share = (by_clouds + information).try_inverse()? * information;
        Some(PhotoPart { stone, share })
    }

    /// Whether a stone's photos alone make it more probable that it is loose than that it moves as
    /// `prediction` says.
    pub fn photos_show_own_motion(&self, i: usize, prediction: &Prediction) -> bool {
        let own = [self.prior.own_variances(), self.prior.loose_variances()];
        let [with_field, on_own] =
            [Moving::WithField, Moving::OnOwn].map(|moving| self.observed_by_photos(i, moving));
        with_field.zip(on_own).is_some_and(|(with_field, on_own)| {
            log_odds_of_loose([&with_field, &on_own], prediction, &own, self.prior.loose.share) > 0.0
        })
    }

    /// What photos contributed; `results`: of all stones, in their order.
    pub fn photo_report(&self, results: &[PairResult]) -> Option<PhotoReport> {
        let photos = self.photos.as_ref()?;
        let moving: Vec<Moving> = self.stones.iter().map(StoneState::moving).collect();
        let mut report = photos.report(self.prior.components.appearance_m(), &moving);
        for (i, evidence) in report.evidence.iter_mut().enumerate() {
            if let Some(evidence) = evidence {
                evidence.clouds = self.shift_by_clouds(i, evidence.place);
                let motion = results.get(i).and_then(|r| r.motion.as_ref().ok());
                let face_from_world = &self.prior.graph.nodes[i].face_from_world;
                evidence.both = motion.and_then(|m| FaceShift::of_motion(m, face_from_world, evidence.place));
            }
        }
        Some(report)
    }

    /// `turn`: what is known of a stone's rotation; `None`: nothing.
    fn stones_in_photos(
        &self,
        place: impl Fn(usize) -> [f64; 2] + Sync,
        turn: impl Fn(usize) -> Option<Turn> + Sync,
    ) -> Vec<StoneInPhotos> {
        let of_stone = |(i, node): (usize, &super::field::Node)| StoneInPhotos {
            centroid: node.centroid,
            face_from_world: node.face_from_world,
            clouds: self.cloud_motion_about(
                i,
                &self.stones[i].with_field,
                place(i),
                &turn(i).unwrap_or_else(Turn::open),
            ),
        };
        self.prior
            .graph
            .nodes
            .par_iter()
            .enumerate()
            .map(of_stone)
            .collect()
    }

    /// The displacement in the face by the stone's own points alone, about the motion that it more probably
    /// made.
    fn shift_by_clouds(&self, i: usize, place: [f64; 2]) -> Option<FaceShift> {
        let by_clouds = self.cloud_motion_about(i, self.stones[i].more_probable(), place, &Turn::open())?;
        let covariance = by_clouds.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        FaceShift::new(&by_clouds.mean.xy(), &covariance)
    }

    /// The displacement of a place on a stone's face by its own points alone; `None` where they show none.
    pub fn cloud_motion(&self, i: usize, place: [f64; 2]) -> Option<CloudMotion> {
        self.cloud_motion_about(i, &self.stones[i].with_field, place, &Turn::open())
    }

    /// The displacement about one of the stone's motions.
    fn cloud_motion_about(
        &self,
        i: usize,
        candidate: &CandidateMotion,
        place: [f64; 2],
        turn: &Turn,
    ) -> Option<CloudMotion> {
        let equations = self.observed_by_clouds(i, candidate, self.prior.components.error_m);
        if equations.information.trace() <= 0.0 {
            return None;
        }
        let shift = self.prior.loose.move_m.max(self.params.max_sd_m).powi(-2);
        let (mut information, mut vector) = (equations.information, equations.vector);
        (0..3).for_each(|k| information[(k, k)] += shift);
        let mut rest = information.fixed_view_mut::<3, 3>(3, 3);
        rest += turn.information;
        let mut rest = vector.fixed_rows_mut::<3>(3);
        rest += turn.vector;
        let inverse = information.cholesky()?.inverse();
        let lever = StonePhotos::lever(place);
        let mean: Vector3<f64> = lever * (inverse * vector + self.prior.common_in(i).unknowns());
        let covariance = lever * inverse * lever.transpose();
        Some(CloudMotion {
            mean,
            covariance: 0.5 * (covariance + covariance.transpose()),
        })
    }

    /// Motions beside its own from which a stone is sought: those that in the face are the motion of its
    /// surroundings, of the wall as a whole and of the masks' centroids, each unless a search from one before
    /// reaches it. Out of the face the clouds alone measure it.
    fn starts_elsewhere(
        &self,
        i: usize,
        own: &FaceMotion,
        surroundings: [Vector3<f64>; 2],
        search_m: f64,
    ) -> Vec<FaceMotion> {
        let frame = &self.prior.graph.nodes[i].face_from_world;
        let mut starts = vec![*own];
        let [around, of_wall] = surroundings.map(|moved| frame * moved);
        for moved in [around, of_wall, self.stones[i].start] {
            let is_new = |s: &FaceMotion| (s.translation - moved).xy().norm() > search_m;
            if starts.iter().all(is_new) {
                starts.push(FaceMotion {
                    translation: Vector3::new(moved.x, moved.y, own.translation.z),
                    ..*own
                });
            }
        }
        starts.split_off(1)
    }

    fn face_motion(&self, i: usize) -> FaceMotion {
        let motion: &StoneVector = &self.stones[i].more_probable().motion;
        FaceMotion {
            translation: motion.translation(),
            rotation: motion.rotation(),
        }
    }

    fn search_m<E>(&self, i: usize, photos: &dyn PhotoSource<E>) -> f64 {
        let params = photos.params();
        let sd = self.cloud_motion(i, [0.0; 2]).map_or(params.max_search_m, |c| {
            c.covariance[(0, 0)].max(c.covariance[(1, 1)]).sqrt()
        });
        (params.search_m + SEARCH_SDS * sd).min(params.max_search_m)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{begun, wall};
    use super::*;
    use crate::registration::points::MemoryPairs;
    use nalgebra::Vector6;

    #[test]
    fn a_predicted_turn_weighs_in_a_displacement_as_in_the_posterior_of_the_whole_motion() {
        let source = MemoryPairs::new(wall(5, [0.001; 2], |k| {
            Vector3::new(0.0, 1e-4 * f64::from(k), 0.0)
        }));
        let (mut adjustment, points) = begun(&source);
        adjustment.estimate_noise(&points.sample);
        adjustment.evaluate(&points).unwrap();
        let own = adjustment.prior.own_variances();
        let shift_m = adjustment.prior.loose.move_m.max(adjustment.params.max_sd_m);
        let rotation = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0) * 1e-8;
        let mut covariance = Matrix6::identity() * (shift_m * shift_m);
        covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
        let prediction = Prediction {
            mean: Vector6::new(0.0, 0.0, 0.0, 2e-3, -1e-3, 3e-3),
            covariance,
        };

        for i in [3, 20] {
            let candidate = &adjustment.stones[i].with_field;
            let equations = adjustment.observed_by_clouds(i, candidate, adjustment.prior.components.error_m);
            let mut of_turn = own;
            of_turn[..3].fill(0.0);
            let whole = posterior(&equations, &prediction, &of_turn);
            let expected = whole.mean.translation() + adjustment.prior.common_in(i).translation();
            let spread = whole.covariance.fixed_view::<3, 3>(0, 0).into_owned();

            let about = |turn: &Turn| {
                adjustment
                    .cloud_motion_about(i, candidate, [0.0; 2], turn)
                    .unwrap()
            };
            let found = about(&Turn::predicted(&prediction, &own).unwrap());
            assert!(
                (found.mean - expected).norm() < 1e-6 * spread.trace().sqrt(),
                "{} {expected}",
                found.mean
            );
            assert!((found.covariance - spread).norm() < 1e-5 * spread.norm());
            // The prediction reduces the variance.
            let open = about(&Turn::open());
            assert!(found.covariance.trace() < open.covariance.trace());
        }
    }
}
