//! An adjustment under way, iteration by iteration: evaluate, solve, step.

use super::equations::StoneEquations;
use super::error::AdjustError;
use super::field::Field;
use super::observation::surface::Effort;
use super::outcome;
use super::params::{AdjustmentParams, AdjustmentReport};
use super::solution::Solution;
use super::state::Adjustment;
use super::survey::{Points, Survey};
use crate::registration::photos::PhotoSource;
use crate::registration::points::PairSource;

/// An adjustment between two iterations.
pub(super) struct Run<'a, S> {
    points: Points<'a, S>,
    adjustment: Adjustment,
    /// Solution of the last iteration.
    last: Option<Solution>,
    iterations: usize,
    /// Most iterations; after each crack or zone that is found, as many again are allowed.
    allowed: usize,
}

impl<'a, S: PairSource> Run<'a, S> {
    /// # Errors
    /// Memory does not suffice for the equations.
    pub fn new(survey: Survey<'a, S>, params: &AdjustmentParams) -> Result<Self, AdjustError<S::Error>> {
        let stones = survey.stones.len();
        let adjustment = Adjustment::new(survey.stones, survey.spacing_m, params);
        Ok(Self {
            points: survey.points,
            adjustment: adjustment.ok_or(AdjustError::Unsolvable { stones })?,
            last: None,
            iterations: 0,
            allowed: params.max_iterations,
        })
    }

    /// Number of stones.
    pub fn stones(&self) -> usize {
        self.adjustment.stones.len()
    }

    /// Begins an iteration; `None` once none is left.
    pub fn begin(&mut self) -> Option<Iteration<'_, 'a, S>> {
        if self.iterations >= self.allowed {
            return None;
        }
        self.iterations += 1;
        if self.iterations == self.allowed {
            self.set_effort(Effort::Settling);
        }
        let what = format!("iteration {}", self.iterations);
        self.points.progress.begin(&what, self.stones() as u64);
        Some(Iteration(self))
    }

    /// Sets how exactly stones are evaluated from now on; the last iteration is exact whatever is set.
    pub fn set_effort(&mut self, effort: Effort) {
        self.adjustment.set_effort(effort);
    }

    /// Tracks the stones in the photos from where they are now.
    pub fn track(&mut self, photos: &dyn PhotoSource<S::Error>) -> Result<(), AdjustError<S::Error>> {
        self.adjustment.track(&self.points, photos)
    }

    /// Takes full steps again, see [`Adjustment::forget_swings`].
    pub fn forget_swings(&mut self) {
        self.adjustment.forget_swings();
    }

    /// Returns true if most stones no longer move, see [`Adjustment::most_are_settled`].
    pub fn most_are_settled(&self) -> bool {
        self.adjustment.most_are_settled()
    }

    /// Parts the wall along its most significant crack, where it has one and fewer than `most`; whether it
    /// did. As many iterations as at the start are then left.
    pub fn part_along_crack(&mut self, most: usize) -> bool {
        let is_open = self.adjustment.prior.cracks.len() < most;
        self.release(is_open, Adjustment::add_crack)
    }

    /// Lets a creeping zone move as its stones show, where there is one and fewer than `most` were found; whether it
    /// did. As many iterations as at the start are then left.
    pub fn loosen_zone(&mut self, most: usize) -> bool {
        let is_open = self.adjustment.prior.zones < most;
        self.release(is_open, Adjustment::loosen_zone)
    }

    /// Finds something to release by the last iteration, if it may be sought; whether there is something.
    fn release(&mut self, is_open: bool, find: impl FnOnce(&mut Adjustment, &Solution) -> bool) -> bool {
        let last = self.last.as_ref().filter(|_| is_open);
        let found = last.is_some_and(|solution| find(&mut self.adjustment, solution));
        if found {
            self.allowed = self.iterations + self.adjustment.params.max_iterations;
        }
        found
    }

    /// Results of the last iteration.
    pub fn report(&self, converged: bool) -> AdjustmentReport {
        outcome::report(&self.adjustment, self.last.as_ref(), self.iterations, converged)
    }
}

/// An iteration that has begun.
pub(super) struct Iteration<'r, 'a, S>(&'r mut Run<'a, S>);

impl<'r, 'a, S: PairSource> Iteration<'r, 'a, S> {
    /// Estimates the noise of the points where the stones are now.
    pub fn estimate_noise(&mut self) {
        self.0.adjustment.estimate_noise(&self.0.points.sample);
    }

