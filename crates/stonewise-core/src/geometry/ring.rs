//! Closed polygons: their area, and whether they cross themselves.

use nalgebra::Point2;

/// Area of a polygon, positive where it runs counter-clockwise (the shoelace formula).
pub fn signed_area(ring: &[Point2<f64>]) -> f64 {
    let Some(base) = ring.first() else { return 0.0 };
    let cross = |i: usize| (ring[i] - base).perp(&(ring[(i + 1) % ring.len()] - base));
    (0..ring.len()).map(cross).sum::<f64>() / 2.0
}

/// Whether no two sides of the polygon touch, apart from neighbours at their common corner. Cost: O(sides^2).
pub fn is_simple(ring: &[Point2<f64>]) -> bool {
    let n = ring.len();
    let side = |i: usize| (ring[i], ring[(i + 1) % n]);
    n >= 3
        && (0..n).all(|i| {
            (i + 1..n).all(|j| {
                let adjacent = j == i + 1 || (i == 0 && j == n - 1);
                adjacent || !touches(side(i), side(j))
            })
        })
}

/// Whether a point lies inside the polygon: a ray from it crosses an odd number of sides. A point on a side
/// may be either.
pub fn ring_contains(ring: &[Point2<f64>], p: &Point2<f64>) -> bool {
    let is_crossed = |i: &usize| crosses(p, &ring[*i], &ring[(i + 1) % ring.len()]);
    (0..ring.len()).filter(is_crossed).count() % 2 == 1
}

/// Whether the ray from a point along x crosses the side from `a` to `b`.
pub(super) fn crosses(p: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> bool {
    (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
}

/// Whether two segments share a point.
fn touches((a, b): (Point2<f64>, Point2<f64>), (c, d): (Point2<f64>, Point2<f64>)) -> bool {
    let side = |p: &Point2<f64>, q: &Point2<f64>, r: &Point2<f64>| (q - p).perp(&(r - p));
    let (s1, s2, s3, s4) = (
        side(&a, &b, &c),
        side(&a, &b, &d),
        side(&c, &d, &a),
        side(&c, &d, &b),
    );
    let boxes = a.inf(&b).x <= c.sup(&d).x
        && c.inf(&d).x <= a.sup(&b).x
        && a.inf(&b).y <= c.sup(&d).y
        && c.inf(&d).y <= a.sup(&b).y;
    boxes && s1 * s2 <= 0.0 && s3 * s4 <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bow_tie_is_not_simple() {
        let p = |x: f64, y: f64| Point2::new(x, y);
        assert!(is_simple(&[p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]));
        assert!(!is_simple(&[p(0.0, 0.0), p(1.0, 1.0), p(1.0, 0.0), p(0.0, 1.0)]));
    }
}
