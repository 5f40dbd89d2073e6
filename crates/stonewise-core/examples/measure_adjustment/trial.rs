//! One survey with its truth, ready to be measured.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use stonewise_core::cloud::Cloud;
use stonewise_core::geometry::{Bounds, Plane};
use stonewise_core::id::StoneId;
use stonewise_core::registration::{NearPoint, PairPoints, local_shifts, stone_points};

/// Points by stone, world frame; 0 holds what is no stone.
pub type Stones = BTreeMap<u32, Vec<Point3<f64>>>;

/// What is true of a stone.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Outward normal of the face.
    pub normal: Vector3<f64>,
    /// Displacement of the epoch-1 centroid of the stone's points, metres.
    pub displacement: Vector3<f64>,
    /// Displacement that it shares with its neighbours, metres.
    pub shared: Vector3<f64>,
    pub loose: bool,
    /// Seen well enough in both epochs, and whole.
    pub countable: bool,
    /// Its mask in one epoch was merged, halved or swapped.
    pub spoilt: bool,
}

/// A survey to be measured.
pub struct Trial {
    pub stones: [Stones; 2],
    pub truth: BTreeMap<u32, Truth>,
    /// Crack: a point on it and its direction across, world; which stones lie near it is asked of it.
    pub crack: Option<Crack>,
    /// Standard deviations (in the face 2D, out of it) that no estimator without knowledge of other stones
    /// can beat, and the same for the rigid window of 1.5 m, per stone, metres.
    pub bounds: BTreeMap<u32, [[f64; 2]; 2]>,
}

/// A vertical crack at `at` along `across`.
#[derive(Clone, Copy)]
pub struct Crack {
    pub across: Vector3<f64>,
    pub at: f64,
}

impl Crack {
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        p.coords.dot(&self.across) - self.at
    }
}

impl Trial {
    /// Pairs of the same stone in both epochs, for the estimators; near the border of a stone points are
    /// chosen as in a run.
    pub fn pairs(&self, border_noises: f64) -> Vec<PairPoints> {
        let [first, second] = &self.stones;
        let ids: Vec<u32> = first
            .keys()
            .copied()
            .filter(|id| *id > 0 && second.contains_key(id))
            .collect();
        let centroids: Vec<Point3<f64>> = ids.iter().map(|id| mean(&first[id])).collect();
        let moved: Vec<Vector3<f64>> = ids
            .iter()
            .zip(&centroids)
            .map(|(id, c)| mean(&second[id]) - c)
            .collect();
        let shifts = local_shifts(&centroids, &moved);
        let bounds = [first, second].map(|stones| -> BTreeMap<u32, Bounds> {
            let of =
                |(id, points): (&u32, &Vec<Point3<f64>>)| Some((*id, Bounds::of(points.iter().copied())?));
            stones.iter().filter_map(of).collect()
        });
        ids.par_iter()
            .zip(&centroids)
            .zip(&shifts)
            .filter_map(|((&id, &centroid), shift)| {
                let (points, other) = (&first[&id], &second[&id]);
                if points.len() < 10 || other.len() < 10 {
                    return None;
                }
                let plane = Plane::fit(points)?.normal;
                let normal = plane * plane.dot(&self.truth.get(&id)?.normal).signum();
                let near = |epoch: usize, shift: Vector3<f64>| -> Vec<NearPoint> {
                    let place = bounds[0][&id].grown(0.02).moved(&shift);
                    let around = self.stones[epoch]
                        .iter()
                        .filter(|(k, _)| bounds[epoch][*k].intersects(&place));
                    around
                        .flat_map(|(k, points)| points.iter().map(move |p| (*k == id, p)))
                        .filter(|(own, p)| *own || place.contains(p))
                        .map(|(labelled, p)| NearPoint {
                            offset: (p - centroid).cast::<f32>().into(),
                            labelled,
                        })
                        .collect()
                };
                let [one, two] = [near(0, Vector3::zeros()), near(1, *shift)];
                let chosen = stone_points([&one, &two], &normal, shift, border_noises);
                Some(PairPoints {
                    first: StoneId(id),
                    second: StoneId(id),
                    centroid,
                    centroid_second: mean(other),
                    normal,
                    points_first: Cloud::new(centroid, chosen.first),
                    points_second: Cloud::new(centroid, chosen.second),
                    nearby_second: Cloud::new(centroid, chosen.nearby_second),
                    window: chosen.window.map(Arc::new),
                })
            })
            .collect()
    }

    /// Merges, halves and swaps the second epoch's masks of 15 % of the stones.
    pub fn spoil(&mut self) {
        let second = &mut self.stones[1];
        let ids: Vec<u32> = second.keys().copied().filter(|id| *id > 0).collect();
        for (k, id) in ids.iter().enumerate().filter(|(k, _)| k % 7 == 3) {
            let next = ids[(k + 1) % ids.len()];
            let mut touched = vec![*id];
            match (k / 7) % 3 {
                0 => {
                    let extra = second.remove(&next).unwrap_or_default();
                    second.entry(*id).or_default().extend(extra);
                    touched.push(next);
                }
                1 => {
                    let c = mean(&second[id]);
                    second.entry(*id).or_default().retain(|p| p.y > c.y);
                }
                _ => {
                    let (a, b) = (second[id].clone(), second[&next].clone());
                    second.insert(*id, b);
                    second.insert(next, a);
                    touched.push(next);
                }
            }
            for id in touched {
                if let Some(t) = self.truth.get_mut(&id) {
                    t.spoilt = true;
                }
            }
        }
    }
}

pub fn mean(points: &[Point3<f64>]) -> Point3<f64> {
    (points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64).into()
}
