//! The figures of a prediction.

use crate::experiment::baseline::{Baseline, InventoryStone};
use crate::results::Status;
use crate::results::records::DatumState;
use nalgebra::Matrix3;
use serde::Serialize;
use std::collections::BTreeMap;

/// What a repetition of a survey will see.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Design {
    /// The epoch that is repeated.
    pub epoch: String,
    /// Seed of the stations' errors and of the division of the photos.
    pub seed: u64,
    /// Stones of the epoch, and those of them that will be measured.
    pub stones: [usize; 2],
    /// Stones that will not be measured, by their status.
    pub not_measured: BTreeMap<String, usize>,
    /// What is known of the registration of such a survey: `sources`, `stable`, `stated`, or `unknown`, where motions are
    /// relative to the common motion.
    pub datum: DatumState,
    /// Median standard deviations of a stone's motion along the wall, up and out, millimetres.
    pub sd_mm: [Option<f64>; 3],
    /// Median standard deviations of a stone's deformation along the wall, up and out, millimetres.
    pub sd_deformation_mm: [Option<f64>; 3],
    /// Smallest bulge of 1, 3 and 10 m that is found in 95 of 100 cases, in the median over the wall; absent where the
    /// wall is smaller.
    pub zones_mm: [Option<f64>; 3],
    /// Smallest motion in the face of a zone of 1, 3 and 10 m that is found in 95 of 100 cases, along the wall or up,
    /// whichever is found worse, in the median over the wall, millimetres; absent where the wall is smaller.
    pub zones_in_face_mm: [Option<f64>; 3],
    /// Number of stations or strips of the epoch; 1 where its files keep none apart.
    pub sources: usize,
    /// `sd_mm` with one more station or strip that sees what the others see on average.
    pub sd_with_one_more_mm: [Option<f64>; 3],
    /// `sd_mm` if the stable areas were perfect: what the registration of the epochs no longer adds.
    pub sd_without_registration_mm: [Option<f64>; 3],
    /// What the first survey shows of the wall.
    pub baseline: Baseline,
}

/// A stone of the first survey and what will become of it.
pub(super) struct Foreseen {
    pub stone: InventoryStone,
    /// `ok`, or why there will be no motion.
    pub status: Status,
    pub expected: Option<Expected>,
}

/// What a repetition says of one stone; standard deviations along, up and out.
pub(super) struct Expected {
    pub sd: [f64; 3],
    pub deformation: [Option<f64>; 3],
    pub one_more: [f64; 3],
    pub without_registration: [f64; 3],
}

pub(super) fn variances(covariance: &Matrix3<f64>) -> [f64; 3] {
    [0, 1, 2].map(|axis| covariance[(axis, axis)].max(0.0))
}

/// `all`: variances of a stone's motion, of which `registration` are those of the epochs' errors and `shared` what is
/// assumed that all stations of an epoch share.
pub(super) fn expect(
    all: [f64; 3],
    registration: [f64; 3],
    shared: f64,
    sources: usize,
    deformation: [Option<f64>; 3],
) -> Expected {
    let noise = [0, 1, 2].map(|axis| (all[axis] - registration[axis]).max(0.0));
    let fewer = sources as f64 / (sources as f64 + 1.0);
    let sd = |of: &dyn Fn(usize) -> f64| [0, 1, 2].map(|axis| of(axis).sqrt());
    Expected {
        sd: sd(&|axis| all[axis]),
        deformation,
        one_more: sd(&|axis| {
            let shared = shared.min(registration[axis]);
            fewer * (noise[axis] + registration[axis] - shared) + shared
        }),
        without_registration: sd(&|axis| noise[axis]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_more_station_lessens_all_but_what_stations_share() {
        // Noise 1, registration 3 of which 1 is shared, two stations: 2/3 * (1 + 2) + 1.
        let e = expect([4.0; 3], [3.0; 3], 1.0, 2, [None; 3]);
        assert!((e.sd[0] - 2.0).abs() < 1e-12);
        assert!((e.one_more[1] - 3f64.sqrt()).abs() < 1e-12);
        assert!((e.without_registration[2] - 1.0).abs() < 1e-12);
    }
}
