//! Nearest partners of moving points, sought again only where they can have changed.

use super::block::GicpBlock;
use nalgebra::{Point3, Vector3};

/// The partner of one point, and how far the point may move before another can be nearer.
#[derive(Clone, Copy)]
pub(super) struct Partner {
    nearest: Option<u32>,
    asked_at: Point3<f64>,
    safe_m: f64,
}

impl Partner {
    /// Not sought yet.
    pub(super) fn unknown() -> Self {
        Self {
            nearest: None,
            asked_at: Point3::origin(),
            safe_m: -1.0,
        }
    }

    /// Index of the nearest point of `block` within `max_m` of `at` (in the block's frame), and the way to
    /// it.
    ///
    /// The answer is that of a fresh search: while a point has moved by less than half the difference between its
    /// two smallest distances, the nearest stays the nearest.
    pub(super) fn find(
        &mut self,
        block: &GicpBlock,
        at: &Point3<f64>,
        max_m: f64,
    ) -> Option<(usize, Vector3<f64>)> {
        if (at - self.asked_at).norm() >= self.safe_m {
            self.seek(block, at, max_m);
        }
        let nearest = self.nearest? as usize;
        let way = block.points[nearest] - at;
        (way.norm_squared() <= max_m * max_m).then_some((nearest, way))
    }

    /// Whether the result of [`find`](Self::find) at a place (a partner or none) stays the same wherever the
    /// point moves within `reach_m`.
    pub(super) fn stays(
        &self,
        found: Option<(usize, Vector3<f64>)>,
        at: &Point3<f64>,
        reach_m: f64,
        max_m: f64,
    ) -> bool {
        let within = found.map_or(self.nearest.is_none(), |(_, way)| way.norm() + reach_m < max_m);
        within && (at - self.asked_at).norm() + reach_m < self.safe_m
    }

    fn seek(&mut self, block: &GicpBlock, at: &Point3<f64>, max_m: f64) {
        // A point known to be near bounds the search; a little more shows the second nearest. Where there is
        // none within `max_m`, a little more shows how far the point may go until there is.
        let slack = 0.5 * block.spacing_m;
        let farthest = max_m + slack;
        let mut radius = match self.nearest {
            Some(known) => (block.points[known as usize] - at).norm() + slack,
            None => block.spacing_m,
        }
        .min(farthest);
        self.asked_at = *at;

        loop {
            let (mut first, mut second) = ((f64::INFINITY, u32::MAX), radius * radius);
            block.index.within(at, radius, |i, d2| {
                let candidate = (d2, i as u32);
                if candidate < first {
                    second = second.min(first.0);
                    first = candidate;
                } else {
                    second = second.min(d2);
                }
            });
            if first.0.is_finite() {
                self.nearest = Some(first.1);
                self.safe_m = 0.5 * (second.sqrt() - first.0.sqrt());
                return;
            }
            if radius >= farthest {
                self.nearest = None;
                self.safe_m = slack;
                return;
            }
            radius = (2.0 * radius).min(farthest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::GicpParams;
    use super::*;
    use crate::cloud::Cloud;
    use rand::{RngExt, SeedableRng};

    /// Points that wander over and beyond the border of a rough patch, in small steps and in jumps.
    #[test]
    fn partners_of_moving_points_are_the_nearest_of_all() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(17);
        let patch =
            (0..1500).map(|_| Point3::from([0.3, 0.3, 0.01].map(|side: f64| rng.random_range(-side..side))));
        let cloud = Cloud::from_world(Point3::origin(), patch.collect::<Vec<_>>());
        let block = GicpBlock::new(&cloud, &GicpParams::default());
        let (max_m, reach_m) = (0.05, 0.002);
        let nearest = |at: &Point3<f64>| {
            let distances = block.points.iter().map(|p| (p - at).norm_squared());
            let least = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            least.filter(|n| n.1 <= max_m * max_m).map(|n| n.0)
        };
        let (mut none, mut stayed, mut sure_without) = (0, 0, 0);
        for _ in 0..60 {
            let mut draw = |side: f64| rng.random_range(-side..side);
            let mut partner = Partner::unknown();
            let mut at = Point3::new(draw(0.4), draw(0.4), draw(0.02));
            for step in 0..60 {
                let side = if step % 20 == 19 { 0.05 } else { 0.001 };
                at += Vector3::new(draw(side), draw(side), draw(side));
                let found = partner.find(&block, &at, max_m);
                assert_eq!(found.map(|f| f.0), nearest(&at));
                none += usize::from(found.is_none());
                if partner.stays(found, &at, reach_m, max_m) {
                    stayed += 1;
                    sure_without += usize::from(found.is_none());
                    let away = Vector3::new(draw(1.0), draw(1.0), draw(1.0)).normalize() * (0.99 * reach_m);
                    assert_eq!(nearest(&(at + away)), found.map(|f| f.0));
                }
            }
        }
        assert!(
            none > 300 && stayed > 300 && sure_without > 100,
            "{none} {stayed} {sure_without}"
        );
    }
}