    /// Evaluates the points of all stones that moved since they were last evaluated.
    pub fn evaluate(self) -> Result<Evaluated<'r, 'a, S>, AdjustError<S::Error>> {
        self.0.adjustment.evaluate(&self.0.points)?;
        Ok(Evaluated(self.0))
    }
}

/// An iteration in which the points are evaluated where the stones are.
pub(super) struct Evaluated<'r, 'a, S>(&'r mut Run<'a, S>);

impl<'r, 'a, S: PairSource> Evaluated<'r, 'a, S> {
    /// Tries stones far from the field's motion, and evaluates them at the best place found, from which they are
    /// followed.
    pub fn probe(self) -> Result<Self, AdjustError<S::Error>> {
        self.0.adjustment.probe(&self.0.points)?;
        self.0.adjustment.evaluate(&self.0.points)?;
        Ok(self)
    }

    /// Adjusts the photos' poses, where photos take part.
    pub fn update_photos(&mut self) {
        self.0.adjustment.update_photos(self.0.last.as_ref());
    }

    /// Updates the common motion, then estimates the variance components about it.
    pub fn update_components(&mut self) -> Result<(), AdjustError<S::Error>> {
        self.0.adjustment.follow_common_motion();
        self.0.adjustment.prior.components = self.0.adjustment.components_of_wall(self.0.points.progress)?;
        Ok(())
    }

    /// Solves for the field with the present weights.
    pub fn solve(self) -> Result<Solved<'r, 'a, S>, AdjustError<S::Error>> {
        self.solved(|adjustment, equations| adjustment.solve(equations))
    }

    /// Solves for the field, with the weights of stones and ties that follow from it.
    pub fn solve_and_reweight(self) -> Result<Solved<'r, 'a, S>, AdjustError<S::Error>> {
        self.0.points.progress.check()?;
        self.solved(Adjustment::solve_and_reweight)
    }

    fn solved(
        self,
        solve: impl FnOnce(&mut Adjustment, &[StoneEquations]) -> Option<Field>,
    ) -> Result<Solved<'r, 'a, S>, AdjustError<S::Error>> {
        let stones = self.0.stones();
        let equations = self.0.adjustment.equations();
        let field = solve(&mut self.0.adjustment, &equations)
            .filter(|field| self.0.adjustment.is_finite(field))
            .ok_or(AdjustError::Unsolvable { stones })?;
        Ok(Solved(self.0, Solution { equations, field }))
    }
}

/// An iteration with its solution.
pub(super) struct Solved<'r, 'a, S>(&'r mut Run<'a, S>, Solution);

impl<S: PairSource> Solved<'_, '_, S> {
    /// Moves the stones, which ends the iteration; whether they have come to rest.
    pub fn step(self) -> bool {
        let Self(run, solution) = self;
        let is_at_rest = run.adjustment.step(&solution);
        run.last = Some(solution);
        is_at_rest
    }
}

#[cfg(test)]
mod tests {
    use super::super::survey::survey;
    use super::super::testing::wall;
    use super::*;
    use crate::progress::Silent;
    use crate::registration::points::MemoryPairs;
    use nalgebra::Vector3;

    #[test]
    fn a_stone_that_is_found_at_a_distance_is_followed_from_there() {
        let (stone, noise) = (20, [0.005; 2]);
        let far = Vector3::new(0.0, 0.015, 0.0);
        let moved = |k| if k == stone { far } else { Vector3::zeros() };
        let pairs = MemoryPairs::new(wall(5, noise, moved));
        let params = AdjustmentParams::default();
        let mut run = Run::new(survey(&pairs, &params, &Silent).unwrap(), &params).unwrap();
        for _ in 0..3 {
            let mut iteration = run.begin().unwrap();
            iteration.estimate_noise();
            iteration.evaluate().unwrap();
        }
        let probed = run.begin().unwrap().evaluate().unwrap().probe().unwrap();
        probed.solve_and_reweight().unwrap().step();
        let stone = stone as usize;
        let own = run.adjustment.stones[stone].on_own.as_ref().unwrap().motion;
        let there = run.adjustment.prior.graph.nodes[stone].face_from_world * far;
        let error = (own.translation() - there).norm();
        assert!(error < 0.005, "{error}");
    }
}
