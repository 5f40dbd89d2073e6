//! M3C2 with the error of the epochs' registration: tables, and scores where a motion is known.

use crate::error::Result;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::outputs::crs::coordinate_system;
use crate::pipeline::outputs::m3c2::write_m3c2;
use crate::pipeline::steps::known_motion::known_motion;
use crate::pipeline::steps::m3c2::{M3C2, change_field, with_datum};
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::names::DATA_DIR;
use std::sync::Arc;
use stonewise_core::change::{ChangeField, ChangePoint};
use stonewise_core::cloud::GridIndex;
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::{MotionScore, score_change};

/// Writes the distances of a later epoch with their detection limits.
pub static CHANGE: Step = Step {
    name: "change",
    about: About::Later,
    needs: &[Need::same(&M3C2), Need::same(&MEASURE)],
    wanted: |until| until >= Until::Compared,
    make: |run, epoch| run.change_score(epoch).map(drop),
    ..Step::PLAIN
};

impl Run<'_> {
    /// Scores of the distances of a later epoch, which are written; `None` where no motion is known.
    pub fn change_score(&self, later: EpochId) -> Result<Arc<Option<MotionScore>>> {
        self.once(&CHANGE, later, || {
            let (context, measured) = (self.context, self.measured(later)?);
            let params = &context.project.settings.m3c2;
            let registered = self.registered(later)?;
            let field = change_field(&*self.compared(later)?)?;
            let field = with_datum(field, params, &measured.datum, registered.epoch_errors.as_ref());
            let crs = coordinate_system(context.project)?;
            context.timed("write m3c2", || {
                write_m3c2(&context.out.join(DATA_DIR), later, crs.as_ref(), &field)
            })?;
            self.score(later, &field)
        })
    }

    fn score(&self, later: EpochId, field: &ChangeField) -> Result<Option<MotionScore>> {
        let Some(truth) = known_motion(self.context.project, later) else {
            return Ok(None);
        };
        let stones = &self.labelled(EpochId::REFERENCE)?.stones;
        let index = GridIndex::new(&stones.iter().map(|s| s.centroid).collect::<Vec<_>>(), 0.5);
        let face = |p: &ChangePoint| {
            index
                .nearest(&p.position, 2.0)
                .map_or(p.normal, |(i, _)| stones[i].normal)
        };
        let params = &self.context.project.settings.evaluate;
        Ok(Some(score_change(field, truth, face, params)))
    }
}
