//! The point of a triangle that is nearest to a given point.

use nalgebra::Point3;

/// The part of a triangle on which the nearest point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Feature {
    /// The corner with this index.
    Corner(usize),
    /// The edge from this corner to the next.
    Edge(usize),
    /// The inside.
    Face,
}

/// The nearest point of a triangle with an area, and the part it lies on.
pub(super) fn nearest_on_triangle(p: &Point3<f64>, corners: &[Point3<f64>; 3]) -> (Point3<f64>, Feature) {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    // Outside of an edge's plane the nearest point is on that edge or on another one; never inside.
    let outside = |i: usize| {
        let (from, to) = (corners[i], corners[(i + 1) % 3]);
        normal.cross(&(to - from)).dot(&(p - from)) < 0.0
    };
    if (0..3).any(outside) {
        let candidates = [0, 1, 2].map(|i| nearest_on_edge(p, corners, i));
        let mut best = candidates[0];
        for candidate in &candidates[1..] {
            if (candidate.0 - p).norm_squared() < (best.0 - p).norm_squared() {
                best = *candidate;
            }
        }
        best
    } else {
        let height = (p - a).dot(&normal) / normal.norm_squared();
        (p - normal * height, Feature::Face)
    }
}

fn nearest_on_edge(p: &Point3<f64>, corners: &[Point3<f64>; 3], i: usize) -> (Point3<f64>, Feature) {
    let next = (i + 1) % 3;
    let edge = corners[next] - corners[i];
    let t = (p - corners[i]).dot(&edge) / edge.norm_squared();
    if t <= 0.0 {
        (corners[i], Feature::Corner(i))
    } else if t >= 1.0 {
        (corners[next], Feature::Corner(next))
    } else {
        (corners[i] + edge * t, Feature::Edge(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn no_sampled_point_of_the_triangle_is_nearer() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut features = std::collections::BTreeMap::new();
        for _ in 0..200 {
            let mut point = || Point3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
            let (corners, p) = ([point(), point(), point()], point());
            let (nearest, feature) = nearest_on_triangle(&p, &corners);
            *features
                .entry(format!("{feature:?}")[..4].to_owned())
                .or_insert(0) += 1;
            let distance = (nearest - p).norm();
            let mut sampled = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (s, t) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let q = corners[0] + (corners[1] - corners[0]) * s + (corners[2] - corners[0]) * t;
                    sampled = sampled.min((q - p).norm());
                }
            }
            assert!(distance <= sampled + 1e-12 && sampled - distance < 0.05);
        }
        assert_eq!(
            features.len(),
            3,
            "corners, edges and faces must all occur: {features:?}"
        );
    }
}
