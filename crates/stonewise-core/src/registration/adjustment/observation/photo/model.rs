//! All stones' photos as one type of observation.

use super::bias::BiasWeights;
use super::evidence::{FaceShift, PhotoShift, StoneEvidence};
use super::poses::{CloudMotion, PoseProblem, PoseStone};
use super::stone_photos::StonePhotos;
use crate::geometry::Bounds;
use crate::registration::adjustment::candidate::Moving;
use crate::registration::octave_patches::octave_patches;
use crate::registration::photos::{Photo, PhotoParams, PhotoStatus, Track};
use crate::statistics::upper_median;
use nalgebra::{DMatrix, Matrix3, Point3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::array::from_fn;

/// Disagreements of two normalisations that stand for as many more before those of a stone count by
/// themselves.
const PRIOR_DISAGREEMENTS: f64 = 8.0;
/// Components of a disagreement.
const DISAGREEMENTS: f64 = 2.0;
/// Median of the sum of two squared standard normal variables, 2 ln 2.
const MEDIAN_SQUARE: f64 = 2.0 * std::f64::consts::LN_2;
/// Least median of squared disagreements over formal variances, so that a survey without any keeps factors of
/// one.
const LEAST_RATIO: f64 = 1e-6;
/// Distance from the wall where no stone shows one, metres; nothing depends on it then.
const USUAL_DISTANCE_M: f64 = 10.0;

/// What photos show of all stones.
pub(crate) struct PhotoModel {
    params: PhotoParams,
    names: Vec<String>,
    epochs: Vec<usize>,
    centres: Vec<Point3<f64>>,
    scales: Vec<[f64; 2]>,
    tracks: Vec<Track>,
    stones: Vec<Option<StonePhotos>>,
    /// What each photo shows of each stone, with the poses as they are.
    shifts: Vec<Vec<PhotoShift>>,
    factor: f64,
    /// Corrections of the photos' poses.
    poses_px: Vec<f64>,
    /// Shift of each photo's last row relative to its first, pixels; empty if not estimated.
    rows_px: Vec<[f64; 2]>,
    /// Covariance of the poses' errors.
    of_poses: DMatrix<f64>,
    /// Covariances of the right sides of the poses' equations by errors that points share over octaves of length, per
    /// variance of one octave along, up and out of the faces.
    pulled_by_octaves: [DMatrix<f64>; 3],
}

/// A stone as the model needs it.
pub(crate) struct StoneInPhotos {
    pub centroid: Point3<f64>,
    pub face_from_world: Matrix3<f64>,
    /// The displacement of its place on the face by the clouds; `None` where they show none.
    pub clouds: Option<CloudMotion>,
}

/// What the photos contributed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotoReport {
    /// Per stone, in the order of the pairs.
    pub stones: Vec<StonePhotoReport>,
    /// Factor on the formal standard deviations of matches, from their residuals.
    pub sigma_factor: f64,
    /// Scale of a stone's appearance bias between the epochs, metres: of Student's t with eight degrees of
    /// freedom.
    pub appearance_m: f64,
    /// Correction of each photo's pose: name, and root mean square of what it shifts, pixels.
    pub poses_px: Vec<(String, f64)>,
    /// Shift of each photo's last row relative to its first, along the rows and along the columns, pixels, in
    /// the order of `poses_px`; empty if the shift is not estimated.
    pub rows_px: Vec<[f64; 2]>,
    /// What clouds and photos say each by itself, per stone in the order of the pairs; `None` where the stone
    /// is not tracked. Photos are counted as in `poses_px`.
    #[serde(skip)]
    pub evidence: Vec<Option<StoneEvidence>>,
}

/// What the photos say of a stone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StonePhotoReport {
    /// Whether they measure it, or why not.
    pub status: PhotoStatus,
    /// Photos that show it, per epoch.
    pub photos: [usize; 2],
    /// Least correlation of a photo with the template.
    pub correlation: f64,
    /// Displacement along and up the face by the photos alone, metres.
    pub shift_m: Option<[f64; 2]>,
    /// Its standard deviations, appearance bias included, errors of the poses not.
    pub sd_m: Option<[f64; 2]>,
    /// Turn in the face, from the axis along to the axis up, by the photos alone, radians; absent where they
    /// were matched by a shift alone.
    pub turn_rad: Option<f64>,
    /// Its standard deviation, appearance bias included.
    pub turn_sd_rad: Option<f64>,
}

