//! The outlines of the reference's stones, and the unrolled wall.

use crate::error::{Error, Result};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{Need, Phase, Run, Step};
use crate::pipeline::steps::edit::EDIT;
use crate::pipeline::steps::stone_outlines::make_outlines;
use crate::pipeline::until::Until;
use crate::results::names::OUTLINES as FILE;
use crate::results::{Facade, StoneOutline, facade_of, read_outlines};
use std::collections::BTreeMap;
use std::fs;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_io::atomic::write_atomically;

/// Writes the outlines of the reference's stones.
pub static OUTLINES: Step = Step {
    name: "outlines",
    phase: Some(Phase::Find),
    needs: &[Need::same(&EDIT)],
    wanted: |until| until >= Until::Matched,
    cost: Some(|sizes, _| Cost::of(1, 2 * sizes.cloud_bytes(EpochId::REFERENCE))),
    make: |run, _| run.outlined().map(drop),
    ..Step::PLAIN
};

/// Where the stones of the reference lie.
pub struct Outlined {
    /// Their outlines, by stone.
    pub outlines: BTreeMap<u32, StoneOutline>,
    /// The unrolled wall.
    pub facade: Facade,
}

impl Run<'_> {
    /// Where the stones of the reference lie; their outlines are written.
    pub fn outlined(&self) -> Result<Arc<Outlined>> {
        self.once(&OUTLINES, EpochId::REFERENCE, || {
            let first = self.labelled(EpochId::REFERENCE)?;
            let out = &self.context.out;
            let (step, to) = (make_outlines(self.context, &first, "outlines")?, out.join(FILE));
            write_atomically(&to, |partial| fs::copy(step.file(FILE), partial).map(|_| ()))
                .map_err(Error::io("writing", &to))?;
            let outlines = read_outlines(out)?;
            let facade = match &self.corrected()?.edited {
                Some(edited) => edited.facade.clone(),
                None => facade_of(first.stones.iter().map(|s| (s.id.0, s.centroid)), &outlines),
            };
            Ok(Outlined { outlines, facade })
        })
    }
}
