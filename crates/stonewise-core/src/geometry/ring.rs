//! Closed polygons: their area, fewer vertices for them, and whether they cross themselves.

use nalgebra::Point2;

/// Area of a polygon, positive where it runs from x to y: counter-clockwise, or clockwise on a screen, where y points
/// down (the shoelace formula).
pub fn signed_area<P: Copy + Into<Point2<f64>>>(ring: &[P]) -> f64 {
    let Some(&base) = ring.first() else { return 0.0 };
    let arm = |i: usize| ring[i % ring.len()].into() - base.into();
    (0..ring.len()).map(|i| arm(i).perp(&arm(i + 1))).sum::<f64>() / 2.0
}

/// A ring without the vertices that lie nearer than `tolerance` to the sides between those kept.
///
/// Douglas & Peucker (1973), on the two parts between the vertex of smallest x and the one farthest from it. Cost:
/// O(n log n) for most rings, O(n^2) at worst.
pub fn simplify_ring<P: Copy + Into<Point2<f64>>>(ring: &[P], tolerance: f64) -> Vec<P> {
    let n = ring.len();
    let place = |i: usize| -> Point2<f64> { ring[i].into() };
    let Some(first) = (0..n).min_by(|&a, &b| place(a).x.total_cmp(&place(b).x)) else {
        return Vec::new();
    };
    let rotated: Vec<Point2<f64>> = (0..=n).map(|i| place((first + i) % n)).collect();
    let away = |i: usize| (rotated[i] - rotated[0]).norm();
    let far = (0..n).max_by(|&a, &b| away(a).total_cmp(&away(b))).unwrap_or(0);
    let mut keep = vec![false; n + 1];
    keep[0] = true;
    keep[far] = true;
    let mut open = vec![(0, far), (far, n)];
    while let Some((from, to)) = open.pop() {
        let distance = |i: usize| distance_to_segment(&rotated[i], &rotated[from], &rotated[to]);
        let worst = (from + 1..to).max_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        if let Some(worst) = worst.filter(|&i| distance(i) > tolerance) {
            keep[worst] = true;
            open.extend([(from, worst), (worst, to)]);
        }
    }
    (0..n)
        .filter(|&i| keep[i])
        .map(|i| ring[(first + i) % n])
        .collect()
}

fn distance_to_segment(p: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let (ab, ap) = (b - a, p - a);
    let along = if ab.norm_squared() > 0.0 {
        (ap.dot(&ab) / ab.norm_squared()).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (ap - ab * along).norm()
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

    #[test]
    fn a_stepped_diagonal_becomes_straight_and_corners_stay() {
        let mut ring: Vec<[f64; 2]> = vec![[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]];
        ring.extend((1..20).flat_map(|i| {
            let v = 20.0 - f64::from(i);
            [[v, v + 1.0], [v, v]]
        }));
        assert_eq!(simplify_ring(&ring, 0.9), [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]]);
        assert_eq!(simplify_ring(&ring, 0.1).len(), ring.len());
        assert!(simplify_ring::<[f64; 2]>(&[], 1.0).is_empty());
        // Half the square, and the halves of the steps' squares.
        assert_eq!(signed_area(&ring), 200.0 + 19.0 * 0.5);
    }
}
