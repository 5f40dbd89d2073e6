//! Errors of dense matching that neighbouring points share.
//!
//! Matching compares windows of pixels, so that neighbouring points err alike. No point of a stone shows that against the
//! others of the stone, and neighbouring stones err alike as if they had moved. On the clouds of a real, still wall with
//! pixels of 4 mm, what the photos' fields do not explain has a standard deviation of 0.6 mm and changes over 0.43 m
//! (restricted maximum likelihood, Matern covariance); one pixel of all photos is about 10 mm of depth there.

use super::sight::{Sight, intersection};
use crate::statistics::upper_median;
use nalgebra::Matrix3;

/// Standard deviation of the error in each photo, pixels.
const MATCHING_PX: f64 = 0.06;
/// Length over which it is alike, pixels.
const ALIKE_PX: f64 = 110.0;
/// The same where the photos are not known: standard deviation per axis of the difference of two clouds, and length,
/// metres.
const USUAL_M: [f64; 2] = [6e-4, 0.43];

/// Errors that all points of a stone share, and stones nearer than a length about alike.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Matching {
    /// Length over which stones err alike, metres.
    pub length_m: f64,
    /// Covariance of the error of each stone, later epoch less reference, world, m^2.
    pub covariances: Vec<Matrix3<f64>>,
}

impl Matching {
    /// Of clouds from photos that are not known.
    pub fn usual(stones: usize) -> Self {
        Self {
            length_m: USUAL_M[1],
            covariances: vec![Matrix3::identity() * USUAL_M[0].powi(2); stones],
        }
    }

    /// Of the stones that these photos see, those of the later epoch from number `first_later` on; `None` where no photo
    /// sees one.
    pub(super) fn seen(sights: &[Vec<Sight>], first_later: usize) -> Option<Self> {
        let of_stone = |sights: &Vec<Sight>| {
            let of_epoch = |is_later: bool| -> Vec<&Sight> {
                sights
                    .iter()
                    .filter(|s| (s.photo >= first_later) == is_later)
                    .collect()
            };
            let inverses = [false, true].map(|epoch| intersection(&of_epoch(epoch)));
            inverses.into_iter().flatten().sum::<Matrix3<f64>>() * MATCHING_PX.powi(2)
        };
        let pixels = sights.iter().flatten().map(|s| s.by_place.row(0).norm().recip());
        let pixel_m = upper_median(&mut pixels.collect::<Vec<f64>>())?;
        Some(Self {
            length_m: ALIKE_PX * pixel_m,
            covariances: sights.iter().map(of_stone).collect(),
        })
    }
}