impl PhotoModel {
    /// The model of tracked stones, before the poses are adjusted.
    pub fn new(params: PhotoParams, photos: &[Photo], stones: &[StoneInPhotos], tracks: Vec<Track>) -> Self {
        let centres: Vec<Point3<f64>> = photos.iter().map(|p| p.camera.centre()).collect();
        let scales = (0..photos.len())
            .map(|i| scale(i, photos, stones, &tracks))
            .collect();
        Self {
            params,
            names: photos.iter().map(|p| p.name.clone()).collect(),
            epochs: photos.iter().map(|p| p.epoch).collect(),
            centres,
            scales,
            stones: vec![None; tracks.len()],
            shifts: vec![Vec::new(); tracks.len()],
            tracks,
            factor: 1.0,
            poses_px: vec![0.0; photos.len()],
            rows_px: Vec::new(),
            of_poses: DMatrix::zeros(0, 0),
            pulled_by_octaves: from_fn(|_| DMatrix::zeros(0, 0)),
        }
    }

    /// Photos that show this of all stones.
    #[cfg(test)]
    pub fn showing(stones: Vec<StonePhotos>) -> Self {
        Self {
            stones: stones.into_iter().map(Some).collect(),
            ..Self::new(PhotoParams::default(), &[], &[], Vec::new())
        }
    }

    /// Adjusts the poses to where the clouds put the stones, and takes from the photos what they say with
    /// these poses.
    pub fn update(&mut self, stones: &[StoneInPhotos], bias_m: f64, (step_m, octaves): (f64, f64)) {
        let factors = self.bias_factors();
        let used: Vec<usize> = (0..stones.len())
            .filter(|&i| self.tracks[i].status == PhotoStatus::Tracked && stones[i].clouds.is_some())
            .collect();
        let places = used.iter().map(|&i| stones[i].centroid);
        let Some(bounds) = Bounds::of(places.clone()) else {
            return;
        };
        let problem = PoseProblem {
            centres: &self.centres,
            epochs: &self.epochs,
            scales: &self.scales,
            pose_error_px: self.params.pose_error_px,
            rolling_shutter: self.params.rolling_shutter.unwrap_or(false),
            stones: used
                .iter()
                .filter_map(|&i| {
                    Some(PoseStone {
                        track: &self.tracks[i],
                        centroid: stones[i].centroid,
                        face_from_world: &stones[i].face_from_world,
                        clouds: stones[i].clouds?,
                    })
                })
                .collect(),
            middle: nalgebra::center(&bounds.min, &bounds.max),
            extent_m: (0.5 * (bounds.max - bounds.min).norm()).max(1.0),
        };

        let of_used: Vec<f64> = used.iter().map(|&i| factors[i]).collect();
        let Some(poses) = problem.solve(bias_m, &of_used) else {
            return;
        };
        let of_stone = |(k, &i): (usize, &usize)| {
            let (stone, weights) = (&problem.stones[k], &poses.weights[k]);
            let (information, vector, by_poses) = problem
                .system(stone, weights, &poses.scatter)
                .displacement(&poses)?;
            let found = StonePhotos {
                information,
                vector,
                place: self.tracks[i].place,
                bias_factor: factors[i],
                weights: self.stones[i].as_ref().map_or(BiasWeights::USUAL, |s| s.weights),
                turn: problem.turn(stone, weights, &poses),
                by_poses,
            };
            let shifts = found
                .displacement()
                .and_then(|d| problem.shifts(stone, weights, &poses, &d));
            Some((found, shifts.unwrap_or_default()))
        };
        let of_stones: Vec<Option<(StonePhotos, Vec<PhotoShift>)>> =
            used.par_iter().enumerate().map(of_stone).collect();
        let mut found = vec![None; stones.len()];
        let mut shifts = vec![Vec::new(); stones.len()];
        for (&i, of_used) in used.iter().zip(of_stones) {
            if let Some((photos, of_photos)) = of_used {
                (found[i], shifts[i]) = (Some(photos), of_photos);
            }
        }

        let octaves = octave_patches(places, step_m, octaves);
        self.pulled_by_octaves = problem.pulled_by(&octaves, &poses, bias_m, &of_used);
        let photos = 0..self.centres.len();
        self.poses_px = photos.clone().map(|i| problem.pose_px(i, &poses)).collect();
        self.rows_px = photos
            .filter_map(|i| Some(problem.rows_px(i, &poses)?.into()))
            .collect();
        self.factor = poses.scatter.factor.sqrt();
        self.of_poses = poses.covariance;
        self.stones = found;
        self.shifts = shifts;
    }

    /// What the photos say of a stone.
    pub fn stone(&self, i: usize) -> Option<&StonePhotos> {
        self.stones[i].as_ref()
    }

    /// Gives each stone that photos show the weights of its bias, from the expected square of the bias over
    /// its variance.
    pub fn weigh(&mut self, square: impl Fn(usize, &StonePhotos, Moving) -> f64 + Sync) {
        self.stones.par_iter_mut().enumerate().for_each(|(i, stone)| {
            if let Some(stone) = stone {
                stone.weights =
                    BiasWeights::from_squares(stone.bias_components(), |moving| square(i, stone, moving));
            }
        });
    }

