//! How the surroundings of stones moved, from their centroids alone.

use crate::cloud::GridIndex;
use crate::geometry::Bounds;
use crate::statistics::component_median;
use nalgebra::{Point3, Vector3};

/// Neighbours whose shifts, in the median, give the shift of a place: a ring around the stone, so that one
/// wrong mask does not matter.
const NEIGHBOURS: usize = 12;

/// How the surroundings of each stone moved: the median, component by component, of the shifts of its nearest
/// neighbours and itself. `stones`: the centroid and the shift of each.
pub fn local_shifts(stones: &[(Point3<f64>, Vector3<f64>)]) -> Vec<Vector3<f64>> {
    let centroids: Vec<Point3<f64>> = stones.iter().map(|s| s.0).collect();
    let Some(bounds) = Bounds::of(centroids.iter().copied()) else {
        return Vec::new();
    };
    let extent_m = (bounds.max - bounds.min).norm().max(1e-3);
    let index = GridIndex::new(&centroids, 2.0 * extent_m / (centroids.len() as f64).sqrt());
    centroids
        .iter()
        .map(|c| {
            let near = index.nearest_k(c, NEIGHBOURS, extent_m);
            component_median(&near.iter().map(|(j, _)| stones[*j].1).collect::<Vec<_>>())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_shift_does_not_move_a_stone_away_from_its_neighbours() {
        let shift = Vector3::new(0.0, 0.02, 0.05);
        let place = |k: i32| Point3::new(0.0, 0.3 * f64::from(k % 8), 0.2 * f64::from(k / 8));
        let mut stones: Vec<_> = (0..40).map(|k| (place(k), shift)).collect();
        stones[17].1 = Vector3::new(0.0, 0.3, 0.0);
        assert_eq!(local_shifts(&stones), vec![shift; 40]);
    }
}
