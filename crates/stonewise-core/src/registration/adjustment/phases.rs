//! The phases of the adjustment. Each is a function of the type that the phase before hands over, so that
//! none can be left out or called out of order. A phase that has no iterations left changes nothing.

use super::error::AdjustError;
use super::iteration::Run;
use super::observation::surface::Effort;
use super::params::{AdjustmentParams, AdjustmentReport};
use super::survey::Survey;
use crate::registration::photos::PhotoSource;
use crate::registration::points::PairSource;

/// Iterations of the alignment: the first two bring stones within reach of their relief, the others let noise
/// and variance components follow.
const ALIGNMENTS: usize = 4;
/// The noise is estimated in every second iteration of the alignment: all stones are then evaluated anew, and it
/// changes by a percent in between.
const NOISE_EVERY: usize = 2;
/// Iterations in which the weights of stones and ties settle, and in which of them the variance components
/// are estimated once more: an estimate moves the weights, which need an iteration to follow.
const WEIGHINGS: usize = 5;
const COMPONENTS_IN: [usize; 2] = [0, 2];
/// Most cracks of the whole wall that are sought; each costs another adjustment.
const MAX_CRACKS: usize = 8;
/// Most creeping zones; each costs another adjustment.
const MAX_ZONES: usize = 4;

type Phase<Next, S> = Result<Next, AdjustError<<S as PairSource>::Error>>;

/// All stones where their neighbours' centroids put them.
pub(super) struct Surveyed<'a, S>(Run<'a, S>);

impl<'a, S: PairSource> Surveyed<'a, S> {
    pub fn new(survey: Survey<'a, S>, params: &AdjustmentParams) -> Phase<Self, S> {
        Run::new(survey, params).map(Self)
    }

    /// Whether there is no stone.
    pub fn is_empty(&self) -> bool {
        self.0.stones() == 0
    }

    /// The report where there are no stones.
    pub fn report(&self) -> AdjustmentReport {
        self.0.report(true)
    }

    /// Brings the stones onto each other, while noise and variance components become about right.
    pub fn align(self) -> Phase<Aligned<'a, S>, S> {
        let mut run = self.0;
        run.set_effort(Effort::Aligning);
        for round in 0..ALIGNMENTS {
            let Some(mut iteration) = run.begin() else { break };
            if round % NOISE_EVERY == 0 {
                iteration.estimate_noise();
            }
            let mut evaluated = iteration.evaluate()?;
            evaluated.update_components()?;
            evaluated.solve_and_reweight()?.step();
        }
        Ok(Aligned(run))
    }
}

/// Stones that lie on each other within the reach of their relief.
pub(super) struct Aligned<'a, S>(Run<'a, S>);

impl<'a, S: PairSource> Aligned<'a, S> {
    /// Estimates the noise for good, and tries stones far from the field's motion.
    pub fn probe(self) -> Phase<Probed<'a, S>, S> {
        let mut run = self.0;
        run.set_effort(Effort::Weighing);
        if let Some(mut iteration) = run.begin() {
            iteration.estimate_noise();
            let evaluated = iteration.evaluate()?.probe()?;
            evaluated.solve_and_reweight()?.step();
        }
        Ok(Probed(run))
    }
}

/// Stones each of which is about where its points show it.
pub(super) struct Probed<'a, S>(Run<'a, S>);

impl<'a, S: PairSource> Probed<'a, S> {
    /// Tracks the stones from photo to photo, where there are any.
    pub fn track(self, photos: Option<&dyn PhotoSource<S::Error>>) -> Phase<Tracked<'a, S>, S> {
        let mut run = self.0;
        if let Some(photos) = photos {
            run.track(photos)?;
        }
        Ok(Tracked(run))
    }
}

/// Stones with everything that is observed of them.
pub(super) struct Tracked<'a, S>(Run<'a, S>);

impl<'a, S: PairSource> Tracked<'a, S> {
    /// Estimates the variance components; the weights of stones and ties, and the photos' poses, follow.
    pub fn weigh(self) -> Phase<Weighed<'a, S>, S> {
        let mut run = self.0;
        run.set_effort(Effort::Weighing);
        for round in 0..WEIGHINGS {
            let Some(iteration) = run.begin() else { break };
            let mut evaluated = iteration.evaluate()?;
            evaluated.update_photos();
            if COMPONENTS_IN.contains(&round) {
                evaluated.update_components()?;
            }
            evaluated.solve_and_reweight()?.step();
        }
        Ok(Weighed(run))
    }
}

/// Stones and ties with the weights that they keep.
pub(super) struct Weighed<'a, S>(Run<'a, S>);

impl<'a, S: PairSource> Weighed<'a, S> {
    /// Iterates with frozen weights and components until no stone moves.
    pub fn settle(self) -> Phase<Settled<'a, S>, S> {
        let mut run = self.0;
        run.set_effort(Effort::Settling);
        run.forget_swings();
        let mut is_begun = false;
        while let Some(iteration) = run.begin() {
            is_begun = true;
            if iteration.evaluate()?.solve()?.step() {
                return Ok(Settled { run, converged: true });
            }
        }
        let converged = is_begun && run.most_are_settled();
        Ok(Settled { run, converged })
    }
}

/// Stones that came to rest, or for which no iteration was left.
pub(super) struct Settled<'a, S> {
    run: Run<'a, S>,
    converged: bool,
}

impl<'a, S: PairSource> Settled<'a, S> {
    /// Parts the wall along its most significant crack, if the stones came to rest; whether there is one. What
    /// settled before must then be weighed again.
    pub fn part_along_crack(&mut self) -> bool {
        self.converged && self.run.part_along_crack(MAX_CRACKS)
    }

    /// Lets a creeping zone move as its stones show, if the stones came to rest; whether there is one. What settled
    /// before must then be weighed again.
    pub fn loosen_zone(&mut self) -> bool {
        self.converged && self.run.loosen_zone(MAX_ZONES)
    }

    /// Weighs as [`Tracked::weigh`] does, now that the wall is parted or a zone is loose.
    pub fn weigh(self) -> Phase<Weighed<'a, S>, S> {
        Tracked(self.run).weigh()
    }

    pub fn report(&self) -> AdjustmentReport {
        self.run.report(self.converged)
    }
}
