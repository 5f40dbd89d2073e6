//! Restarts from where the surroundings of a stone moved, for stones that a false optimum may hold.
//!
//! A stone that hardly any tie joins to others starts where a few masks put it, and those of an island may all
//! be wrong alike: they then agree with each other at an optimum of their own, although their points fit as
//! well where everything around them moved.

use super::candidate::CandidateMotion;
use super::error::AdjustError;
use super::hypothesis::{LikelihoodRatioTest, Placed};
use super::observation::surface::{LocalPair, PointWeights};
use super::state::Adjustment;
use super::stone_vector::StoneVector;
use super::survey::Points;
use crate::cloud::GridIndex;
use crate::geometry::Bounds;
use crate::registration::points::{PairPoints, PairSource};
use crate::statistics::component_median;
use crate::switches::switchable;
use nalgebra::{Matrix6, Point3, Vector3};
use rayon::prelude::*;

/// Nearest stones, whether ties join them or not, that show how the surroundings moved: twice those that a
/// start is smoothed over, so that a small island does not outvote them.
const SURROUNDINGS: usize = 24;
/// Steps from another place: as many as the alignment makes.
const STEPS: usize = 4;

impl Adjustment {
    /// How the surroundings of each stone and the wall as a whole moved, world, metres: the medians of the
    /// motions of the nearest other stones, and of all.
    pub fn surroundings(&self) -> Vec<[Vector3<f64>; 2]> {
        let places: Vec<Point3<f64>> = self.prior.graph.nodes.iter().map(|n| n.centroid).collect();
        let moved: Vec<Vector3<f64>> = (0..places.len()).map(|i| self.displacement(i)).collect();
        let of_all = component_median(&moved);
        let extent_m = Bounds::of(places.iter().copied()).map_or(0.0, |b| (b.max - b.min).norm());
        let index = GridIndex::for_nearest(&places);
        let around = |i: usize| {
            let near = index.nearest_k(&places[i], SURROUNDINGS + 1, extent_m);
            let others: Vec<Vector3<f64>> = near
                .into_iter()
                .filter(|n| n.0 != i)
                .map(|(j, _)| moved[j])
                .collect();
            if others.is_empty() {
                moved[i]
            } else {
                component_median(&others)
            }
        };
        (0..places.len())
            .into_par_iter()
            .map(|i| [around(i), of_all])
            .collect()
    }

    /// Where a stone is now as the field has it, world, metres.
    fn displacement(&self, i: usize) -> Vector3<f64> {
        let to_world = self.prior.graph.nodes[i].face_from_world.transpose();
        to_world * self.stones[i].with_field.motion.translation()
    }

    /// Returns stones to where their surroundings moved if they left by more than the reach of their relief,
    /// and their points do not make it more probable that they are on their own there. Beforehand that is as
    /// improbable as a loose stone.
    ///
    /// Cost: for these stones, four exact evaluations a place.
    pub fn restart<S: PairSource>(&mut self, points: &Points<S>) -> Result<(), AdjustError<S::Error>> {
        switchable!("restart", Ok(()));
        let elsewhere: Vec<Vec<StoneVector>> = self
            .surroundings()
            .into_iter()
            .enumerate()
            .map(|(i, places)| self.elsewhere(i, places))
            .collect();
        let is_far = |i: usize| !elsewhere[i].is_empty();
        for group in points.groups(is_far) {
            let found = points.of_stones(&group, is_far, |i, pair| self.returned(i, pair, &elsewhere[i]))?;
            for (i, place) in found.into_iter().filter_map(|(i, place)| Some((i, place?))) {
                self.put(i, place);
            }
        }
        Ok(())
    }

    /// Starts a stone anew at another place.
    pub fn put(&mut self, i: usize, place: StoneVector) {
        self.stones[i].with_field = CandidateMotion::new(place);
        self.stones[i].on_own = None;
    }