    /// Covariance of the errors of all poses. The poses are adjusted to the clouds and follow the errors of their
    /// points: `octave_m2`, variances of what points share over one octave of length, along, up and out of the faces.
    pub fn of_poses(&self, octave_m2: &Vector3<f64>) -> DMatrix<f64> {
        &self.of_poses + self.by_octaves(octave_m2)
    }

    /// The part of this covariance that errors of the points cause.
    pub fn by_octaves(&self, octave_m2: &Vector3<f64>) -> DMatrix<f64> {
        let [along, up, out] = &self.pulled_by_octaves;
        let pulled = along * octave_m2.x + up * octave_m2.y + out * octave_m2.z;
        &self.of_poses * pulled * &self.of_poses
    }

    /// Place on a stone's face whose displacement its photos show.
    pub fn place(&self, i: usize) -> [f64; 2] {
        self.tracks[i].place
    }

    /// Factors on the variance of the stones' appearance bias, about one for the median stone.
    ///
    /// What changed on a stone leaves residuals in its matches and shifts them: the bias follows their formal
    /// variance. Where two normalisations of contrast disagree by more than is usual for that variance, it is
    /// larger.
    fn bias_factors(&self) -> Vec<f64> {
        let known: Vec<Option<[f64; 2]>> = self.tracks.iter().map(|t| self.change_of(t)).collect();
        let usual = |pick: &dyn Fn(&[f64; 2]) -> f64| {
            let mut values: Vec<f64> = known.iter().flatten().map(pick).collect();
            upper_median(&mut values).unwrap_or(1.0)
        };
        let usual_m2 = usual(&|[formal, _]| *formal);
        let ratio = (usual(&|[formal, apart]| apart / formal) / MEDIAN_SQUARE).max(LEAST_RATIO);
        let of_stone = |[formal, apart]: [f64; 2]| {
            let square = apart / (formal * ratio);
            formal / usual_m2 * (PRIOR_DISAGREEMENTS + square) / (PRIOR_DISAGREEMENTS + DISAGREEMENTS)
        };
        known.into_iter().map(|k| k.map_or(1.0, of_stone)).collect()
    }

    /// Mean formal variance of the second epoch's matches, and squared disagreement of two normalisations,
    /// m^2.
    fn change_of(&self, track: &Track) -> Option<[f64; 2]> {
        let variances: Vec<f64> = track
            .sights
            .iter()
            .filter(|s| self.epochs[s.photo] == 1)
            .map(|s| 0.5 * s.covariance.trace())
            .collect();
        let formal = variances.iter().sum::<f64>() / variances.len() as f64;
        let apart = track.apart_m.iter().map(|a| a * a).sum();
        (formal > 0.0).then_some([formal, apart])
    }

    /// What the photos contributed. `bias_m`: scale of the appearance bias; `moving`: how each stone moved.
    pub fn report(&self, bias_m: f64, moving: &[Moving]) -> PhotoReport {
        let of_stone = |(i, track): (usize, &Track)| {
            let count = |epoch| {
                track
                    .sights
                    .iter()
                    .filter(|s| self.epochs[s.photo] == epoch)
                    .count()
            };
            let correlations = track.sights.iter().map(|s| s.correlation);
            let found = self.stones[i].as_ref();
            let turn = found.and_then(|s| s.turn.as_ref());
            let turn_sd_rad = |s: &StonePhotos| Some(s.turn.as_ref()?.sd(s.bias_sd_m(bias_m, moving[i])));
            let variance = found.and_then(|s| s.with_bias(bias_m, moving[i]).0.try_inverse());
            StonePhotoReport {
                status: track.status,
                photos: [count(0), count(1)],
                correlation: correlations.reduce(f64::min).unwrap_or(0.0),
                shift_m: found
                    .and_then(StonePhotos::displacement)
                    .map(|d| [d.x, d.y])
                    .filter(is_finite),
                sd_m: variance
                    .map(|c| [c[(0, 0)].max(0.0).sqrt(), c[(1, 1)].max(0.0).sqrt()])
                    .filter(is_finite),
                turn_rad: turn.map(|t| t.angle).filter(|v| v.is_finite()),
                turn_sd_rad: found.and_then(turn_sd_rad).filter(|v| v.is_finite()),
            }
        };

        let tracks = 0..self.tracks.len();
        let poses = self.names.iter().cloned().zip(self.poses_px.iter().copied());
        PhotoReport {
            stones: self.tracks.iter().enumerate().map(of_stone).collect(),
            sigma_factor: self.factor,
            appearance_m: bias_m,
            poses_px: poses.collect(),
            rows_px: self.rows_px.clone(),
            evidence: tracks.map(|i| self.evidence(i, bias_m, moving[i])).collect(),
        }
    }

