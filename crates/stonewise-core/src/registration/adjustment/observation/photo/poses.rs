//! Adjustment of the photos' poses, from what they show of all stones and from where the clouds put these.
//!
//! For photo i of stone k, with the parallax q_i (shift in the face per height):
//!
//! s_ki = o_k + q_i h_k + [second epoch] F_i d_k + F_i E (w_i x r - c_i) + R_i v_i + e,   F_i = (1, q_i)
//!
//! o_k: place of the stone's template, h_k: error of the height of its face, d_k: its displacement, E: world
//! to face, r: from the camera to the stone, c_i and w_i: corrections of the camera's position and attitude.
//! A rolling shutter exposes the rows one after the other; if the camera moves meanwhile, each row is shifted
//! in proportion to its distance from the photo's middle row. v_i is the shift of the last row relative to
//! the first, in pixels; R_i converts it to the shift of the stone in the face. v_i is the sum of three
//! parts of two unknowns each: common to all photos, half the difference between the epochs (with opposite
//! signs), and of the photo alone.
//! All photos of the second epoch share a similarity transformation beside that, of any size: photos show
//! motions relative to each other.

use super::evidence::{FaceShift, PhotoShift};
use crate::linalg::DenseFactor;
use crate::registration::octave_patches::OctavePatches;
use crate::registration::photos::{Sight, Track};
use nalgebra::{
    DMatrix, DVector, Matrix2, Matrix3, Matrix3xX, Matrix6xX, MatrixXx3, Point3, SMatrix, Vector2, Vector3,
};
use rayon::prelude::*;
use std::array::from_fn;
use std::collections::BTreeMap;

/// Unknowns of a photo: position and attitude; with a rolling shutter also its own part of the shift of the
/// last row relative to the first.
const PHOTO: usize = 8;
/// Unknowns of a photo's pose, which is also the index of the first unknown for the shift of its rows.
const POSE: usize = 6;
/// A priori standard deviation of the part of this shift that all photos share, pixels, along the rows and
/// along the columns. Errors of the camera calibration can have the same effect.
const COMMON_PX: f64 = 2.0;
/// Starting values of the standard deviations of the other two parts, of the epoch and of the single photo,
/// pixels. The final values are estimated from the photos. With a readout time of 30 ms and pixels of 3 mm on
/// the wall, a speed of 0.2 m/s shifts the last row by two pixels; so do 2 degrees a second at 6 m.
const START_ROWS_PX: [f64; 2] = [0.3; 2];
/// Weight of these starting values, as a number of unknowns.
const ROWS_PRIOR: f64 = 2.0;
/// Unknowns of the shift of rows that photos share: common to all photos (2), half the difference between the
/// epochs (2).
const ALIKE: usize = 4;
/// Sign of half the difference between the epochs, in the first and in the second.
const SIGNS: [f64; 2] = [-1.0, 1.0];
/// Unknowns that photos share: those of the second epoch as a whole, and the shared shift of rows.
const SHARED: usize = WHOLE + ALIKE;
/// Unknowns of the second epoch as a whole: translation, rotation, scale.
const WHOLE: usize = 7;
/// Unknowns of a stone: place of the template (2), height of the face, displacement (3).
const STONE: usize = 6;
/// Standard deviation of the second epoch as a whole at the wall's end, metres: as good as free.
const WHOLE_M: f64 = 0.1;
/// Error of the height of a stone's face, metres: that of a noisy drone cloud and of relief between its
/// points.
const HEIGHT_M: f64 = 0.01;
/// Share of a pixel below which no match is trusted, whatever its formal error: interpolation and lens model.
const LEAST_PX: f64 = 0.02;
/// Rounds in which the weights of outlying photos and stones follow.
const ROUNDS: usize = 6;
/// Degrees of freedom of the law of errors: photos with leaves or shadows on a stone lose weight (Lange et
/// al. 1989).
const FREEDOM: f64 = 4.0;
/// Start of the factor on the formal variances of matches: pixels of one patch are correlated.
const START_FACTOR: f64 = 4.0;
/// Partial sums of the normal equations, which are formed in parallel and need memory for a matrix each. The number is
/// constant, so that results do not depend on the number of threads.
const SUMS: usize = 4;

/// The displacement of a stone's place on the face, as the clouds show it, in its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CloudMotion {
    pub mean: Vector3<f64>,
    pub covariance: Matrix3<f64>,
}

