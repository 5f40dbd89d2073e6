//! The square on a stone's face that its crops show.

use crate::results::StoneOutline;
use nalgebra::Point3;
use std::collections::BTreeMap;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::stone::Stone;

/// The window is this much wider than the stone.
const MARGIN: f64 = 1.3;
/// Smallest half edge, metres.
const MIN_HALF_M: f64 = 0.08;

/// Where to look at a stone of the first epoch.
#[derive(Clone, Debug)]
pub struct Window {
    pub stone_id: u32,
    /// Centroid in the first epoch.
    pub centre: Point3<f64>,
    pub frame: FaceFrame,
    /// Half the edge of the window, metres.
    pub half_m: f64,
    /// Points per square metre of the stone in the first epoch.
    pub density: f64,
}

impl Window {
    /// The world point at (along, up) of the window, metres from its centre.
    pub fn at(&self, along: f64, up: f64) -> Point3<f64> {
        self.centre + self.frame.along * along + self.frame.up * up
    }
}

/// One window for each stone, in their order.
pub fn windows(stones: &[Stone], outlines: &BTreeMap<u32, StoneOutline>) -> Vec<Window> {
    let window = |stone: &Stone| {
        let frame = FaceFrame::from_normal(&stone.normal);
        let ring = outlines.get(&stone.id.0).map_or(&[][..], |o| &o.ring);
        let reach = ring
            .iter()
            .map(|p| p - stone.centroid)
            .map(|d| d.dot(&frame.along).abs().max(d.dot(&frame.up).abs()))
            .fold(stone.area_m2.max(0.0).sqrt() / 2.0, f64::max);
        Window {
            stone_id: stone.id.0,
            centre: stone.centroid,
            frame,
            half_m: (MARGIN * reach).max(MIN_HALF_M),
            density: f64::from(stone.points) / stone.area_m2.max(1e-4),
        }
    };
    stones.iter().map(window).collect()
}