    /// Motions to some places that in the face lie beyond the reach of a stone's relief, in its frame; out of the face,
    /// and in its rotation, the stone stays as it is.
    fn elsewhere(&self, i: usize, places: [Vector3<f64>; 2]) -> Vec<StoneVector> {
        let frame = &self.prior.graph.nodes[i].face_from_world;
        let here = self.stones[i].with_field.motion;
        let mut taken = vec![here];
        for place in places.iter().filter(|_| self.stones[i].info.usable) {
            let is_far =
                |t: &StoneVector| (t.translation() - frame * place).xy().norm() > self.params.max_step_m;
            if taken.iter().all(is_far) {
                let step = frame * place - here.translation();
                taken.push(here + StoneVector::from_translation(Vector3::new(step.x, step.y, 0.0)));
            }
        }
        taken.split_off(1)
    }

    /// Where a stone settles from the first of these places at which its points do not contradict it.
    fn returned(&self, i: usize, pair: &PairPoints, places: &[StoneVector]) -> Option<StoneVector> {
        let stone = &self.stones[i];
        let local = self.local_pair(i, pair);
        let inflation = self.surface.inflation_of_all(stone.surface());
        let here = stone.with_field.motion;
        let share = self.prior.loose.share;
        let most = inflation * ((1.0 - share) / share).ln();
        places.iter().find_map(|place| {
            let there = self.settled_from(&local, *place, inflation)?;
            let test = LikelihoodRatioTest {
                pair: &local,
                with_field: Placed {
                    motion: there,
                    window: there,
                },
                on_own: Placed {
                    motion: here,
                    window: here,
                },
                noise: &self.surface.noise,
                layout: &self.surface.layout,
            };
            (test.log_ratio() <= most).then_some(there)
        })
    }

    /// Where a stone's points lead from a place, each step held back as for a loose stone.
    fn settled_from(&self, local: &LocalPair, start: StoneVector, inflation: f64) -> Option<StoneVector> {
        let mut at = start;
        for _ in 0..STEPS {
            let e = self.surface.equations(local, &at, &at, &PointWeights::NONE);
            let held = e.information + Matrix6::identity() * inflation / self.params.loose_move_m.powi(2);
            let step = StoneVector::from(held.cholesky()?.solve(&e.gradient));
            let length = step.translation().norm();
            at = at - step.scaled((self.params.max_step_m / length).min(1.0));
        }
        Some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{begun, wall};
    use super::*;
    use crate::registration::points::MemoryPairs;

    const NOISE_M: [f64; 2] = [0.002; 2];
    /// Single stones of 400 points err by some millimetres, and the places are six centimetres apart.
    const WITHIN_M: f64 = 0.008;

    /// Stones that start `at` a place beside the wall's motion, of a wall in which they truly moved by `motion`;
    /// how far from the truth they are after a restart, metres.
    fn error_after_restart(motion: Vector3<f64>, at: Vector3<f64>) -> f64 {
        let island = [20, 21, 28, 29];
        let moved = |k| {
            if island.contains(&(k as usize)) {
                motion
            } else {
                Vector3::zeros()
            }
        };
        let pairs = MemoryPairs::new(wall(6, NOISE_M, moved));
        let (mut adjustment, points) = begun(&pairs);
        adjustment.surface.noise.sigma_m = NOISE_M;
        for i in 0..adjustment.stones.len() {
            let start = if island.contains(&i) { at } else { Vector3::zeros() };
            let frame = adjustment.prior.graph.nodes[i].face_from_world;
            adjustment.put(i, StoneVector::from_translation(frame * start));
        }
        adjustment.evaluate(&points).unwrap();
        adjustment.restart(&points).unwrap();
        let errors = island.map(|i| (adjustment.displacement(i) - motion).norm());
        errors.into_iter().fold(0.0, f64::max)
    }

    #[test]
    fn stones_return_from_where_their_masks_put_them() {
        let error = error_after_restart(Vector3::zeros(), Vector3::new(0.0, -0.03, -0.06));
        assert!(error < WITHIN_M, "{error}");
    }

    #[test]
    fn stones_that_truly_left_stay_where_they_are() {
        let far = Vector3::new(0.0, 0.03, -0.05);
        let error = error_after_restart(far, far);
        assert!(error < WITHIN_M, "{error}");
    }
}
