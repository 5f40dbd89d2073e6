//! The points of a matched stone in the stone's frame.

use super::local_motion::LocalMotion;
use crate::cloud::Cloud;
use crate::registration::adjustment::stone_vector::StoneVector;
use crate::registration::points::{PairPoints, Window};
use nalgebra::{Matrix3, Point3, Vector3};
use std::sync::Arc;

/// Points of both epochs in the stone's frame, the second unmoved.
pub(crate) struct LocalPair {
    pub first: Vec<[f64; 3]>,
    /// Those with the stone's label, then those nearby without it.
    second: Vec<[f64; 3]>,
    /// How many of the second have the label.
    labelled: usize,
    /// Where points count, and from the stone's frame to the window's.
    window: Option<(Arc<Window>, Matrix3<f64>)>,
    /// Noise of each epoch's points over that of most stones.
    pub noise: [f64; 2],
}

impl LocalPair {
    /// Points in the stone's frame that all count wherever the stone moves.
    #[cfg(test)]
    pub fn of_points(first: Vec<[f64; 3]>, second: Vec<[f64; 3]>) -> Self {
        Self {
            first,
            labelled: second.len(),
            second,
            window: None,
            noise: [1.0; 2],
        }
    }

    /// `noise`: that of each epoch's points over that of most stones.
    pub fn new(pair: &PairPoints, face_from_world: &Matrix3<f64>, noise: [f64; 2]) -> Self {
        let local = |cloud: &Cloud| {
            let shift = cloud.origin() - pair.centroid;
            (0..cloud.len())
                .map(|i| (face_from_world * (cloud.local(i).coords + shift)).into())
                .collect::<Vec<[f64; 3]>>()
        };
        let mut second = local(&pair.points_second);
        let labelled = second.len();
        second.extend(local(&pair.nearby_second));
        Self {
            first: local(&pair.points_first),
            second,
            labelled,
            window: pair
                .window
                .as_ref()
                .map(|w| (w.clone(), w.face_from_world() * face_from_world.transpose())),
            noise,
        }
    }

    /// Number of points of each epoch, in any window.
    pub fn counts(&self) -> [usize; 2] {
        [self.first.len(), self.second.len()]
    }

    /// The points that count where the window moved by `window`, and no others.
    pub fn counting(&self, window: &StoneVector) -> Self {
        let window = LocalMotion::new(window);
        let second: Vec<[f64; 3]> = self.second_in(&window).into_iter().map(|(_, q)| q).collect();
        Self {
            first: self.first.clone(),
            labelled: second.len(),
            second,
            window: None,
            noise: self.noise,
        }
    }

    /// The second epoch's points in the window, where that moved by `window`, and their indices.
    pub fn second_in(&self, window: &LocalMotion) -> Vec<(u32, [f64; 3])> {
        let counts = |(i, q): &(usize, &[f64; 3])| {
            self.window.as_ref().is_none_or(|(part, turn)| {
                let at = turn * Vector3::from(window.undo(q));
                part.holds(1, &Point3::from(at), *i < self.labelled)
            })
        };
        let second = self.second.iter().enumerate().filter(counts);
        second.map(|(i, q)| (i as u32, *q)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::FaceFrame;
    use crate::id::StoneId;
    use crate::registration::points::{NearPoint, stone_points};

    #[test]
    fn points_of_the_second_epoch_count_where_the_window_moved_with_the_stone() {
        let normal = Vector3::x();
        let frame = FaceFrame::from_normal(&normal).face_from_world();
        let shift = Vector3::new(0.0, 0.03, -0.02);
        // A plane of 0.4 m, points every 5 mm; the mask takes the middle 0.2 m.
        let plane = |moved: Vector3<f64>| -> Vec<NearPoint> {
            let place = |i: i32| f64::from(i) * 0.005 - 0.2;
            (0..81 * 81)
                .map(|i| Vector3::new(0.0, place(i % 81), place(i / 81)))
                .map(|p| NearPoint {
                    offset: (p + moved).cast::<f32>().into(),
                    labelled: p.y.abs().max(p.z.abs()) < 0.101,
                    source: 0,
                })
                .collect()
        };
        let near = [plane(Vector3::zeros()), plane(shift)];
        let chosen = stone_points([&near[0], &near[1]], &normal, &shift, 3.0);
        let cloud = |offsets: Vec<[f32; 3]>| Cloud::new(Point3::origin(), offsets);
        let pair = PairPoints {
            first: StoneId(1),
            second: StoneId(1),
            centroid: Point3::origin(),
            centroid_second: Point3::origin() + shift,
            normal,
            points_first: cloud(chosen.first),
            points_second: cloud(chosen.second),
            nearby_second: cloud(chosen.nearby_second),
            window: chosen.window.map(Arc::new),
        };
        let local = LocalPair::new(&pair, &frame, [1.0; 2]);
        let moved = LocalMotion::new(&StoneVector::from_translation(frame * shift));
        let counted: Vec<[f64; 3]> = local
            .second_in(&moved)
            .iter()
            .map(|(_, q)| moved.undo(q))
            .collect();
        assert_eq!(counted.len(), local.first.len());
        for (i, q) in local.second_in(&moved) {
            assert_eq!(local.second[i as usize], q);
        }
        let largest = |points: &[[f64; 3]]| {
            points
                .iter()
                .fold(0.0, |m: f64, p| m.max(p[0].abs()).max(p[1].abs()))
        };
        assert!((largest(&counted) - largest(&local.first)).abs() < 1e-6);
        let unmoved = LocalMotion::new(&StoneVector::zeros());
        let left_behind = local.second_in(&unmoved).len();
        assert!(
            left_behind + 200 < counted.len(),
            "{left_behind} {}",
            counted.len()
        );
    }
}
