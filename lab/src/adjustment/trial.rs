//! One survey with its truth, ready to be measured.

use crate::survey::{Places, mean, pairs};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::registration::PairPoints;

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
    pub stones: [Places; 2],
    pub truth: BTreeMap<u32, Truth>,
    /// Crack: a point on it and its direction across, world; it also gives which stones lie near it.
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
    /// Pairs of the same stone in both epochs, for the estimators.
    pub fn pairs(&self, border_noises: f64) -> Vec<PairPoints> {
        pairs(
            &self.stones,
            |id| Some(self.truth.get(&id)?.normal),
            border_noises,
        )
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
