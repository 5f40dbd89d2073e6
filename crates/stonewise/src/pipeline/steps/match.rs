//! The stones of the reference in a later epoch.

use crate::error::{Error, Result};
use crate::files::write_readable_json;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::outputs::outlines::OUTLINES;
use crate::pipeline::steps::panels::PANELS;
use crate::pipeline::until::Until;
use crate::results::names::PairFile;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::id::StoneId;
use stonewise_core::matching::MatchReport;
use stonewise_core::stone::{MatchOutcome, UnmatchedReason};

/// Finds the stones of the reference in a later epoch.
pub static MATCH: Step = Step {
    name: "match",
    phase: Some(Phase::Match),
    about: About::Later,
    needs: &[Need::same(&OUTLINES), Need::same(&PANELS)],
    wanted: |until| until >= Until::Matched,
    cost: Some(|sizes, epoch| Cost::of(1, sizes.pair_bytes(epoch))),
    make: |run, epoch| {
        let matched = run.matched(epoch)?;
        let name = PairFile::Matches.place(epoch.index());
        write_readable_json(&run.context.out.join(name), &*matched.report)
    },
    ..Step::PLAIN
};

/// Matches of two epochs.
pub struct Matched {
    /// What became of every stone.
    pub report: Arc<MatchReport>,
}

impl Matched {
    /// Matched stones, ascending by stone of the first epoch.
    pub fn pairs(&self) -> Vec<(StoneId, StoneId)> {
        let partner = |(first, outcome): &(StoneId, MatchOutcome)| match outcome {
            MatchOutcome::Matched { second } => Some((*first, *second)),
            MatchOutcome::Unmatched(_) => None,
        };
        self.report.outcomes.iter().filter_map(partner).collect()
    }
}

impl Run<'_> {
    /// The stones of the reference in a later epoch, without panels of doors and the like.
    ///
    /// # Errors
    /// There are none; the clouds lie apart.
    pub fn matched(&self, later: EpochId) -> Result<Arc<Matched>> {
        self.once(&MATCH, later, || {
            self.require_overlap(later)?;
            let labelled = self.labelled_pair(later)?;
            let mut report = self.matches("match", labelled.each_ref().map(|l| &**l), later)?;
            let panels = self.panels()?;
            if !panels.is_empty() {
                for (stone, outcome) in &mut Arc::make_mut(&mut report).outcomes {
                    if panels.binary_search(stone).is_ok() {
                        *outcome = MatchOutcome::Unmatched(UnmatchedReason::NotMasonry);
                    }
                }
            }
            let matched = Matched { report };
            match matched.pairs().is_empty() {
                false => Ok(matched),
                true => Err(Error::NoMatch {
                    epochs: self
                        .context
                        .project
                        .epochs
                        .pair(later)
                        .map(|e| e.name.clone())
                        .into_array(),
                    stones: labelled.map(|l| l.stones.len()).into_array(),
                }),
            }
        })
    }
}
