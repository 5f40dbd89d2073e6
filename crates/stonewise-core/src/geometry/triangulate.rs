//! Polygons as triangles.

use nalgebra::Point2;

/// Triangles (vertex numbers, counter-clockwise) that cover a simple counter-clockwise polygon.
///
/// Ear clipping (Meisters 1975). A ring that is not simple gives some covering of its vertices; under three
/// vertices there is none. Cost: O(n^2) for the outlines of stones, O(n^3) at worst.
pub fn triangulate(ring: &[Point2<f64>]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..ring.len()).collect();
    let mut triangles = Vec::with_capacity(ring.len().saturating_sub(2));
    while left.len() >= 3 {
        let n = left.len();
        let corner = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        // Only a ring that is not simple has no ear; clipping any corner then still ends.
        let ear = (0..n).find(|&i| is_ear(ring, &left, corner(i))).unwrap_or(0);
        triangles.push(corner(ear));
        left.remove(ear);
    }
    triangles
}

fn is_ear(ring: &[Point2<f64>], left: &[usize], [a, b, c]: [usize; 3]) -> bool {
    let turn = |p: usize, q: usize, r: usize| (ring[q] - ring[p]).perp(&(ring[r] - ring[p]));
    let within = |p: usize| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
    turn(a, b, c) > 0.0 && !left.iter().any(|&p| p != a && p != b && p != c && within(p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{is_simple, signed_area};
    use rand::{RngExt, SeedableRng};

    fn check(ring: &[Point2<f64>]) {
        let triangles = triangulate(ring);
        assert_eq!(triangles.len(), ring.len() - 2);
        let areas: Vec<f64> = triangles
            .iter()
            .map(|t| signed_area(&t.map(|i| ring[i])))
            .collect();
        assert!(areas.iter().all(|a| *a > 0.0));
        assert!((areas.iter().sum::<f64>() / signed_area(ring) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn triangles_cover_a_star_shaped_polygon_exactly() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut tried = 0;
        for n in (5..40).cycle().take(140) {
            let place = |i: usize| {
                let radius = rng.random_range(0.2..1.0);
                let (sin, cos) = (i as f64 * std::f64::consts::TAU / n as f64).sin_cos();
                Point2::new(radius * cos, radius * sin)
            };
            let ring: Vec<_> = (0..n).map(place).collect();
            if is_simple(&ring) {
                tried += 1;
                check(&ring);
            }
        }
        assert!(tried > 100, "{tried}");
    }

    #[test]
    fn few_vertices_have_no_triangles_and_a_bow_tie_ends() {
        let p = Point2::new;
        assert!(triangulate(&[p(0.0, 0.0), p(1.0, 0.0)]).is_empty());
        assert_eq!(
            triangulate(&[p(0.0, 0.0), p(1.0, 1.0), p(1.0, 0.0), p(0.0, 1.0)]).len(),
            2
        );
    }
}
