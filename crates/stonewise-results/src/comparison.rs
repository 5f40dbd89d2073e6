//! Stones against the M3C2 core points on them.

use super::{ResultSet, Sorted, Squares, StoneRow};
use nalgebra::Point2;

/// M3C2 distances and displacements, for comparison with the motions of the stones.
pub struct Comparison {
    /// Median M3C2 distance on each stone, metres, in the order of [`ResultSet::stones`]; `None` without core
    /// points.
    pub on_stone: Vec<Option<f64>>,
    /// In-plane components (along, up) of the M3C2 displacement vectors, distance times normal, metres.
    pub in_plane: Vec<[f64; 2]>,
}

/// Compares; empty without core points. A core point belongs to the stone whose outline holds it and
/// whose face is about as deep.
pub fn compare(results: &ResultSet) -> Comparison {
    let mut squares = Squares::default();
    let rings: Vec<Vec<Point2<f64>>> = results.stones.iter().map(|s| results.unrolled(s)).collect();
    for (i, ring) in rings.iter().enumerate() {
        let corner = |of: fn(&Point2<f64>, &Point2<f64>) -> Point2<f64>| {
            ring.iter().copied().reduce(|a, b| of(&a, &b))
        };
        if let (Some(low), Some(high)) = (corner(Point2::inf), corner(Point2::sup)) {
            squares.add(i, &low, &high);
        }
    }

    let mut on_stone: Vec<Vec<f64>> = vec![Vec::new(); rings.len()];
    let mut in_plane = Vec::new();
    for point in &results.distances {
        let place = results.facade.place(&point.position);
        let holds =
            |i: usize| contains(&rings[i], &place) && results.is_at_face(&results.stones[i], &point.position);
        if let Some(&i) = squares.near(&place).iter().find(|&&i| holds(i)) {
            on_stone[i].push(point.distance_m);
        }
        if let Some(normal) = point.normal {
            let frame = results.facade.frame_at(&point.position);
            let d = normal * point.distance_m;
            in_plane.push([d.dot(&frame.along), d.dot(&frame.up)]);
        }
    }

    Comparison {
        on_stone: on_stone.into_iter().map(|d| Sorted::new(d).median()).collect(),
        in_plane,
    }
}

impl Comparison {
    /// Out-of-plane displacement of each measured stone and the median M3C2 distance on it, metres.
    pub fn out_of_plane(&self, results: &ResultSet) -> Vec<[f64; 2]> {
        let pair = |(stone, distance): (&StoneRow, &Option<f64>)| {
            Some([stone.motion.as_ref()?.face.z, (*distance)?])
        };
        results
            .stones
            .iter()
            .zip(&self.on_stone)
            .filter_map(pair)
            .collect()
    }
}

/// Whether a polygon holds a point (crossing number).
fn contains(ring: &[Point2<f64>], p: &Point2<f64>) -> bool {
    let crosses = |a: &Point2<f64>, b: &Point2<f64>| {
        (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    (0..ring.len())
        .filter(|&i| crosses(&ring[i], &ring[(i + 1) % ring.len()]))
        .count()
        % 2
        == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bay_is_outside() {
        let p = Point2::new;
        let ring = [
            p(0.0, 0.0),
            p(3.0, 0.0),
            p(3.0, 2.0),
            p(2.0, 2.0),
            p(2.0, 1.0),
            p(1.0, 1.0),
            p(1.0, 2.0),
            p(0.0, 2.0),
        ];
        assert!(contains(&ring, &p(0.5, 1.5)) && contains(&ring, &p(1.5, 0.5)));
        assert!(!contains(&ring, &p(1.5, 1.5)) && !contains(&ring, &p(4.0, 0.5)));
    }
}
