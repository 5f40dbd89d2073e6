//! Cloud to cloud distances.

use crate::cloud::GridIndex;
use nalgebra::Point3;
use rayon::prelude::*;

/// Distance from each point to the nearest point of the reference cloud, metres; `None` beyond `max_m`.
///
/// Unsigned, and never smaller than the reference's spacing allows: points that lie between reference points
/// are some way off even without change. Cost: points x reference points within the distance found.
pub fn c2c(reference: &GridIndex, points: &[Point3<f64>], max_m: f64) -> Vec<Option<f64>> {
    points
        .par_iter()
        .map(|p| reference.nearest(p, max_m).map(|(_, d2)| d2.sqrt()))
        .collect()
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
}
