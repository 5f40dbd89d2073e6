//! Multiscale model to model cloud comparison.

use crate::change::spread::{Summary, mean_and_deviation, median_and_range};
use crate::change::{ChangeField, ChangePoint, CorePoint, M3c2Params};
use crate::cloud::{Cylinder, GridIndex};
use rayon::prelude::*;

/// Half-width of a 95 % interval of the normal distribution, in standard deviations.
const Z95: f64 = 1.96;

/// Signed distances from the first to the second cloud along given normals, with detection limits.
///
/// At each core point a cylinder along the normal collects the points of either cloud; the distance is the
/// difference of their mean (or median) positions along the normal, and
/// LoD95 = 1.96 (sqrt(s1^2 / n1 + s2^2 / n2) + reg). A cylinder ends `max_depth_m` before and behind the core
/// point, border included. One entry for each core point; without a normal there is no distance.
///
/// Source: Lague, Brodu & Leroux (2013), equation 1. Cost: core points x points per cylinder. The cells of
/// the indices are best as large as the cylinder's radius.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use stonewise_core::change::{CorePoint, M3c2Params, m3c2};
/// use stonewise_core::cloud::GridIndex;
///
/// let plane = |x: f64| -> Vec<Point3<f64>> {
///     (0..400).map(|i| Point3::new(x, 0.02 * f64::from(i % 20), 0.02 * f64::from(i / 20))).collect()
/// };
/// let params = M3c2Params::default();
/// let index = |points: &[Point3<f64>]| GridIndex::new(points, params.cylinder_radius_m);
/// let (first, second) = (index(&plane(0.0)), index(&plane(0.005)));
/// let core = CorePoint { position: Point3::new(0.0, 0.2, 0.2), normal: Some(Vector3::x()) };
/// let field = m3c2(&first, &second, &[core], &params);
/// assert!((field.points[0].distance_m.unwrap() - 0.005).abs() < 1e-12);
/// ```
pub fn m3c2(
    first: &GridIndex,
    second: &GridIndex,
    core_points: &[CorePoint],
    params: &M3c2Params,
) -> ChangeField {
    let points = core_points
        .par_iter()
        .map_init(Vec::new, |scratch, &CorePoint { position, normal }| {
            let Some(normal) = normal else {
                return ChangePoint::without_normal(position);
            };
            let cylinder = Cylinder {
                centre: position,
                axis: normal,
                radius_m: params.cylinder_radius_m,
                half_length_m: params.max_depth_m,
            };
            let (summary_1, count_1) = look_along(first, &cylinder, params, scratch);
            let (summary_2, count_2) = look_along(second, &cylinder, params, scratch);
            let counts = [count_1, count_2];
            let spread_m = [&summary_1, &summary_2].map(|s| s.as_ref().and_then(|s| s.spread_m));
            ChangePoint {
                position,
                normal,
                distance_m: summary_1.zip(summary_2).map(|(a, b)| b.location_m - a.location_m),
                detection_limit_m: detection_limit(spread_m, counts, params),
                spread_m,
                counts,
            }
        })
        .collect();

    ChangeField { points }
}

fn look_along(
    cloud: &GridIndex,
    cylinder: &Cylinder,
    params: &M3c2Params,
    scratch: &mut Vec<f64>,
) -> (Option<Summary>, u32) {
    scratch.clear();
    cloud.within_cylinder(cylinder, |_, along| scratch.push(along));
    let summary = if params.robust {
        median_and_range(scratch)
    } else {
        mean_and_deviation(scratch, params.ddof)
    };
    (summary, scratch.len() as u32)
}

fn detection_limit(spread_m: [Option<f64>; 2], counts: [u32; 2], params: &M3c2Params) -> Option<f64> {
    if counts.iter().any(|&n| n < params.min_points) {
        return None;
    }
    let [first, second] = variances_of_means(spread_m, counts)?;
    Some(Z95 * ((first + second).sqrt() + params.registration_error_m))
}

