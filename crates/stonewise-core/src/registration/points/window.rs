//! The part of a stone's face in which points count.

use super::noise::noise_m;
use crate::geometry::{FaceFrame, OutlineParams, RingIndex, outlines, signed_area};
use nalgebra::{Matrix3, Point2, Point3, Vector2, Vector3};
use std::collections::BTreeMap;

/// Share of a stone's points, at either end of their depths, that does not set how deep the stone reaches:
/// mixed pixels and what hangs in front of the stone.
const DEPTH_TAIL: f64 = 0.02;
/// Noise levels of an epoch by which the depth of a stone is widened for its points: normal noise exceeds it in three
/// points in 100,000 on either side.
const DEPTH_NOISES: f64 = 4.0;
/// How much farther than its neighbours' shift a stone may be followed into points without its label, metres:
/// twice the typical motion of a loose stone.
const REACH_M: f64 = 0.03;

/// The part of a stone's face that both epochs show, about its centroid in the first. In the second epoch it
/// moves with the stone: a window fixed at the predicted place would cut the points there, and the cut edge
/// would bias the motion, in noisy clouds by as much as the prediction is wrong.
#[derive(Clone, Debug)]
pub struct Window {
    face_from_world: Matrix3<f64>,
    /// Outlines of each epoch, in the place of the first: several where a railing divides the face.
    rings: [RingIndex; 2],
    /// Width of the border along the inside of the rings.
    border_m: f64,
    /// Lowest and highest place of each epoch's points, perpendicular to the face, metres.
    depths: [[f64; 2]; 2],
    /// Noise of each epoch's points, metres.
    noise_m: [f64; 2],
    /// Sources of each epoch's labelled points, with the number of points of each.
    sources: [BTreeMap<u32, usize>; 2],
    /// Share of the labelled points that lie inside the other epoch's outlines, of the epoch in which it is less, where the
    /// middles of both epochs' points meet: a motion hides nothing.
    shared: f64,
}

impl Window {
    pub(super) fn new(
        labelled: [&[[f32; 3]]; 2],
        normal: &Vector3<f64>,
        shift: &Vector3<f64>,
        border_noises: f64,
        sources: [BTreeMap<u32, usize>; 2],
    ) -> Option<Self> {
        if border_noises <= 0.0 {
            return None;
        }
        let face_from_world = FaceFrame::from_normal(normal).face_from_world();
        let first = Face::new(labelled[0], &face_from_world, &Vector3::zeros())?;
        let second = Face::new(labelled[1], &face_from_world, shift)?;
        let rings = [&first.rings, &second.rings].map(|rings| RingIndex::new(rings));
        let apart = second.middle() - first.middle();
        let shared = { first.share_in(&rings[1], &apart) }.min(second.share_in(&rings[0], &-apart));

        Some(Self {
            face_from_world,
            border_m: border_noises * first.noise_m.max(second.noise_m),
            depths: [&first, &second].map(|of| {
                let reach = DEPTH_NOISES * of.noise_m;
                [
                    first.depth[0].max(second.depth[0]) - reach,
                    first.depth[1].min(second.depth[1]) + reach,
                ]
            }),
            noise_m: [first.noise_m, second.noise_m],
            sources,
            rings,
            shared,
        })
    }

    /// From world axes to the window's: along, up and out of the face.
    pub(crate) fn face_from_world(&self) -> &Matrix3<f64> {
        &self.face_from_world
    }

    /// Noise of each epoch's points along the normal, about, metres.
    pub(crate) fn noise_m(&self) -> [f64; 2] {
        self.noise_m
    }

    /// Share of the stone that both epochs show, wherever it moved.
    pub(crate) fn shared(&self) -> f64 {
        self.shared
    }

    /// Sources of each epoch's labelled points, with the number of points of each.
    pub(crate) fn sources(&self) -> &[BTreeMap<u32, usize>; 2] {
        &self.sources
    }

    /// Whether a point of an epoch (0 or 1) counts that lies here, in the window's axes about the stone's
    /// centroid.
    pub(crate) fn holds(&self, epoch: usize, at: &Point3<f64>, labelled: bool) -> bool {
        let (flat, [low, high]) = (at.xy(), self.depths[epoch]);
        let is_in_depth = at.z > low && at.z < high;
        let is_inside = || self.rings.iter().all(|ring| ring.contains(&flat));
        let is_at_border = || {
            self.rings
                .iter()
                .any(|ring| ring.passes_within(self.border_m, &flat))
        };
        // At the border the depth decides, elsewhere the label: most often they agree.
        if is_in_depth == labelled {
            labelled && is_inside()
        } else {
            is_inside() && is_at_border() == is_in_depth
        }
    }

    /// Whether a point that lies here may come to lie in the window once the stone's motion is known better.
    pub(super) fn is_near(&self, at: &Point3<f64>) -> bool {
        let flat = at.xy();
        let is_near = |ring: &RingIndex| ring.contains(&flat) || ring.passes_within(REACH_M, &flat);
        self.rings.iter().all(is_near)
    }

    pub(super) fn place(&self, offset: &[f32; 3]) -> Point3<f64> {
        place(&self.face_from_world, offset)
    }
}

/// Outlines, noise and depth of a stone's labelled points in one epoch.
struct Face {
    flat: Vec<Point2<f64>>,
    rings: Vec<Vec<Point2<f64>>>,
    noise_m: f64,
    /// Lowest and highest place of all but the tails.
    depth: [f64; 2],
}

impl Face {
    fn new(labelled: &[[f32; 3]], face_from_world: &Matrix3<f64>, shift: &Vector3<f64>) -> Option<Self> {
        let shift = face_from_world * shift;
        let local: Vec<Point3<f64>> = labelled
            .iter()
            .map(|p| place(face_from_world, p) - shift)
            .collect();
        let flat: Vec<Point2<f64>> = local.iter().map(|p| p.xy()).collect();
        let rings = outlines(&flat, &OutlineParams::default());
        let area_m2: f64 = rings.iter().map(|ring| signed_area(ring)).sum();
        if area_m2 <= 0.0 {
            return None;
        }
        let noise_m = noise_m(&local, area_m2.sqrt());
        let mut heights: Vec<f64> = local.iter().map(|p| p.z).collect();
        heights.sort_by(f64::total_cmp);
        let tail = (DEPTH_TAIL * heights.len() as f64) as usize;
        Some(Self {
            flat,
            rings,
            noise_m,
            depth: [heights[tail], heights[heights.len() - 1 - tail]],
        })
    }

    fn middle(&self) -> Vector2<f64> {
        self.flat.iter().map(|p| p.coords).sum::<Vector2<f64>>() / self.flat.len().max(1) as f64
    }

    /// Share of its points inside some rings, if they move by this.
    fn share_in(&self, rings: &RingIndex, by: &Vector2<f64>) -> f64 {
        let inside = self.flat.iter().filter(|p| rings.contains(&(*p + by))).count();
        inside as f64 / self.flat.len().max(1) as f64
    }
}

fn place(face_from_world: &Matrix3<f64>, offset: &[f32; 3]) -> Point3<f64> {
    Point3::from(face_from_world * Vector3::from(offset.map(f64::from)))
}
