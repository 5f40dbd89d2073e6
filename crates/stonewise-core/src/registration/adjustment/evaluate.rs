//! Evaluation of the stones' own points, batch by batch.

use super::candidate::CandidateMotion;
use super::error::AdjustError;
use super::hypothesis::{LikelihoodRatio, LikelihoodRatioTest, Placed, Probe};
use super::observation::surface::{Correlation, Equations, LocalPair, estimate_noise};
use super::state::{Adjustment, StoneState};
use super::stone_vector::StoneVector;
use crate::progress::Progress;
use crate::registration::points::{PairPoints, PairSource};
use rayon::prelude::*;

/// What a stone's points say where it moved since the last evaluation.
struct Evaluation {
    with_field: Option<Equations>,
    on_own: Option<Equations>,
    ratio: Option<LikelihoodRatio>,
}

impl Adjustment {
    /// Estimates the noise of the points at the stones' present motions; all equations are then evaluated
    /// anew.
    pub fn estimate_noise(&mut self) {
        let sample: Vec<(LocalPair, StoneVector)> = self
            .sample
            .par_iter()
            .map(|(i, pair)| {
                let pair = LocalPair::new(pair, &self.graph.nodes[*i].face_from_world);
                (pair, self.stones[*i].with_field.motion)
            })
            .collect();
        let views: Vec<(&LocalPair, StoneVector)> = sample.iter().map(|(p, x)| (p, *x)).collect();
        self.surface.noise = estimate_noise(&views, &self.surface.noise, &self.surface.layout);
        for stone in &mut self.stones {
            stone.with_field.surface.invalidate();
            if let Some(own) = &mut stone.on_own {
                own.surface.invalidate();
            }
        }
    }

    /// Normal equations of all stones that moved since they were last evaluated.
    pub fn evaluate<S: PairSource>(
        &mut self,
        source: &S,
        progress: &dyn Progress,
    ) -> Result<(), AdjustError<S::Error>> {
        for (batch, range) in self.batches.clone().into_iter().enumerate() {
            progress.check()?;
            let count = range.len();
            if self.stones[range.clone()].iter().any(|s| self.is_due(s)) {
                let pairs = source.load(batch).map_err(AdjustError::Source)?;
                let new: Vec<Option<Evaluation>> = pairs
                    .par_iter()
                    .zip(range.clone())
                    .map(|(pair, i)| self.evaluate_one(i, pair))
                    .collect();
                for (new, stone) in new.into_iter().zip(&mut self.stones[range]) {
                    if let Some(new) = new {
                        new.store(stone);
                    }
                }
            }
            progress.advance(count as u64);
        }
        let known: Vec<(&Equations, f64)> = self
            .stones
            .iter()
            .filter_map(|s| Some((s.with_field.surface.equations()?, s.effective_freedom)))
            .collect();
        self.surface.correlation = Correlation::of(&known);
        Ok(())
    }

    /// Whether a stone left the motion, either of two, at which its equations were evaluated.
    fn is_due(&self, stone: &StoneState) -> bool {
        self.is_candidate_due(&stone.with_field)
            || stone.on_own.as_ref().is_some_and(|c| self.is_candidate_due(c))
    }

    fn is_candidate_due(&self, candidate: &CandidateMotion) -> bool {
        self.surface.is_due(&candidate.surface, &candidate.motion)
    }

    /// What changed at a stone; `None` if nothing did.
    fn evaluate_one(&self, i: usize, pair: &PairPoints) -> Option<Evaluation> {
        let stone = &self.stones[i];
        if !self.is_due(stone) {
            return None;
        }
        let local = LocalPair::new(pair, &self.graph.nodes[i].face_from_world);
        let anew = |candidate: &CandidateMotion| {
            let window = candidate.surface.window(&candidate.motion);
            self.surface.equations(&local, &candidate.motion, &window)
        };
        let compare = |own: &CandidateMotion| {
            let test = LikelihoodRatioTest {
                pair: &local,
                with_field: placed(&stone.with_field),
                on_own: placed(own),
                noise: &self.surface.noise,
                layout: &self.surface.layout,
            };
            test.run(self.surface.inflation_of_all(stone.surface()))
        };
        let own = stone.on_own.as_ref();
        Some(Evaluation {
            with_field: Some(&stone.with_field)
                .filter(|c| self.is_candidate_due(c))
                .map(anew),
            on_own: own.filter(|c| self.is_candidate_due(c)).map(anew),
            ratio: own.map(compare),
        })
    }

    /// Tries stones whose points leave their motion open at a distance, and follows each from the best place
    /// found.
    ///
    /// Cost: eight evaluations of these stones.
    pub fn probe<S: PairSource>(
        &mut self,
        source: &S,
        progress: &dyn Progress,
    ) -> Result<(), AdjustError<S::Error>> {
        for (batch, range) in self.batches.clone().into_iter().enumerate() {
            progress.check()?;
            if self.stones[range.clone()].iter().any(|s| self.is_open(s)) {
                let pairs = source.load(batch).map_err(AdjustError::Source)?;
                let found: Vec<(usize, Option<StoneVector>)> = pairs
                    .par_iter()
                    .zip(range)
                    .filter(|(_, i)| self.is_open(&self.stones[*i]))
                    .map(|(pair, i)| (i, self.probe_one(i, pair)))
                    .collect();
                for (i, place) in found {
                    self.stones[i].on_own = place.map(CandidateMotion::new);
                }
            }
        }
        Ok(())
    }

    /// Whether a stone is to be tried at a distance: usable, not yet followed on its own, and its motion
    /// open.
    fn is_open(&self, stone: &StoneState) -> bool {
        let inflation = self.surface.inflation_of_all(stone.surface());
        let is_open = |e: &Equations| Probe::is_open(e, inflation, self.params.loose_move_m);
        stone.info.usable
            && stone.on_own.is_none()
            && stone.with_field.surface.equations().is_some_and(is_open)
    }

    fn probe_one(&self, i: usize, pair: &PairPoints) -> Option<StoneVector> {
        let stone = &self.stones[i];
        let probe = Probe {
            pair: &LocalPair::new(pair, &self.graph.nodes[i].face_from_world),
            here: placed(&stone.with_field),
            surface: &self.surface,
            inflation: self.surface.inflation_of_all(stone.surface()),
            move_m: self.params.loose_move_m,
        };
        probe.best(stone.with_field.surface.equations()?)
    }
}

impl Evaluation {
    fn store(self, stone: &mut StoneState) {
        stone.ratio = self.ratio.unwrap_or_default();
        if let Some(equations) = self.with_field {
            let at = stone.with_field.motion;
            stone.with_field.surface.set(at, equations);
        }
        if let (Some(equations), Some(own)) = (self.on_own, &mut stone.on_own) {
            own.surface.set(own.motion, equations);
        }
    }
}

fn placed(candidate: &CandidateMotion) -> Placed {
    Placed {
        motion: candidate.motion,
        window: candidate.surface.window(&candidate.motion),
    }
}