/// A stone with its photos and its clouds.
pub(super) struct PoseStone<'a> {
    pub track: &'a Track,
    pub centroid: Point3<f64>,
    pub face_from_world: &'a Matrix3<f64>,
    pub clouds: CloudMotion,
}

/// Cameras and what is known of them.
pub(super) struct PoseProblem<'a> {
    pub centres: &'a [Point3<f64>],
    pub epochs: &'a [usize],
    /// Size of a pixel on the wall and distance from it, metres, per photo.
    pub scales: &'a [[f64; 2]],
    pub pose_error_px: f64,
    /// Whether the shift of each photo's rows is estimated.
    pub rolling_shutter: bool,
    pub stones: Vec<PoseStone<'a>>,
    /// Middle of the wall, and its extent, metres.
    pub middle: Point3<f64>,
    pub extent_m: f64,
}

/// Scatter of the matches and of the shifts of rows, estimated with the poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatter {
    /// Factor on the formal variances of matches.
    pub factor: f64,
    /// Standard deviations of two parts of the shift of the last row relative to the first, pixels: that of
    /// the epoch and that of the single photo.
    pub rows_px: [f64; 2],
}

/// Adjusted poses.
#[derive(Clone)]
pub(super) struct Poses {
    /// Corrections in units of their standard deviations before.
    pub corrections: DVector<f64>,
    pub covariance: DMatrix<f64>,
    pub scatter: Scatter,
    /// Weight of each sight, in the order of stones and sights.
    pub weights: Vec<Vec<f64>>,
    /// Weight of what the clouds show of each stone.
    pub trust: Vec<f64>,
}

type StoneMatrix = SMatrix<f64, STONE, STONE>;

/// The equations of a stone's own unknowns.
pub(super) struct StoneSystem {
    own: StoneMatrix,
    right: SMatrix<f64, STONE, 1>,
    /// Indices of the unknowns of the poses in these equations.
    columns: Vec<usize>,
    /// One column for each of them.
    cross: Matrix6xX<f64>,
}

/// The normal equations of the poses. Only the lower triangle of the matrix is complete.
struct PoseEquations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

/// Residuals of the sights of a stone, summed.
#[derive(Clone, Copy, Default)]
struct Misfit {
    /// Sum of the weighted squares of the residuals.
    square: f64,
    /// Its redundancy.
    redundancy: f64,
}

/// How the poses' equations follow the displacement of a stone by the clouds, in its frame.
struct Pull {
    /// Indices of the unknowns of the poses.
    columns: Vec<usize>,
    /// One row each.
    by_clouds: MatrixXx3<f64>,
}

/// How errors of the poses change a stone's displacement by its photos, in the stone's frame.
#[derive(Clone, Debug)]
pub(crate) struct PoseInfluence {
    /// Indices of the unknowns of the poses.
    columns: Vec<usize>,
    /// Derivative of the displacement with respect to these unknowns, with the opposite sign, three rows.
    matrix: Matrix3xX<f64>,
}

impl PoseInfluence {
    /// No error of a pose matters.
    #[cfg(test)]
    pub fn none() -> Self {
        Self {
            columns: Vec::new(),
            matrix: Matrix3xX::zeros(0),
        }
    }

    /// The unknowns of the poses, and the displacement, in the frame of the stone, by each of them.
    pub fn by_unknown(&self) -> impl Iterator<Item = (usize, Vector3<f64>)> + '_ {
        let columns = self.matrix.column_iter().map(|c| c.into_owned());
        self.columns.iter().copied().zip(columns)
    }

    /// Covariance of this displacement with another stone's, for the covariance of the poses.
    pub fn covariance_with(&self, other: &Self, poses: &DMatrix<f64>) -> Matrix3<f64> {
        let between = DMatrix::from_fn(self.columns.len(), other.columns.len(), |r, c| {
            poses[(self.columns[r], other.columns[c])]
        });
        &self.matrix * between * other.matrix.transpose()
    }
}