/// Variances of the mean positions along the normal, s^2 / n; `None` where a spread is missing.
pub(super) fn variances_of_means(spread_m: [Option<f64>; 2], counts: [u32; 2]) -> Option<[f64; 2]> {
    let [s1, s2] = [spread_m[0]?, spread_m[1]?];
    let [n1, n2] = counts.map(f64::from);
    Some([s1 * s1 / n1, s2 * s2 / n2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    /// A level grid of 11 x 11 points, 2 cm apart, at these heights in turn.
    fn sheet(heights: &[f64]) -> Vec<Point3<f64>> {
        (0..121)
            .map(|i| {
                let (x, y) = (0.02 * f64::from(i % 11 - 5), 0.02 * f64::from(i / 11 - 5));
                Point3::new(x, y, heights[i as usize % heights.len()])
            })
            .collect()
    }

    fn compare(first: &[f64], second: &[f64], params: &M3c2Params) -> ChangePoint {
        let clouds = [first, second].map(|h| GridIndex::new(&sheet(h), 0.05));
        let core = CorePoint {
            position: Point3::origin(),
            normal: Some(Vector3::z()),
        };
        m3c2(&clouds[0], &clouds[1], &[core], params).points[0]
    }

    #[test]
    fn a_level_shift_is_measured_by_hand() {
        // Radius 5 cm on a 2 cm grid holds the 21 nodes with i^2 + j^2 <= 6.25.
        let params = M3c2Params {
            registration_error_m: 0.001,
            ..M3c2Params::default()
        };
        let flat = compare(&[0.0], &[0.03], &params);
        assert_eq!(flat.counts, [21, 21]);
        assert!((flat.distance_m.unwrap() - 0.03).abs() < 1e-15);
        assert!((flat.detection_limit_m.unwrap() - 1.96 * 0.001).abs() < 1e-12);
        assert!(flat.is_significant());
        assert!((flat.displacement().unwrap() - Vector3::new(0.0, 0.0, 0.03)).norm() < 1e-15);
    }

    #[test]
    fn spread_and_limit_follow_the_equation() {
        // A checkerboard of heights: of the 21 nodes the 9 with an even i + j are up.
        let point = compare(&[0.01, -0.01], &[0.0], &M3c2Params::default());
        let up = 9.0;
        let mean = (up * 0.01 - (21.0 - up) * 0.01) / 21.0;
        let variance = (21.0 * 0.0001 - 21.0 * mean * mean) / 20.0;
        assert!((point.distance_m.unwrap() + mean).abs() < 1e-15);
        assert!((point.spread_m[0].unwrap() - variance.sqrt()).abs() < 1e-15);
        let limit = 1.96 * (variance / 21.0).sqrt();
        assert!((point.detection_limit_m.unwrap() - limit).abs() < 1e-15);
        assert!(!point.is_significant());
    }

    #[test]
    fn what_lies_beyond_the_depth_is_not_seen() {
        let params = M3c2Params {
            max_depth_m: 0.02,
            ..M3c2Params::default()
        };
        let edge = compare(&[0.0], &[0.02], &params);
        assert_eq!(edge.counts, [21, 21]);
        let beyond = compare(&[0.0], &[0.0201], &params);
        assert_eq!((beyond.counts, beyond.distance_m), ([21, 0], None));
        assert!(!beyond.is_significant());
    }

    #[test]
    fn the_median_ignores_a_stray_height() {
        let mut heights = vec![0.0; 121];
        heights[60] = 0.2;
        let robust = M3c2Params {
            robust: true,
            ..M3c2Params::default()
        };
        assert_eq!(compare(&[0.0], &heights, &robust).distance_m, Some(0.0));
        let mean = compare(&[0.0], &heights, &M3c2Params::default())
            .distance_m
            .unwrap();
        assert!((mean - 0.2 / 21.0).abs() < 1e-15);
    }
}
