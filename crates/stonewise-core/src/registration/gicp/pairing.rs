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
    /// The same as a fresh search: while a point has moved by less than half the difference between its two
    /// smallest distances, the nearest stays the nearest.
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

    fn seek(&mut self, block: &GicpBlock, at: &Point3<f64>, max_m: f64) {
        // A point known to be near bounds the search; a little more shows the second nearest.
        let slack = 0.5 * block.spacing_m;
        let mut radius = match self.nearest {
            Some(known) => (block.points[known as usize] - at).norm() + slack,
            None => 2.0 * block.spacing_m,
        }
        .min(max_m);
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
            if radius >= max_m {
                self.nearest = None;
                self.safe_m = -1.0;
                return;
            }
            radius = (2.0 * radius).min(max_m);
        }
    }
}
