//! All stones' photos as one type of observation.

use super::poses::{CloudMotion, PoseProblem, PoseStone};
use super::stone_photos::StonePhotos;
use crate::geometry::Bounds;
use crate::registration::photos::{Photo, PhotoParams, PhotoStatus, Sight, Track};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Point3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

/// Strains that stand for as many more before those of a stone count by themselves: four known degrees of freedom hold a factor on a
/// variance within a half and three.
const PRIOR_STRAINS: f64 = 4.0;
/// Error of an entry of a warp's matrix: a third of a cell at the rim of a face of a hundred cells.
const WARP_SD: f64 = 0.005;
/// Tilt of a face against its cloud, radians: that of a loose stone whose tilt the clouds do not show.
const TILT_SD: f64 = 0.03;
/// Information on a warp before any photo, as good as none.
const OPEN_WARP: f64 = 1e-6;
/// Components of a strain.
const STRAINS: usize = 3;
/// Least strain that counts as usual, so that a survey without any keeps factors of one.
const LEAST_STRAIN_M: f64 = 2e-5;
/// Least and most of the factor on the variance of the appearance bias that a face's area makes: light that falls on all of a face does
/// not average out, and six is two and a half in the standard deviation.
const AREA_FACTORS: [f64; 2] = [0.7, 6.0];
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
    factor: f64,
    poses_px: Vec<f64>,
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
    /// Standard deviation of a stone's appearance bias between the epochs, metres.
    pub appearance_m: f64,
    /// Correction of each photo's pose: name, and root mean square of what it shifts, pixels.
    pub poses_px: Vec<(String, f64)>,
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
}

impl PhotoModel {
    /// Of tracked stones, before the poses are adjusted.
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
            tracks,
            factor: 1.0,
            poses_px: vec![0.0; photos.len()],
        }
    }

    /// Adjusts the poses to where the clouds put the stones, and takes from the photos what they say with these poses.
    pub fn update(&mut self, stones: &[StoneInPhotos], bias_m: f64) {
        let factors = self.bias_factors();
        let used: Vec<usize> = (0..stones.len())
            .filter(|&i| self.tracks[i].status == PhotoStatus::Tracked && stones[i].clouds.is_some())
            .collect();
        let places = used.iter().map(|&i| stones[i].centroid);
        let Some(bounds) = Bounds::of(places) else { return };
        let problem = PoseProblem {
            centres: &self.centres,
            epochs: &self.epochs,
            scales: &self.scales,
            pose_error_px: self.params.pose_error_px,
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
        let mut found = vec![None; stones.len()];
        for (k, (&i, stone)) in used.iter().zip(&problem.stones).enumerate() {
            let system = problem.system(stone, &poses.weights[k], poses.factor);
            found[i] = system
                .displacement(&poses)
                .map(|(information, vector, common)| StonePhotos {
                    information,
                    vector,
                    place: self.tracks[i].place,
                    bias_factor: factors[i],
                    common,
                });
        }
        let px = |i: usize| {
            let correction = poses.corrections.rows(6 * i, 6);
            self.params.pose_error_px * (correction.norm_squared() / 6.0).sqrt()
        };
        self.poses_px = (0..self.centres.len()).map(px).collect();
        self.factor = poses.factor.sqrt();
        self.stones = found;
    }

    /// What the photos say of a stone.
    pub fn stone(&self, i: usize) -> Option<&StonePhotos> {
        self.stones[i].as_ref()
    }

    /// Place on a stone's face whose displacement its photos show.
    pub fn place(&self, i: usize) -> [f64; 2] {
        self.tracks[i].place
    }

    /// Factors on the variance of the stones' appearance bias. What strains a face by chance also shifts it, and what changes over a few
    /// centimetres averages out over large faces. About one for the median stone.
    fn bias_factors(&self) -> Vec<f64> {
        let strains: Vec<Option<[f64; STRAINS]>> = self.tracks.iter().map(|t| self.strain_m(t)).collect();
        let known: Vec<[f64; STRAINS]> = strains.iter().flatten().copied().collect();
        let middle = |pick: &dyn Fn(&[f64; STRAINS]) -> f64| {
            let mut values: Vec<f64> = known.iter().map(pick).collect();
            upper_median(&mut values).unwrap_or(0.0)
        };
        let centre: [f64; STRAINS] = std::array::from_fn(|c| middle(&|s| s[c]));
        // The median of a normal variable's size is 0.674 standard deviations.
        let spread: [f64; STRAINS] =
            std::array::from_fn(|c| (middle(&|s| (s[c] - centre[c]).abs()) / 0.674).max(LEAST_STRAIN_M));
        let mut areas: Vec<f64> = self
            .tracks
            .iter()
            .map(|t| t.area_m2)
            .filter(|a| *a > 0.0)
            .collect();
        let usual_m2 = upper_median(&mut areas).unwrap_or(0.0);
        let of_stone = |(track, strain): (&Track, &Option<[f64; STRAINS]>)| {
            strain.map_or(1.0, |s| {
                let square: f64 = (0..STRAINS)
                    .map(|c| ((s[c] - centre[c]) / spread[c]).powi(2))
                    .sum();
                let of_area = (usual_m2 / track.area_m2).clamp(AREA_FACTORS[0], AREA_FACTORS[1]);
                of_area * (PRIOR_STRAINS + square) / (PRIOR_STRAINS + STRAINS as f64)
            })
        };
        self.tracks.iter().zip(&strains).map(of_stone).collect()
    }

    /// Strain of a stone's face from one epoch to the other, times its reach, metres.
    fn strain_m(&self, track: &Track) -> Option<[f64; STRAINS]> {
        if track.status != PhotoStatus::Tracked {
            return None;
        }
        let [before, after] = [0, 1].map(|epoch| {
            let of_epoch = track.sights.iter().filter(|s| self.epochs[s.photo] == epoch);
            untilted_strain(of_epoch)
        });
        let [u, v] = track.reach;
        let reach = [u, v, (u * v).sqrt()];
        let (before, after) = (before?, after?);
        Some(std::array::from_fn(|c| (after[c] - before[c]) * reach[c]))
    }

    /// What the photos contributed. `bias_m`: appearance bias.
    pub fn report(&self, bias_m: f64) -> PhotoReport {
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
            let variance = found.and_then(|s| s.with_bias(bias_m).0.try_inverse());
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
            }
        };
        let poses = self.names.iter().cloned().zip(self.poses_px.iter().copied());
        PhotoReport {
            stones: self.tracks.iter().enumerate().map(of_stone).collect(),
            sigma_factor: self.factor,
            appearance_m: bias_m,
            poses_px: poses.collect(),
        }
    }
}

