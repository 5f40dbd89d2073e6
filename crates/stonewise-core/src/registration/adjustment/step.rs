//! Stones move to their posterior means.

use super::candidate::CandidateMotion;
use super::equations::StoneEquations;
use super::field::{Field, Posterior, posterior};
use super::solution::Solution;
use super::state::Adjustment;
use super::stone_vector::StoneVector;
use rayon::prelude::*;

/// One stone in this many may still swing between two optima of its own when the adjustment has settled.
const RESTLESS: usize = 50;
/// A stone's own optimum is followed once its points make it this many times more probably loose than it was without
/// them.
const SUSPECT: f64 = 1.5;
/// A step within this share of its standard deviation no longer matters.
const SETTLED: f64 = 0.01;
/// Where no iteration is left, a stone whose last step stayed within this share of its standard deviation has
/// a motion: what is missing does not change its interval.
const NEARLY_SETTLED: f64 = 0.1;
/// Where no iteration is left, the wall has converged if at most one stone in this many has not: those have no motion.
const UNSETTLED: usize = 10;

impl Adjustment {
    /// Moves every stone to its posterior mean; whether the adjustment has settled.
    pub fn step(&mut self, solution: &Solution) -> bool {
        // What counts as an error might be the start of a motion: the equations follow it, so that a loose
        // stone shows itself.
        let followed = self.equations_with_field(0.0);
        let own = self.prior.components.with_error(self.prior.own_variances());
        let stones = followed.par_iter().zip(&solution.field.from_others);
        let tied: Vec<Posterior> = stones
            .map(|(equations, prediction)| posterior(equations, prediction, &own))
            .collect();
        let mut restless = 0;
        for (i, tied) in tied.iter().enumerate() {
            let p = self.stones[i].p_with_field;
            self.stones[i].effective_freedom = tied.effective_freedom;
            let origin = self.prior.common_in(i);
            let limits = StepLimits::of(self);
            let with_field = limits.follow(&mut self.stones[i].with_field, tied, &origin, p);
            let on_own = self.step_on_own(i, &solution.equations[i], &solution.field);
            restless += usize::from(with_field.counts) + usize::from(on_own.counts);
            self.stones[i].moves = with_field.moves || on_own.moves;
        }
        let is_at_rest = restless * RESTLESS <= self.stones.len();
        if is_at_rest {
            self.stones.iter_mut().for_each(|stone| stone.moves = false);
        }
        is_at_rest
    }

    /// Returns true if most stones no longer move. The others have no motion.
    pub fn most_are_settled(&self) -> bool {
        let moving = self.stones.iter().filter(|stone| stone.moves).count();
        moving * UNSETTLED <= self.stones.len()
    }

    /// Returns to full steps for all stones once the weights and variance components are frozen. Before that,
    /// each update of one changes the other, which can make all stones of a wall swing and so shortens steps.
    pub fn forget_swings(&mut self) {
        for stone in &mut self.stones {
            stone.with_field.forget_swings();
            if let Some(own) = &mut stone.on_own {
                own.forget_swings();
            }
        }
    }

    /// Moves a stone on its own, or begins to where that has become likely.
    fn step_on_own(&mut self, i: usize, equations: &StoneEquations, field: &Field) -> Step {
        let wide = self.prior.loose_variances();
        let prediction = &field.from_others[i];
        let origin = self.prior.common_in(i);
        let limits = StepLimits::of(self);
        let expected = self.leaving_share(i);
        let stone = &mut self.stones[i];
        let p_loose = 1.0 - stone.p_with_field;
        if let (Some(own), Some(equations)) = (&mut stone.on_own, &equations.on_own) {
            return limits.follow(own, &posterior(equations, prediction, &wide), &origin, p_loose);
        }
        let is_suspect = p_loose > SUSPECT * expected;
        if is_suspect {
            let observed = equations.on_own.as_ref().unwrap_or(&equations.with_field);
            let start = posterior(observed, prediction, &wide).mean + origin;
            let mut own = CandidateMotion::new(stone.with_field.motion);
            own.move_to(&start, limits.max_step_m);
            stone.on_own = Some(own);
        }
        Step {
            counts: is_suspect,
            moves: false,
        }
    }
}

/// What a step of a stone says about its rest.
#[derive(Clone, Copy)]
struct Step {
    /// The stone still moves.
    counts: bool,
    /// It moves further than a small share of what its motion is uncertain.
    moves: bool,
}

/// How far a stone steps, and what step still counts.
#[derive(Clone, Copy)]
struct StepLimits {
    max_step_m: f64,
    tolerance_m: f64,
}

impl StepLimits {
    fn of(adjustment: &Adjustment) -> Self {
        Self {
            max_step_m: adjustment.params.max_step_m,
            tolerance_m: adjustment.params.tolerance_m,
        }
    }

    /// Moves a candidate to its posterior mean. A candidate of little probability `p` moves the stone's
    /// estimate by that share only.
    fn follow(
        self,
        candidate: &mut CandidateMotion,
        posterior: &Posterior,
        origin: &StoneVector,
        p: f64,
    ) -> Step {
        let step = p * candidate.move_to(&(posterior.mean + *origin), self.max_step_m);
        let sd = posterior.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
        Step {
            counts: step > self.tolerance_m.max(SETTLED * sd),
            moves: step > self.tolerance_m.max(NEARLY_SETTLED * sd),
        }
    }
}