impl PoseProblem<'_> {
    pub fn unknowns(&self) -> usize {
        self.first_shared() + self.of_all()
    }

    /// Unknowns of each photo.
    fn of_photo(&self) -> usize {
        if self.rolling_shutter { PHOTO } else { POSE }
    }

    /// Unknowns that photos share.
    fn of_all(&self) -> usize {
        if self.rolling_shutter { SHARED } else { WHOLE }
    }

    /// The first unknown that photos share.
    fn first_shared(&self) -> usize {
        self.of_photo() * self.centres.len()
    }

    /// Root mean square of what the correction of a photo's position and attitude shifts, pixels.
    pub fn pose_px(&self, photo: usize, poses: &Poses) -> f64 {
        let pose = poses.corrections.fixed_rows::<POSE>(self.of_photo() * photo);
        self.pose_error_px * (pose.norm_squared() / POSE as f64).sqrt()
    }

    /// Shift of a photo's last row relative to its first, along the rows and along the columns, pixels;
    /// `None` unless `rolling_shutter` is set.
    pub fn rows_px(&self, photo: usize, poses: &Poses) -> Option<Vector2<f64>> {
        let part = |first: usize| poses.corrections.fixed_rows::<2>(first);
        let alike = self.first_shared() + WHOLE;
        let [epoch_px, own_px] = poses.scatter.rows_px;
        self.rolling_shutter.then(|| {
            part(alike) * COMMON_PX
                + part(alike + 2) * (SIGNS[self.epochs[photo]] * epoch_px)
                + part(PHOTO * photo + POSE) * own_px
        })
    }

    /// Derivatives of a sight's shift with respect to the unknowns of the stone, those of its photo, and
    /// those that photos share.
    fn rows(
        &self,
        stone: &PoseStone,
        sight: &Sight,
        scatter: &Scatter,
    ) -> (
        SMatrix<f64, 2, STONE>,
        SMatrix<f64, 2, PHOTO>,
        SMatrix<f64, 2, SHARED>,
    ) {
        let q = Vector2::from(sight.parallax);
        let f = SMatrix::<f64, 2, 3>::new(1.0, 0.0, q.x, 0.0, 1.0, q.y);
        let second = f64::from(u8::from(self.epochs[sight.photo] == 1));
        let mut own = SMatrix::<f64, 2, STONE>::zeros();
        own.fixed_view_mut::<2, 2>(0, 0).fill_with_identity();
        own.fixed_view_mut::<2, 1>(0, 2).copy_from(&q);
        own.fixed_view_mut::<2, 3>(0, 3).copy_from(&(f * second));
        let [u, v] = stone.track.place;
        let at = stone.centroid + stone.face_from_world.transpose() * Vector3::new(u, v, 0.0);
        let to_face = f * stone.face_from_world;
        let [pixel_m, distance_m] = self.scales[sight.photo];
        let shift_m = self.pose_error_px * pixel_m;
        let mut pose = SMatrix::<f64, 2, PHOTO>::zeros();
        pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&(-to_face * shift_m));

        let turned = -to_face * (at - self.centres[sight.photo]).cross_matrix();
        pose.fixed_view_mut::<2, 3>(0, 3)
            .copy_from(&(turned * (shift_m / distance_m)));
        pose.fixed_view_mut::<2, 2>(0, POSE)
            .copy_from(&(sight.by_rows.shift * scatter.rows_px[1]));
        let mut shared = SMatrix::<f64, 2, SHARED>::zeros();
        let arm = at - self.middle;
        let reach = WHOLE_M / self.extent_m;
        shared
            .fixed_view_mut::<2, 3>(0, 0)
            .copy_from(&(to_face * (second * WHOLE_M)));
        shared
            .fixed_view_mut::<2, 3>(0, 3)
            .copy_from(&(-to_face * arm.cross_matrix() * (second * reach)));

        shared
            .fixed_view_mut::<2, 1>(0, 6)
            .copy_from(&(to_face * arm * (second * reach)));
        let sign = SIGNS[self.epochs[sight.photo]];

        for (k, px) in [COMMON_PX, sign * scatter.rows_px[0]].into_iter().enumerate() {
            shared
                .fixed_view_mut::<2, 2>(0, WHOLE + 2 * k)
                .copy_from(&(sight.by_rows.shift * px));
        }

        (own, pose, shared)
    }

    /// How far the adjusted poses turn a photo, with the second epoch as a whole: rotation vector, world,
    /// radians.
    pub fn rotation(&self, photo: usize, poses: &Poses) -> Vector3<f64> {
        let [pixel_m, distance_m] = self.scales[photo];
        let own = poses.corrections.fixed_rows::<3>(self.of_photo() * photo + 3);
        let whole = poses.corrections.fixed_rows::<3>(self.first_shared() + 3);
        let second = f64::from(u8::from(self.epochs[photo] == 1));
        own * (self.pose_error_px * pixel_m / distance_m) + whole * (second * WHOLE_M / self.extent_m)
    }

    /// Inverse covariance of a sight's shift.
    pub fn weight(&self, sight: &Sight, factor: f64) -> Matrix2<f64> {
        let floor = LEAST_PX * self.scales[sight.photo][0];
        (sight.covariance * factor + Matrix2::identity() * (floor * floor))
            .try_inverse()
            .unwrap_or_else(Matrix2::zeros)
    }

    /// The equations of a stone without what the clouds say.
    pub fn system(&self, stone: &PoseStone, weights: &[f64], scatter: &Scatter) -> StoneSystem {
        let sights = &stone.track.sights;
        let (own_count, shared_count) = (self.of_photo(), self.of_all());
        let first_shared = own_count * sights.len();
        let mut columns: Vec<usize> = sights
            .iter()
            .flat_map(|s| own_count * s.photo..own_count * (s.photo + 1))
            .collect();
        columns.extend(self.first_shared()..self.unknowns());
        let mut system = StoneSystem {
            own: StoneMatrix::zeros(),
            right: SMatrix::zeros(),
            cross: Matrix6xX::zeros(columns.len()),
            columns,
        };

        system.own[(2, 2)] = HEIGHT_M.powi(-2);
        let mut of_all = SMatrix::<f64, STONE, SHARED>::zeros();
        for (k, (sight, w)) in sights.iter().zip(weights).enumerate() {
            let (own, pose, shared) = self.rows(stone, sight, scatter);
            let weighted = own.transpose() * self.weight(sight, scatter.factor) * *w;
            system.own += weighted * own;
            system.right += weighted * sight.shift;
            let of_photo = weighted * pose;
            let mut columns = system.cross.columns_mut(own_count * k, own_count);
            columns.copy_from(&of_photo.columns(0, own_count));
            of_all += weighted * shared;
        }
        let mut columns = system.cross.columns_mut(first_shared, shared_count);
        columns.copy_from(&of_all.columns(0, shared_count));

        system
    }

    /// Adjusts the poses; `None` where the equations cannot be solved. `bias_m`: appearance bias; `factors`: on its
    /// variance, per stone.
    pub fn solve(&self, bias_m: f64, factors: &[f64]) -> Option<Poses> {
        let mut weights: Vec<Vec<f64>> = self
            .stones
            .iter()
            .map(|s| vec![1.0; s.track.sights.len()])
            .collect();
        let mut trust = vec![1.0; self.stones.len()];
        let mut scatter = Scatter {
            factor: START_FACTOR,
            rows_px: START_ROWS_PX,
        };
        let mut found = None;

        for _ in 0..ROUNDS {
            let (corrections, covariance) =
                self.solve_weighted(&weights, &trust, &scatter, bias_m, factors)?;
            let weighted = self.stones.par_iter().zip(&mut weights).zip(&mut trust);
            let misfits: Vec<Misfit> = weighted
                .zip(factors)
                .map(|(((stone, weights), trust), factor)| {
                    let prior = self.prior(stone, *trust, bias_m, *factor);
                    self.reweight(stone, weights, trust, &scatter, &prior, &corrections)
                })
                .collect();
            let square: f64 = misfits.iter().map(|m| m.square).sum();
            let redundancy: f64 = misfits.iter().map(|m| m.redundancy).sum();
            let redundancy = redundancy - self.first_shared() as f64;
            scatter.factor = (scatter.factor * square / redundancy.max(1.0)).max(1.0);
            let rows_px = self.scatter_of_rows(&corrections, &covariance, scatter.rows_px);
            found = Some(Poses {
                corrections,
                covariance,
                scatter,
                weights: weights.clone(),
                trust: trust.clone(),
            });
            scatter.rows_px = rows_px;
        }

        found
    }

    /// Updates the weights of a stone's sights and of its clouds from their residuals; returns the misfit with the
    /// former weights. `prior`: information of the clouds.
    fn reweight(
        &self,
        stone: &PoseStone,
        weights: &mut [f64],
        trust: &mut f64,
        scatter: &Scatter,
        prior: &Matrix3<f64>,
        corrections: &DVector<f64>,
    ) -> Misfit {
        let mut misfit = Misfit::default();
        let Some(own) = self.own(stone, weights, scatter, prior, corrections) else {
            return misfit;
        };
        for (sight, w) in stone.track.sights.iter().zip(weights) {
            let r = self.residual(stone, sight, &own, scatter, corrections);
            let r2 = r.dot(&(self.weight(sight, scatter.factor) * r));
            misfit.square += *w * r2;
            misfit.redundancy += 2.0;
            *w = (FREEDOM + 2.0) / (FREEDOM + r2);
        }
        misfit.redundancy -= 5.0;
        let apart = own.fixed_rows::<3>(3) - stone.clouds.mean;
        let spread = prior.try_inverse().unwrap_or_else(Matrix3::zeros) * *trust;
        let r2 = spread.try_inverse().map_or(0.0, |i| apart.dot(&(i * apart)));
        *trust = ((FREEDOM + 3.0) / (FREEDOM + r2)).min(1.0);
        misfit
    }

    /// New standard deviations of the shifts of rows from the corrections found with `rows_px`: one step of
    /// expectation maximisation.
    fn scatter_of_rows(
        &self,
        corrections: &DVector<f64>,
        covariance: &DMatrix<f64>,
        rows_px: [f64; 2],
    ) -> [f64; 2] {
        if !self.rolling_shutter {
            return rows_px;
        }
        let of_epochs: Vec<usize> = (self.unknowns() - 2..self.unknowns()).collect();
        let photos = 0..self.centres.len();
        let of_photos = photos.flat_map(|i| PHOTO * i + POSE..PHOTO * (i + 1)).collect();
        let unknowns = [of_epochs, of_photos];
        from_fn(|k| {
            let square = |i: &usize| corrections[*i].powi(2) + covariance[(*i, *i)];
            let sum: f64 = unknowns[k].iter().map(square).sum();
            let of_start = ROWS_PRIOR * START_ROWS_PX[k].powi(2);
            ((sum * rows_px[k].powi(2) + of_start) / (unknowns[k].len() as f64 + ROWS_PRIOR)).sqrt()
        })
    }

    /// Information of the clouds on a stone's displacement as the photos see it.
    fn prior(&self, stone: &PoseStone, trust: f64, bias_m: f64, bias_factor: f64) -> Matrix3<f64> {
        let bias = bias_m * bias_m * bias_factor;
        let covariance = stone.clouds.covariance + Matrix3::from_diagonal(&Vector3::new(bias, bias, 0.0));
        covariance.try_inverse().unwrap_or_else(Matrix3::zeros) * trust
    }

    fn solve_weighted(
        &self,
        weights: &[Vec<f64>],
        trust: &[f64],
        scatter: &Scatter,
        bias_m: f64,
        factors: &[f64],
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let count = self.unknowns();
        let stones_each = self.stones.len().div_ceil(SUMS).max(1);
        let chunks = self.stones.par_chunks(stones_each).enumerate();
        let sums: Vec<PoseEquations> = chunks
            .map(|(chunk, stones)| {
                let mut equations = PoseEquations::zeros(count);
                for (k, stone) in (chunk * stones_each..).zip(stones) {
                    let prior = self.prior(stone, trust[k], bias_m, factors[k]);
                    self.add_stone(&mut equations, stone, &weights[k], scatter, &prior);
                }
                equations
            })
            .collect();
        let mut normal = PoseEquations {
            matrix: DMatrix::identity(count, count),
            right: DVector::zeros(count),
        };
        for sum in sums {
            normal.matrix += sum.matrix;
            normal.right += sum.right;
        }
        let factor = DenseFactor::of(&normal.matrix)?;
        Some((factor.solve(&normal.right), factor.inverse()))
    }

    /// Adds a stone's equations of the poses, its own unknowns eliminated; `prior`: information of its clouds.
    fn add_stone(
        &self,
        equations: &mut PoseEquations,
        stone: &PoseStone,
        weights: &[f64],
        scatter: &Scatter,
        prior: &Matrix3<f64>,
    ) {
        let mut system = self.system(stone, weights, scatter);
        system.add_prior(prior, &stone.clouds.mean);
        let Some(own) = system.own.cholesky() else {
            return;
        };
        let (own_count, shared_count, first_shared) = (self.of_photo(), self.of_all(), self.first_shared());
        let PoseEquations { matrix, right } = equations;
        for (sight, w) in stone.track.sights.iter().zip(weights) {
            let (_, pose, shared) = self.rows(stone, sight, scatter);
            let weight = self.weight(sight, scatter.factor) * *w;
            let (of_pose, of_shared) = (pose.transpose() * weight, shared.transpose() * weight);
            let first = own_count * sight.photo;
            let mut block = matrix.view_mut((first, first), (own_count, own_count));
            block += (of_pose * pose).view((0, 0), (own_count, own_count));
            let mut block = matrix.view_mut((first_shared, first), (shared_count, own_count));
            block += (of_shared * pose).view((0, 0), (shared_count, own_count));
            let mut block = matrix.view_mut((first_shared, first_shared), (shared_count, shared_count));
            block += (of_shared * shared).view((0, 0), (shared_count, shared_count));
            let mut rows = right.rows_mut(first, own_count);
            rows += (of_pose * sight.shift).rows(0, own_count);
            let mut rows = right.rows_mut(first_shared, shared_count);
            rows += (of_shared * sight.shift).rows(0, shared_count);
        }
        let solved = own.solve(&system.cross).transpose();
        equations.subtract(
            &system.columns,
            &(&solved * &system.cross),
            &(solved * system.right),
        );
    }

    /// Covariances of the right sides of the poses' equations that errors of the clouds over octaves of length cause,
    /// per variance of one octave along, up and out of the faces. `octaves`: the patches of these stones.
    pub fn pulled_by(
        &self,
        octaves: &[OctavePatches],
        poses: &Poses,
        bias_m: f64,
        factors: &[f64],
    ) -> [DMatrix<f64>; 3] {
        let pulls: Vec<Option<Pull>> = (0..self.stones.len())
            .into_par_iter()
            .map(|k| self.pull(k, poses, bias_m, factors[k]))
            .collect();
        let count = self.unknowns();
        let mut sums = from_fn(|_| DMatrix::zeros(count, count));
        for octave in octaves {
            // By row: few photos show the stones of a small patch.
            let mut patches = vec![BTreeMap::<usize, Vector3<f64>>::new(); octave.count];
            for (pull, patch) in pulls.iter().zip(&octave.of_stones) {
                for (column, by) in pull
                    .iter()
                    .flat_map(|p| p.columns.iter().zip(p.by_clouds.row_iter()))
                {
                    *patches[*patch].entry(*column).or_default() += by.transpose();
                }
            }
            for pulled in patches {
                // Iterating over a list is faster than over a tree.
                let pulled: Vec<(usize, Vector3<f64>)> = pulled.into_iter().collect();
                for (column, of_column) in &pulled {
                    for (row, of_row) in &pulled {
                        for (axis, sum) in sums.iter_mut().enumerate() {
                            sum[(*row, *column)] += octave.share * of_row[axis] * of_column[axis];
                        }
                    }
                }
            }
        }
        sums
    }

    /// How the poses' equations follow what the clouds show of a stone.
    fn pull(&self, k: usize, poses: &Poses, bias_m: f64, factor: f64) -> Option<Pull> {
        let stone = &self.stones[k];
        let mut system = self.system(stone, &poses.weights[k], &poses.scatter);
        let prior = self.prior(stone, poses.trust[k], bias_m, factor);
        system.add_prior(&prior, &stone.clouds.mean);
        let by_displacement = system.own.cholesky()?.inverse().fixed_columns::<3>(3) * prior;
        Some(Pull {
            by_clouds: -(system.cross.transpose() * by_displacement),
            columns: system.columns,
        })
    }

    /// A stone's own unknowns, given the poses.
    fn own(
        &self,
        stone: &PoseStone,
        weights: &[f64],
        scatter: &Scatter,
        prior: &Matrix3<f64>,
        corrections: &DVector<f64>,
    ) -> Option<SMatrix<f64, STONE, 1>> {
        let mut system = self.system(stone, weights, scatter);
        system.add_prior(prior, &stone.clouds.mean);
        let right = system.right - &system.cross * system.of(corrections);
        Some(system.own.cholesky()?.solve(&right))
    }

    /// What each photo of a stone shows of its displacement in the face, poses adjusted, given the
    /// displacement that its photos show together. The height of the face is what fits them best.
    pub fn shifts(
        &self,
        stone: &PoseStone,
        weights: &[f64],
        poses: &Poses,
        displacement: &Vector3<f64>,
    ) -> Option<Vec<PhotoShift>> {
        let system = self.system(stone, weights, &poses.scatter);
        let right = system.right - &system.cross * system.of(&poses.corrections);
        let mixed = system.own.fixed_view::<3, 3>(0, 3);
        let inner = system.own.fixed_view::<3, 3>(0, 0).into_owned().cholesky()?;
        let face = inner.solve(&(right.fixed_rows::<3>(0) - mixed * displacement));
        let mut own = SMatrix::<f64, STONE, 1>::zeros();
        own.fixed_rows_mut::<3>(0).copy_from(&face);
        own.fixed_rows_mut::<3>(3).copy_from(displacement);

        let of_sight = |(sight, weight): (&Sight, &f64)| {
            let epoch = self.epochs[sight.photo];
            let moved = if epoch == 1 {
                displacement.xy()
            } else {
                Vector2::zeros()
            };
            let shift = moved + self.residual(stone, sight, &own, &poses.scatter, &poses.corrections);
            Some(PhotoShift {
                photo: sight.photo,
                epoch,
                shift: FaceShift::new(&shift, &self.weight(sight, poses.scatter.factor).try_inverse()?)?,
                weight: *weight,
            })
        };

        Some(
            stone
                .track
                .sights
                .iter()
                .zip(weights)
                .filter_map(of_sight)
                .collect(),
        )
    }

    /// What a sight's shift is off by.
    pub fn residual(
        &self,
        stone: &PoseStone,
        sight: &Sight,
        own: &SMatrix<f64, STONE, 1>,
        scatter: &Scatter,
        corrections: &DVector<f64>,
    ) -> Vector2<f64> {
        let (a, pose, shared) = self.rows(stone, sight, scatter);
        let (own_count, shared_count) = (self.of_photo(), self.of_all());
        let of_photo = corrections.rows(own_count * sight.photo, own_count);
        let of_shared = corrections.rows(self.first_shared(), shared_count);
        sight.shift
            - a * own
            - (pose.columns(0, own_count) * of_photo + shared.columns(0, shared_count) * of_shared)
    }
}

