//! Middle, length and width of an area.

use super::areas::{Area, Motion};
use super::body::Body;
use nalgebra::{Matrix2, Vector2};

/// The ellipse that has the second moments of an area, in the plane of the face at its peak; the stone of the peak is
/// the origin.
pub(super) struct Extent {
    middle: Vector2<f64>,
    /// Second moments about the middle, m^2.
    moments: Matrix2<f64>,
}

impl Extent {
    /// The face of a stone is the mean over the ways to its neighbours, each as far as it lies in the area.
    pub fn new(body: &Body, next: &[Vec<usize>], motion: &Motion, area: &Area) -> Self {
        let at = |i: usize| in_face(body, area, i);
        let (mut weights, mut sum, mut squares) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for ([i, j], [from, to]) in motion.ways(area) {
            let (way, count) = (at(j) - at(i), next[i].len() as f64);
            let weight = (to - from) / count;
            let middle = at(i) + way * (0.5 * (from + to));
            // The ways along one axis have no breadth along the other: of neighbours at +-a and +-b the face has the
            // second moment a^2 / 12 along a, all ways together have half of it.
            let of_face = |&k: &usize| (at(k) - at(i)) * (at(k) - at(i)).transpose() / (12.0 * count);
            let breadth: Matrix2<f64> = next[i].iter().map(of_face).sum();
            let length = way * way.transpose() * ((to - from).powi(2) / 12.0);
            weights += weight;
            sum += middle * weight;
            squares += (middle * middle.transpose() + length + breadth) * weight;
        }
        let middle = sum / weights;
        Self {
            middle,
            moments: squares / weights - middle * middle.transpose(),
        }
    }

    /// Length and width, metres; for a disc both are its diameter.
    pub fn sides_m(&self) -> [f64; 2] {
        // The second moment of an ellipse is the square of a quarter of its axis.
        let axes = self
            .moments
            .symmetric_eigenvalues()
            .map(|v| 4.0 * v.max(0.0).sqrt());
        [axes.max(), axes.min()]
    }

    /// Distance from the middle divided by that of the edge in the same direction. `None` for an area without width.
    pub fn distance(&self) -> Option<impl Fn(&Vector2<f64>) -> f64> {
        let (middle, inverse) = (self.middle, self.moments.try_inverse()?);
        Some(move |place: &Vector2<f64>| {
            let apart = place - middle;
            0.5 * apart.dot(&(inverse * apart)).max(0.0).sqrt()
        })
    }
}

/// Where a stone lies in the face of the stone of an area's peak.
pub(super) fn in_face(body: &Body, area: &Area, stone: usize) -> Vector2<f64> {
    let peak = body.stones[area.stones[0]].joint;
    let apart = peak.face_from_world * (body.stones[stone].joint.place - peak.place);
    apart.xy()
}
