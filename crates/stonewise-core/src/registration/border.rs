//! Points of a stone away from the border of its mask.

use crate::cloud::GridIndex;
use crate::geometry::{FaceFrame, OutlineParams, outline, signed_area};
use nalgebra::{Point2, Point3, Vector3};

/// The border is at most this share of the square root of a stone's area, so that small stones keep a core.
const LARGEST_SHARE: f64 = 0.12;
/// Points of a stone on which its noise is measured.
const NOISE_SAMPLES: usize = 300;

/// The points that lie farther inside the outline of all of them, seen along `normal`, than `border_noises` times their
/// noise along the normal; in their order.
///
/// Whether a noisy point near the border of a stone gets its label depends on its noise, and on where the photos that
/// voted stood: the heights at the border are biased, differently in every epoch. All points stay where no outline can
/// be found.
pub fn inner_points(points: Vec<[f32; 3]>, normal: &Vector3<f64>, border_noises: f64) -> Vec<[f32; 3]> {
    let frame = FaceFrame::from_normal(normal);
    let local: Vec<Point3<f64>> = points
        .iter()
        .map(|p| Point3::from(frame.face_from_world() * Vector3::from(p.map(f64::from))))
        .collect();
    let flat: Vec<Point2<f64>> = local.iter().map(|p| p.xy()).collect();
    let Some(ring) = outline(&flat, &OutlineParams::default()) else {
        return points;
    };
    let size_m = signed_area(&ring).abs().sqrt();
    let border_m = (border_noises * noise_m(&local, size_m)).min(LARGEST_SHARE * size_m);
    let inside = |p: &Point2<f64>| is_inside(&ring, p) && distance_to_ring(&ring, p) > border_m;
    points
        .into_iter()
        .zip(&flat)
        .filter(|(_, p)| inside(p))
        .map(|(point, _)| point)
        .collect()
}

/// Noise along z of points of a face of `size_m`: the median difference of neighbours that are nearest in x and y.
///
/// Relief within one point spacing counts as noise; on terrestrial scans that is about as much as the scanner's.
fn noise_m(local: &[Point3<f64>], size_m: f64) -> f64 {
    let flat: Vec<Point3<f64>> = local.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
    let index = GridIndex::new(&flat, 2.0 * size_m / (flat.len() as f64).sqrt());
    let mut differences: Vec<f64> = (0..flat.len())
        .step_by((flat.len() / NOISE_SAMPLES).max(1))
        .filter_map(|i| {
            let near = index.nearest_k(&flat[i], 2, size_m);
            let other = near.iter().find(|(j, _)| *j != i)?.0;
            Some((local[i].z - local[other].z).abs())
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    // The median of |a - b| is 0.954 standard deviations of a.
    differences
        .get(differences.len() / 2)
        .map_or(0.0, |median| median / 0.954)
}

fn edges(ring: &[Point2<f64>]) -> impl Iterator<Item = (&Point2<f64>, &Point2<f64>)> {
    ring.iter().zip(ring.iter().cycle().skip(1))
}

/// Even-odd rule.
fn is_inside(ring: &[Point2<f64>], p: &Point2<f64>) -> bool {
    let crossings = edges(ring)
        .filter(|(a, b)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x));
    crossings.count() % 2 == 1
}

fn distance_to_ring(ring: &[Point2<f64>], p: &Point2<f64>) -> f64 {
    let to_edge = |(a, b): (&Point2<f64>, &Point2<f64>)| {
        let edge = b - a;
        let t = ((p - a).dot(&edge) / edge.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p - (a + edge * t)).norm()
    };
    edges(ring).map(to_edge).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 0.4 m with points every 4 mm and heights from a fixed sequence of Gaussian numbers.
    fn square(noise_m: f32) -> Vec<[f32; 3]> {
        let mut state = 1u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let mut gauss = || (0..12).map(|_| uniform()).sum::<f32>() - 6.0;
        (0..10_000)
            .map(|i| {
                [
                    noise_m * gauss(),
                    (i % 100) as f32 * 0.004,
                    (i / 100) as f32 * 0.004,
                ]
            })
            .collect()
    }

    #[test]
    fn a_square_loses_a_border_of_its_noise_and_nothing_else() {
        let kept = inner_points(square(0.01), &Vector3::x(), 2.0);
        // 0.4 m less 2 cm on either side; the noise is known to a tenth.
        let side = (kept.len() as f64).sqrt() * 0.004;
        assert!((side - 0.36).abs() < 0.01, "{side}");
        assert!(kept.iter().all(|p| p[1] > 0.013 && p[1] < 0.383));
    }

    #[test]
    fn small_stones_keep_a_core_and_zero_keeps_all_inside_the_outline() {
        let points = square(0.01);
        assert!(inner_points(points.clone(), &Vector3::x(), 1000.0).len() > 5_000);
        assert!(inner_points(points, &Vector3::x(), 0.0).len() > 9_700);
        let few = vec![[0.0, 0.0, 0.0], [0.0, 0.1, 0.0]];
        assert_eq!(inner_points(few.clone(), &Vector3::x(), 2.0), few);
    }
}
