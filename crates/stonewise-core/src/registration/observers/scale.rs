//! The scale of the later epoch against the reference.
//!
//! A scale is a stretch of all places away from their middle. Only known lengths show it: between the epochs it looks like
//! a wall that grew. So it is taken off as far as lengths are known, its uncertainty is an error that all stones share,
//! and a wall that seems to grow all round by more than instruments and temperature explain leaves it open.

use super::response::Response;
use super::sight::SeenStone;
use crate::geometry::Strain;
use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Strain that temperature gives a wall in every direction: at most 12e-6 per kelvin for masonry (EN 1996-1-1:2005,
/// 3.7.4), and 25 K.
const THERMAL_STRAIN: f64 = 3e-4;
/// Half width of a 95 % interval of a strain, in standard deviations: Student's law with the eight degrees of
/// freedom of [`Strain`]'s nine parts.
const STRAIN_SIGMAS_95: f64 = 2.306;

/// What is known of the scale before the epochs are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownScale {
    /// Length in the later epoch over length in the reference, less one: its expectation.
    pub mean: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Whether known lengths show it.
    pub is_measured: bool,
}

/// The scale error of the later epoch against the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScaleError {
    /// Middle of the stones, about which it stretches, world, metres.
    pub centre: Point3<f64>,
    /// Its expectation, which is taken off.
    pub mean: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// How the wall changed its size; `None` where too few stones show it.
    pub strain: Option<WallStrain>,
}

/// How a wall grew or shrank all round.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WallStrain {
    /// Mean strain.
    pub mean: f64,
    /// Half width of its 95 % interval.
    pub half_width: f64,
    /// The lesser principal strain.
    pub lesser: f64,
    /// The least strain all round that the motions leave possible, divided by the largest that instruments and
    /// temperature explain; above one, the scale is wrong.
    pub excess: f64,
}

impl ScaleError {
    /// `response`: the motions that were measured, which show the strain of the wall.
    pub(super) fn of(known: KnownScale, stones: &[SeenStone], response: Option<&Response>) -> Self {
        let count = stones.len().max(1) as f64;
        let centre = Point3::from(stones.iter().map(|s| s.centroid.coords).sum::<Vector3<f64>>() / count);
        let strain = strain(&known, response).filter(|_| !known.is_measured);
        Self {
            centre,
            mean: known.mean,
            sd: strain
                .filter(|s| s.excess > 1.0)
                .map_or(known.sd, |s| known.sd.hypot(s.mean)),
            strain,
        }
    }

    /// Displacement of a place by a scale error of one, metres.
    pub(super) fn arm(&self, place: &Point3<f64>) -> Vector3<f64> {
        place - self.centre
    }

    /// Covariance of the error at a place, world, m^2.
    pub fn covariance_at(&self, place: &Point3<f64>) -> Matrix3<f64> {
        let arm = self.arm(place) * self.sd;
        arm * arm.transpose()
    }

    /// The expected error at a place, world, metres.
    pub fn at(&self, place: &Point3<f64>) -> Vector3<f64> {
        self.arm(place) * self.mean
    }
}

/// The strain of the stones that are not loose.
fn strain(known: &KnownScale, response: Option<&Response>) -> Option<WallStrain> {
    let stones = response?.motions.stones.iter().flatten();
    let (places, displacements): (Vec<_>, Vec<_>) = stones
        .filter(|s| !s.is_loose)
        .map(|s| (s.place, s.displacement))
        .unzip();
    let strain = Strain::fit(&places, &displacements)?;
    let sign = strain.mean.signum();
    let least = sign * strain.lesser - STRAIN_SIGMAS_95 * strain.lesser_sd;
    let half_width = STRAIN_SIGMAS_95 * strain.mean_sd;
    Some(WallStrain {
        mean: strain.mean,
        half_width,
        lesser: strain.lesser,
        excess: least / (THERMAL_STRAIN + STRAIN_SIGMAS_95 * known.sd),
    })
}
