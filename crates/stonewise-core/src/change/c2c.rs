//! Cloud to cloud distances.

use crate::cloud::{Candidates, GridIndex};
use nalgebra::Point3;
use rayon::prelude::*;

/// Distance from each point to the nearest point of the reference cloud, metres; `None` beyond `max_m`.
///
/// Unsigned, and never smaller than the reference's spacing allows: points that lie between reference points
/// are some way off even without change. Cost: points x reference points within the distance found.
pub fn c2c(reference: &GridIndex, points: &[Point3<f64>], max_m: f64) -> Vec<Option<f64>> {
    let is_ordered = is_ordered(reference, points);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let place = |i: &u32| reference.place_of(&points[*i as usize]);
    // Points in no order wait for memory at every search; sorted by their place they do not.
    if !is_ordered {
        order.par_sort_by_cached_key(place);
    }
    let of_chunk = |order: &mut [u32]| {
        if is_ordered {
            order.sort_by_cached_key(place);
        }
        let mut candidates = Candidates::new(reference);
        let mut of_point = |i: u32| (i, candidates.nearest(&points[i as usize], max_m).map(f64::sqrt));
        order.iter().map(|i| of_point(*i)).collect::<Vec<_>>()
    };
    let found: Vec<Vec<(u32, Option<f64>)>> = order.par_chunks_mut(CHUNK).map(of_chunk).collect();
    let mut distances = vec![None; points.len()];
    for (i, distance) in found.into_iter().flatten() {
        distances[i as usize] = distance;
    }
    distances
}

/// Number of points that a thread processes at a time, cube by cube: a few columns of a scan, few enough to stay in the
/// processor's cache.
const CHUNK: usize = 16_384;
/// Pairs of consecutive points that show whether points come in an order.
const ORDER_SAMPLES: usize = 1000;

/// Whether most points follow one in the same or a neighbouring block of the index, as scanners write them.
fn is_ordered(reference: &GridIndex, points: &[Point3<f64>]) -> bool {
    let pairs = points.windows(2).step_by(points.len() / ORDER_SAMPLES + 1);
    let (mut near, mut all) = (0, 0);
    for pair in pairs {
        let [a, b] = [0, 1].map(|i| i64::from(reference.place_of(&pair[i]).0));
        near += usize::from((a - b).abs() <= 1);
        all += 1;
    }
    2 * near > all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_nearest_point_up_to_the_limit() {
        let reference: Vec<_> = (0..10).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        let index = GridIndex::new(&reference, 0.7);
        let points = [
            Point3::new(2.3, 0.4, 0.0),
            Point3::new(-3.0, 0.0, 4.0),
            Point3::new(4.0, 0.0, 0.0),
        ];
        let distances = c2c(&index, &points, 2.0);
        assert!((distances[0].unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(distances[1..], [None, Some(0.0)]);
        assert_eq!(c2c(&index, &points, 5.0)[1], Some(5.0));
    }
    #[test]
    fn the_order_of_the_points_does_not_matter() {
        let wave = |i: usize, shift: f64| {
            let (x, z) = (0.01 * (i / 100) as f64, 0.01 * (i % 100) as f64);
            Point3::new(x, 0.1 * (7.0 * x).sin() + shift, z)
        };
        let reference: Vec<_> = (0..10_000).map(|i| wave(i, 0.0)).collect();
        let points: Vec<_> = (0..10_000).map(|i| wave(i, 0.013)).collect();
        let index = GridIndex::for_nearest(&reference);
        let ordered = c2c(&index, &points, 0.1);
        assert!(is_ordered(&index, &points));
        let shuffle = |i: usize| 7919 * i % 10_000;
        let shuffled: Vec<_> = (0..10_000).map(|i| points[shuffle(i)]).collect();
        assert!(!is_ordered(&index, &shuffled));
        for (i, distance) in c2c(&index, &shuffled, 0.1).into_iter().enumerate() {
            assert_eq!(distance, ordered[shuffle(i)]);
        }
        for i in (0..10_000).step_by(501) {
            let brute = reference
                .iter()
                .map(|r| (r - points[i]).norm())
                .fold(f64::INFINITY, f64::min);
            assert!((ordered[i].unwrap() - brute).abs() < 1e-15);
        }
    }
}
