//! The adjustment of all stones together: the motion of every matched stone.

use super::error::AdjustError;
use super::params::{AdjustmentParams, AdjustmentReport};
use super::phases::Surveyed;
use super::survey::survey;
use crate::progress::Progress;
use crate::registration::photos::PhotoSource;
use crate::registration::points::PairSource;

/// Adjusts all pairs together.
///
/// The stones' own points give each stone normal equations of its motion; a smooth field of motion ties
/// neighbours, with weights estimated from the survey; stones and ties that do not fit are released. World
/// frame, metres.
///
/// survey -> align -> probe -> track, where there are photos -> weigh -> settle -> part along a crack or let a
/// creeping zone move, then weigh and settle again, until none is left -> report.
///
/// Cost: four approximate and about four exact evaluations of all points, and a dozen sparse factorisations.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use stonewise_core::registration::{AdjustmentParams, MemoryPairs, PairPoints, adjust};
/// use stonewise_core::{cloud::Cloud, id::StoneId, progress::Silent};
///
/// // Twelve stones with wavy faces in the plane x = 0, which move by (1, 3, -2) mm.
/// let moved = Vector3::new(0.001, 0.003, -0.002);
/// let pair = |k: u32| {
///     let centroid = Point3::new(0.0, 0.3 * f64::from(k % 4), 0.2 * f64::from(k / 4));
///     let scan = |start: f64, by: Vector3<f64>| {
///         let point = |i: u32| {
///             let (y, z) = ((start + 0.618034 * f64::from(i)).fract(), (start + 0.754878 * f64::from(i)).fract());
///             let (y, z) = (0.2 * y - 0.1, 0.16 * z - 0.08);
///             let noise = 0.002 * ((start + 0.414214 * f64::from(i)).fract() - 0.5);
///             let relief = 0.004 * ((50.0 * y).sin() + (43.0 * z).cos());
///             centroid + Vector3::new(relief + noise, y, z) + by
///         };
///         Cloud::from_world(centroid, (0..600).map(point))
///     };
///     PairPoints {
///         first: StoneId(k),
///         second: StoneId(k),
///         centroid,
///         centroid_second: centroid + moved,
///         normal: Vector3::x(),
///         points_first: scan(0.0, Vector3::zeros()),
///         points_second: scan(0.3, moved),
///         nearby_second: Cloud::new(centroid, Vec::new()),
///         window: None,
///     }
/// };
/// let pairs = MemoryPairs::new((1..=12).map(pair).collect());
/// let report = adjust(&pairs, &AdjustmentParams::default(), &Silent)?;
/// assert!((report.common_motion - moved).norm() < 3e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A batch cannot be read, the caller stopped the work, or the equations cannot be factored.
pub fn adjust<S: PairSource>(
    source: &S,
    params: &AdjustmentParams,
    progress: &dyn Progress,
) -> Result<AdjustmentReport, AdjustError<S::Error>> {
    adjust_with_photos(source, None, params, progress)
}

/// Estimates the motions as [`adjust`] does, from photos too where there are any: once the clouds have brought the
/// stones about where they are, each is tracked from photo to photo, and what the photos show joins what the points
/// show.
///
/// # Errors
/// As [`adjust`], and where parts of photos cannot be read.
pub fn adjust_with_photos<S: PairSource>(
    source: &S,
    photos: Option<&dyn PhotoSource<S::Error>>,
    params: &AdjustmentParams,
    progress: &dyn Progress,
) -> Result<AdjustmentReport, AdjustError<S::Error>> {
    let surveyed = Surveyed::new(survey(source, params, progress)?, params)?;
    if surveyed.is_empty() {
        return Ok(surveyed.report());
    }
    let mut settled = surveyed.align()?.probe()?.track(photos)?.weigh()?.settle()?;
    while settled.part_along_crack() || settled.loosen_zone() {
        settled = settled.weigh()?.settle()?;
    }
    Ok(settled.report())
}
