//! Results against the motion that the project file prescribes.

use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::steps::change::CHANGE;
use crate::pipeline::steps::known_motion::known_motion;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::names::PairFile;
use crate::truth::outcome;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::{Evaluation, StoneOutcome, score_stones};

/// Scores the stones of a later epoch, and M3C2 where there is any, against the prescribed motion.
pub static EVALUATE: Step = Step {
    name: "evaluate",
    about: About::Later,
    needs: &[Need::same(&MEASURE), Need::same(&CHANGE)],
    wanted: |until| until >= Until::Registered,
    make: |run, epoch| match &*run.evaluated(epoch)? {
        Some(evaluation) => {
            let name = PairFile::Evaluation.place(epoch.index());
            write_readable_json(&run.context.out.join(name), evaluation)
        }
        None => Ok(()),
    },
    ..Step::PLAIN
};

impl Run<'_> {
    /// Scores of a later epoch; `None` where no motion is known.
    pub fn evaluated(&self, later: EpochId) -> Result<Arc<Option<Evaluation>>> {
        self.once(&EVALUATE, later, || {
            let project = self.context.project;
            let Some(truth) = known_motion(project, later) else {
                return Ok(None);
            };
            let (first, measured) = (self.labelled(EpochId::REFERENCE)?, self.measured(later)?);
            let params = &project.settings.evaluate;
            let mut evaluation = Evaluation::new("the motion in the project file", params);
            let stones = first.stones.iter().zip(&measured.rows);
            let outcomes: Vec<StoneOutcome> = stones
                .map(|(stone, row)| outcome(row, stone.normal, Some(&measured.datum)))
                .collect();
            evaluation.stones = Some(score_stones(&outcomes, truth, params));
            if self.until > Until::Registered {
                evaluation.m3c2 = Option::clone(&*self.change_score(later)?);
            }
            Ok(Some(evaluation))
        })
    }
}
