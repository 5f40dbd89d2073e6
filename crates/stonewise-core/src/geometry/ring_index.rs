//! Closed polygons, indexed for queries about many points.

use super::ring::crosses;
use nalgebra::Point2;
use std::ops::RangeInclusive;

/// Polygons that do not overlap, with their sides sorted into bands of y, so that a point is compared with the
/// few sides near it.
#[derive(Clone, Debug)]
pub struct RingIndex {
    low_y: f64,
    bands_per_m: f64,
    /// The sides that touch each band; there are as many bands as sides. Points below or above all bands belong
    /// to the first or last.
    bands: Vec<Vec<Side>>,
}

/// A side of a polygon from one corner to the next.
type Side = [Point2<f64>; 2];

impl RingIndex {
    /// The last side of each ring goes back to its first corner. Cost: sides times the bands that they touch.
    pub fn new(rings: &[Vec<Point2<f64>>]) -> Self {
        let low_y = rings.iter().flatten().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let high_y = rings
            .iter()
            .flatten()
            .map(|p| p.y)
            .fold(f64::NEG_INFINITY, f64::max);
        let count = rings.iter().flatten().count().max(1);
        let mut index = Self {
            low_y,
            bands_per_m: count as f64 / (high_y - low_y).max(f64::MIN_POSITIVE),
            bands: vec![Vec::new(); count],
        };
        let sides = rings
            .iter()
            .flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
        for (a, b) in sides {
            let touched = index.bands_between(a.y.min(b.y), a.y.max(b.y));
            for band in &mut index.bands[touched] {
                band.push([*a, *b]);
            }
        }
        index
    }

    /// Whether a point lies inside a ring: the same answer as [`ring_contains`](super::ring_contains).
    pub fn contains(&self, p: &Point2<f64>) -> bool {
        let sides = self.bands[self.band_at(p.y)].iter();
        sides.filter(|[a, b]| crosses(p, a, b)).count() % 2 == 1
    }

    /// Whether a point, inside or outside, is nearer to a side than `reach`.
    pub fn passes_within(&self, reach: f64, p: &Point2<f64>) -> bool {
        let is_close = |[a, b]: &Side| {
            let beside = p.x < a.x.min(b.x) - reach || p.x > a.x.max(b.x) + reach;
            !beside && distance_to_side(p, a, b) < reach
        };
        let near = self.bands_between(p.y - reach, p.y + reach);
        self.bands[near].iter().flatten().any(is_close)
    }

    fn band_at(&self, y: f64) -> usize {
        // The cast turns negative values into 0, the first band.
        (((y - self.low_y) * self.bands_per_m) as usize).min(self.bands.len() - 1)
    }

    fn bands_between(&self, low_y: f64, high_y: f64) -> RangeInclusive<usize> {
        self.band_at(low_y)..=self.band_at(high_y)
    }
}

fn distance_to_side(p: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let side = b - a;
    let t = ((p - a).dot(&side) / side.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (p - (a + side * t)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ring_contains;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A star with many corners, some of the same height.
    fn star(corners: usize) -> Vec<Point2<f64>> {
        let corner = |i: usize| {
            let angle = std::f64::consts::TAU * i as f64 / corners as f64;
            let radius = if i.is_multiple_of(2) { 1.0 } else { 0.4 };
            Point2::new(3.0 + radius * angle.cos(), -2.0 + radius * angle.sin())
        };
        (0..corners).map(corner).collect()
    }

    #[test]
    fn answers_are_those_of_all_sides() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let flat = vec![Point2::new(3.0, -2.0); 3];
        let beside = [[4.1, -2.5], [4.4, -2.5], [4.4, -1.9]].map(Point2::from);
        let cases = [
            (vec![star(3)], true),
            (vec![star(60), beside.to_vec()], true),
            (vec![flat], false),
            (Vec::new(), false),
        ];
        for (rings, has_area) in cases {
            let index = RingIndex::new(&rings);
            let sides: Vec<Side> = rings
                .iter()
                .flat_map(|ring| (0..ring.len()).map(|i| [ring[i], ring[(i + 1) % ring.len()]]))
                .collect();
            let mut inside = 0;
            for k in 0..4000 {
                let mut p = Point2::new(rng.random_range(1.5..4.5), rng.random_range(-3.5..-0.5));
                if let Some([corner, _]) = sides.get(k) {
                    p.y = corner.y;
                }
                // An independent estimate of the distance: the nearest of 1001 points along each side.
                let nearest = sides
                    .iter()
                    .flat_map(|[a, b]| {
                        (0..=1000).map(move |t| (a + (b - a) * (f64::from(t) / 1000.0) - p).norm())
                    })
                    .fold(f64::INFINITY, f64::min);
                let reach = 0.1;
                if (nearest - reach).abs() > 1e-3 {
                    assert_eq!(index.passes_within(reach, &p), nearest < reach, "{p}");
                }
                let is_inside = rings.iter().any(|ring| ring_contains(ring, &p));
                assert_eq!(index.contains(&p), is_inside, "{p}");
                inside += usize::from(index.contains(&p));
            }
            assert_eq!(inside > 100, has_area, "{inside}");
        }
    }
}