impl PoseEquations {
    fn zeros(count: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(count, count),
            right: DVector::zeros(count),
        }
    }

    /// Subtracts equations of some of the unknowns, those with the indices `columns`.
    fn subtract(&mut self, columns: &[usize], matrix: &DMatrix<f64>, right: &DVector<f64>) {
        for (c, &column) in columns.iter().enumerate() {
            self.right[column] -= right[c];
            for (r, &row) in columns.iter().enumerate() {
                if row >= column {
                    self.matrix[(row, column)] -= matrix[(r, c)];
                }
            }
        }
    }
}

impl StoneSystem {
    fn add_prior(&mut self, information: &Matrix3<f64>, mean: &Vector3<f64>) {
        let mut block = self.own.fixed_view_mut::<3, 3>(3, 3);
        block += information;
        let mut right = self.right.fixed_rows_mut::<3>(3);
        right += information * mean;
    }

    /// The pose corrections that this stone meets.
    fn of(&self, corrections: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(self.columns.len(), self.columns.iter().map(|&c| corrections[c]))
    }

    /// What the photos alone say of the displacement, template and height eliminated: information,
    /// information times displacement, and how the poses' errors change the displacement.
    pub fn displacement(&self, poses: &Poses) -> Option<(Matrix3<f64>, Vector3<f64>, PoseInfluence)> {
        let right = self.right - &self.cross * self.of(&poses.corrections);
        let inner = self.own.fixed_view::<3, 3>(0, 0).into_owned().cholesky()?;
        let mixed = self.own.fixed_view::<3, 3>(0, 3).into_owned();
        let solved = inner.solve(&mixed);
        let information = self.own.fixed_view::<3, 3>(3, 3) - mixed.transpose() * solved;
        let vector = right.fixed_rows::<3>(3) - solved.transpose() * right.fixed_rows::<3>(0);
        let sensitivity = self.cross.fixed_rows::<3>(3) - solved.transpose() * self.cross.fixed_rows::<3>(0);
        let inverse = information.try_inverse()?;
        Some((
            0.5 * (information + information.transpose()),
            vector,
            PoseInfluence {
                columns: self.columns.clone(),
                matrix: inverse * sensitivity,
            },
        ))
    }
}

#[cfg(test)]
mod tests;