    /// What the photos say of a stone by themselves; `None` where it is not tracked.
    fn evidence(&self, i: usize, bias_m: f64, moving: Moving) -> Option<StoneEvidence> {
        let track = &self.tracks[i];
        let photos = self.stones[i].as_ref();
        (track.status == PhotoStatus::Tracked).then(|| StoneEvidence {
            place: track.place,
            clouds: None,
            both: None,
            photos: photos.and_then(|s| {
                let covariance = s.with_bias(bias_m, moving).0.try_inverse()?;
                FaceShift::new(
                    &s.displacement()?.xy(),
                    &covariance.fixed_view::<2, 2>(0, 0).into_owned(),
                )
            }),
            shifts: self.shifts[i].clone(),
            pictures: track.pictures.clone(),
        })
    }
}

/// Median size of a pixel on the stones that a photo shows, and median distance of these, metres.
fn scale(photo: usize, photos: &[Photo], stones: &[StoneInPhotos], tracks: &[Track]) -> [f64; 2] {
    let (mut sizes, mut distances) = (Vec::new(), Vec::new());
    let camera = &photos[photo];
    for (stone, track) in stones.iter().zip(tracks) {
        if track.sights.iter().any(|s| s.photo == photo) {
            let axis = |r: usize| stone.face_from_world.row(r).transpose();
            let axes: [Vector3<f64>; 2] = [axis(0), axis(1)];
            sizes.extend(camera.pixel_m(&stone.centroid, &axes[0], &axes[1]));
            distances.push((stone.centroid - camera.camera.centre()).norm());
        }
    }
    [
        upper_median(&mut sizes).unwrap_or(0.0),
        upper_median(&mut distances).unwrap_or(USUAL_DISTANCE_M),
    ]
}

fn is_finite(pair: &[f64; 2]) -> bool {
    pair.iter().all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::photos::{ByRows, FaceMotion, Sight};
    use nalgebra::{Matrix2, Vector2};

    fn model(stones: &[(f64, f64)]) -> PhotoModel {
        let track = |&(sd_m, apart_m): &(f64, f64)| Track {
            likeness: 10.0,
            status: PhotoStatus::Tracked,
            sights: [0, 1]
                .map(|photo| Sight {
                    photo,
                    shift: Vector2::zeros(),
                    covariance: Matrix2::identity() * (if photo == 0 { 1.0 } else { sd_m * sd_m }),
                    turn: None,
                    parallax: [0.0; 2],
                    by_rows: ByRows::none(),
                    correlation: 0.9,
                })
                .to_vec(),
            place: [0.0; 2],
            radius_m: 0.1,
            apart_m: [apart_m, 0.0],
            start: FaceMotion::none(),
            pictures: None,
        };
        PhotoModel {
            params: PhotoParams::default(),
            names: vec![String::new(); 2],
            epochs: vec![0, 1],
            centres: vec![Point3::origin(); 2],
            scales: vec![[1.0; 2]; 2],
            tracks: stones.iter().map(track).collect(),
            stones: vec![None; stones.len()],
            shifts: vec![Vec::new(); stones.len()],
            factor: 1.0,
            poses_px: vec![0.0; 2],
            rows_px: Vec::new(),
            of_poses: DMatrix::zeros(0, 0),
            pulled_by_octaves: from_fn(|_| DMatrix::zeros(0, 0)),
        }
    }

    #[test]
    fn the_bias_follows_the_formal_variance_and_the_disagreement_of_normalisations() {
        // Disagreements of 1.5 standard deviations are usual here.
        let usual = (1e-4, 1.5e-4);
        let factors = model(&[usual, usual, usual, (3e-4, 4.5e-4), (1e-4, 6e-4)]).bias_factors();
        let typical = (8.0 + MEDIAN_SQUARE) / 10.0;
        for factor in &factors[..3] {
            assert!((factor - typical).abs() < 1e-9, "{factors:?}");
        }
        assert!((factors[3] - 9.0 * typical).abs() < 1e-9, "{factors:?}");
        assert!(
            (factors[4] - (8.0 + 16.0 * MEDIAN_SQUARE) / 10.0).abs() < 1e-9,
            "{factors:?}"
        );
    }

    #[test]
    fn a_stone_without_sights_or_disagreements_keeps_a_factor_about_one() {
        let mut model = model(&[(1e-4, 0.0), (1e-4, 0.0)]);
        model.tracks[1].sights.clear();
        assert_eq!(model.bias_factors(), vec![0.8, 1.0]);
    }
}
