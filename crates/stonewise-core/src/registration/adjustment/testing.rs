//! A simulated wall of stones with their points, for tests.

use super::params::AdjustmentParams;
use super::state::Adjustment;
use super::survey::{Points, survey};
use crate::cloud::Cloud;
use crate::id::StoneId;
use crate::progress::Silent;
use crate::registration::points::{PairPoints, PairSource};
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Stones in a row.
pub(super) const COLUMNS: u32 = 8;
/// Points of a stone in either epoch.
const POINTS: usize = 400;
/// Half the sides of a stone's face along and up, metres.
const HALF_M: [f64; 2] = [0.1, 0.08];

/// Stones 30 cm wide and 20 cm high in the plane x = 0, each with a wavy face of its own.
///
/// `noise_m`: standard deviation along the normal, per epoch. `motion`: of each stone, world, metres.
pub(in crate::registration) fn wall(
    rows: u32,
    noise_m: [f64; 2],
    motion: impl Fn(u32) -> Vector3<f64>,
) -> Vec<PairPoints> {
    wall_apart(rows, noise_m, |_| Vector3::zeros(), motion)
}

/// The stones of [`wall`], each moved by `apart` from its place in the wall, world, metres.
pub(super) fn wall_apart(
    rows: u32,
    noise_m: [f64; 2],
    apart: impl Fn(u32) -> Vector3<f64>,
    motion: impl Fn(u32) -> Vector3<f64>,
) -> Vec<PairPoints> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut scan = |stone: u32, noise_m: f64, shift: Vector3<f64>| {
        let point = |_| {
            let (y, z) = (
                rng.random_range(-HALF_M[0]..HALF_M[0]),
                rng.random_range(-HALF_M[1]..HALF_M[1]),
            );
            let noise = noise_m * stonewise_testing::normal(&mut rng);
            let phase = f64::from(stone);
            let x = 0.004 * ((50.0 * y + phase).sin() + (43.0 * z + 2.0 * phase).cos());
            (Vector3::new(x + noise, y, z) + shift).cast::<f32>().into()
        };
        (0..POINTS).map(point).collect::<Vec<[f32; 3]>>()
    };

    let pair = |k: u32| {
        let (column, row) = (f64::from(k % COLUMNS), f64::from(k / COLUMNS));
        let centroid = Point3::new(0.0, 0.3 * column, 0.2 * row) + apart(k);
        PairPoints {
            first: StoneId(k + 1),
            second: StoneId(k + 1),
            centroid,
            centroid_second: centroid + motion(k),
            normal: Vector3::x(),
            points_first: Cloud::new(centroid, scan(k, noise_m[0], Vector3::zeros())),
            points_second: Cloud::new(centroid, scan(k, noise_m[1], motion(k))),
            nearby_second: Cloud::new(centroid, Vec::new()),
            window: None,
        }
    };

    (0..COLUMNS * rows).map(pair).collect()
}

/// The start of an adjustment with default parameters.
pub(super) fn begun<S: PairSource>(source: &S) -> (Adjustment, Points<'_, S>) {
    let params = AdjustmentParams::default();
    let survey = survey(source, &params, &Silent).unwrap();
    let adjustment = Adjustment::new(survey.stones, survey.spacing_m, &params).unwrap();
    (adjustment, survey.points)
}
