//! How large the photos' fields are, from what photos of one epoch show of the same stones.
//!
//! Stones that are tracked from photo to photo are tie points. Poses, cameras and places adjusted, their shifts scatter by
//! the noise of the matches and, smoothly in each photo, by its field. With G = F'RF the information of the residuals on
//! the fields and u = F'Ry what they show, u is normal with covariance s^2 G + t^2 G G: s the factor on the noise of the
//! matches, t that on the fields. Both epochs have places of their own, so that no motion of the wall enters.

use super::bundle::BundleEquations;
use super::sight::{FIELDS, Sight};
use crate::geometry::View;
use crate::registration::observers::sight::SeenStone;
use nalgebra::{DMatrix, Matrix2, Matrix2xX, Vector2, Vector3};

/// Most photos whose fields are looked at; of more, evenly chosen ones.
const MOST_PHOTOS: usize = 48;
/// Standard deviation of the logarithm of the factor before any photo is looked at: cameras with and without a
/// stabiliser differ by a factor of two to three.
const PRIOR_LOG_SD: f64 = 0.5;
/// Steps of the factor's logarithm over which it is averaged, and the farthest.
const LOG_STEP: f64 = 0.1;
const LOG_STEPS: i32 = 40;
/// Share of the largest information below which a direction of the fields is not counted: errors of the matches that
/// neighbouring stones share are larger there than the fields.
const LEAST_SHOWN: f64 = 0.03;
/// Stones that must be tracked beyond what a pose needs.
const LEAST_FREEDOM: f64 = 10.0;

/// The shift that a photo shows of a stone against the other photos, in the frame of its face.
#[derive(Clone, Copy, Debug)]
pub struct NetworkShift {
    /// Stone, as an index into those of the pair of epochs.
    pub stone: usize,
    /// 0: photo of the reference, 1: of the later epoch.
    pub epoch: usize,
    /// Which of the photos of its epoch.
    pub photo: usize,
    /// Axes of the face along and up, world.
    pub axes: [Vector3<f64>; 2],
    /// Shift along and up, metres.
    pub shift_m: Vector2<f64>,
    /// Covariance of the match, m^2.
    pub covariance_m2: Matrix2<f64>,
}

/// Expected square of the factor on the fields.
pub(super) fn mean_square(photos: &[Vec<View>; 2], shifts: &[NetworkShift], stones: &[SeenStone]) -> f64 {
    let information = Information::of(photos, shifts, stones);
    let logs = (-LOG_STEPS..=LOG_STEPS).map(|k| f64::from(k) * LOG_STEP);
    let deviance = |log: f64| {
        let of_data = information
            .as_ref()
            .map_or(0.0, |i| i.deviance((2.0 * log).exp()));
        of_data + (log / PRIOR_LOG_SD).powi(2)
    };
    let all: Vec<(f64, f64)> = logs.map(|log| (log, deviance(log))).collect();
    let least = all.iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
    let weight = |d: f64| (-0.5 * (d - least)).exp();
    let total: f64 = all.iter().map(|(_, d)| weight(*d)).sum();
    all.iter()
        .map(|(log, d)| weight(*d) * (2.0 * log).exp())
        .sum::<f64>()
        / total
}

/// What the residuals show of the fields, direction by direction.
struct Information {
    /// Information and what is shown of each independent direction.
    directions: Vec<[f64; 2]>,
    /// Variance of the matches in units of what they claim.
    noise: f64,
}

impl Information {
    /// `None` where too few stones are tracked.
    fn of(of_epochs: &[Vec<View>; 2], shifts: &[NetworkShift], stones: &[SeenStone]) -> Option<Self> {
        let views: Vec<_> = of_epochs.iter().flatten().collect();
        let step = views.len().div_ceil(MOST_PHOTOS).max(1);
        let photos: Vec<usize> = (0..views.len()).step_by(step).collect();
        let columns = FIELDS * photos.len() + 1;
        let before = [0, of_epochs[0].len()];
        // Of each stone in each epoch, with what each photo shows.
        let mut ties = vec![Vec::new(); 2 * stones.len()];
        for shown in shifts {
            let number = before[shown.epoch] + shown.photo;
            if let Ok(place) = photos.binary_search(&number)
                && let Some(sight) = Sight::of(number, views[number], &stones[shown.stone])
                && let Some(tie) = whitened(&sight, shown)
            {
                ties[2 * shown.stone + shown.epoch].push((tie.0, tie.1, place));
            }
        }

        let mut equations = BundleEquations::new(&views, &photos, columns);
        let mut squares = DMatrix::zeros(columns, columns);
        let mut freedom = 0.0;
        for tie in ties.iter().filter(|tie| tie.len() > 1) {
            let sights: Vec<&Sight> = tie.iter().map(|(sight, ..)| sight).collect();
            let shifts = |sight: &Sight| {
                let mut by = Matrix2xX::zeros(columns);
                if let Some((_, shift, place)) = tie.iter().find(|(s, ..)| s.photo == sight.photo) {
                    by.columns_mut(FIELDS * place, FIELDS).copy_from(&sight.fields);
                    by.set_column(columns - 1, shift);
                }
                by
            };
            if let Some(rest) = equations.add(&sights, shifts) {
                freedom += 2.0 * sights.len() as f64 - 3.0;
                rest.iter().for_each(|by| squares += by.transpose() * by);
            }
        }
        freedom -= equations.unknowns() as f64;
        if freedom < LEAST_FREEDOM {
            return None;
        }

        squares -= equations.right().transpose() * equations.solve()?.corrections;
        let count = columns - 1;
        let eigen = squares
            .view((0, 0), (count, count))
            .into_owned()
            .symmetric_eigen();
        let shown = eigen.eigenvectors.transpose() * squares.view((0, count), (count, 1));
        let least = LEAST_SHOWN * eigen.eigenvalues.max();
        let values = eigen.eigenvalues.iter().copied().zip(shown.iter().copied());
        let directions: Vec<[f64; 2]> = values
            .filter(|(value, _)| *value > least)
            .map(|(v, u)| [v, u])
            .collect();
        let by_fields: f64 = directions
            .iter()
            .map(|[value, shown]| shown * shown / value)
            .sum();
        let left = freedom - directions.len() as f64;
        let noise = (squares[(count, count)] - by_fields) / left.max(1.0);
        (left >= LEAST_FREEDOM && noise > 0.0).then_some(Self { directions, noise })
    }

    /// Minus twice the log likelihood of this square of the factor on the fields.
    fn deviance(&self, square: f64) -> f64 {
        let of_direction = |[value, shown]: &[f64; 2]| {
            let variance = value * (self.noise + square * value);
            variance.ln() + shown * shown / variance
        };
        self.directions.iter().map(of_direction).sum()
    }
}

/// The sight and the shift of its image point in units of the match's standard deviations.
fn whitened(sight: &Sight, shown: &NetworkShift) -> Option<(Sight, Vector2<f64>)> {
    let [along, up] = shown.axes;
    let by_face = sight.by_place * nalgebra::Matrix3x2::from_columns(&[along, up]);
    let covariance = by_face * shown.covariance_m2 * by_face.transpose();
    let root = covariance.cholesky()?.inverse().cholesky()?.l().transpose();
    let whitened = Sight {
        photo: sight.photo,
        by_place: root * sight.by_place,
        by_pose: root * sight.by_pose,
        by_camera: root * sight.by_camera,
        fields: root * sight.fields,
    };
    Some((whitened, root * by_face * shown.shift_m))
}