/// Strain of a stone's face in the photos of one epoch, less what a tilt of the face makes: that is the parallax of each photo times the
/// tilt, and differs from photo to photo.
fn untilted_strain<'a>(sights: impl Iterator<Item = &'a Sight>) -> Option<[f64; STRAINS]> {
    // Unknowns: the warp's matrix row by row, then the tilt along and up, each over its standard deviation.
    let mut normal = SMatrix::<f64, 6, 6>::identity() * OPEN_WARP;
    let mut right = SVector::<f64, 6>::zeros();
    (4..6).for_each(|k| normal[(k, k)] = 1.0);
    let mut add = |row: SVector<f64, 6>, value: f64| {
        normal += row * row.transpose() / (WARP_SD * WARP_SD);
        right += row * (value / (WARP_SD * WARP_SD));
    };
    for sight in sights {
        let [x, y, across] = sight.strain;
        let values = [[x, across - sight.turn], [across + sight.turn, y]];
        for (r, row_values) in values.iter().enumerate() {
            for (c, value) in row_values.iter().enumerate() {
                let mut row = SVector::<f64, 6>::zeros();
                row[2 * r + c] = 1.0;
                row[4 + c] = sight.parallax[r] * TILT_SD;
                add(row, *value);
            }
        }
    }
    let warp = normal.cholesky()?.solve(&right);
    Some([warp[0], warp[3], 0.5 * (warp[1] + warp[2])])
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
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn a_tilted_face_is_not_taken_for_a_strained_one() {
        let (tilt, strain) = (
            Vector2::new(0.02, -0.03),
            Matrix2::new(0.004, 0.001, 0.001, -0.002),
        );
        let parallaxes = [[0.4, 0.1], [-0.5, 0.2], [0.1, -0.4], [0.3, 0.5]];
        let sights: Vec<Sight> = parallaxes
            .iter()
            .map(|q| {
                let m = strain + Vector2::from(*q) * tilt.transpose();
                Sight {
                    photo: 0,
                    shift: Vector2::zeros(),
                    covariance: Matrix2::identity(),
                    turn: 0.5 * (m[(1, 0)] - m[(0, 1)]),
                    strain: [m[(0, 0)], m[(1, 1)], 0.5 * (m[(0, 1)] + m[(1, 0)])],
                    parallax: *q,
                    correlation: 0.9,
                }
            })
            .collect();
        let [x, y, across] = untilted_strain(sights.iter()).unwrap();
        let found = [x - 0.004, y + 0.002, across - 0.001];
        assert!(found.iter().all(|d| d.abs() < 6e-4), "{found:?}");
    }
}
