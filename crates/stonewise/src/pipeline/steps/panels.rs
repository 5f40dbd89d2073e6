//! Which stones of the reference are panels of a door or the like.

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::edit::EDIT;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::until::Until;
use crate::storage::step::Key;
use std::sync::Arc;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::EpochId;
use stonewise_core::id::StoneId;
use stonewise_core::transfer::{StoneReliefs, panels};

/// Finds the stones of the reference that are panels of doors and the like.
pub static PANELS: Step = Step {
    name: STEP,
    needs: &[Need::same(&EDIT)],
    wanted: |until| until >= Until::Matched,
    cost: Some(|sizes, _| Cost::of(1, sizes.cloud_bytes(EpochId::REFERENCE))),
    make: |run, _| run.panels().map(drop),
    ..Step::PLAIN
};

/// Name of the step.
const STEP: &str = "panels";
/// File of the step.
const FILE: &str = "panels.json";

impl Run<'_> {
    /// The panels among the stones of the reference, ascending, but for stones that a person edited.
    pub fn panels(&self) -> Result<Arc<Vec<StoneId>>> {
        self.once(&PANELS, EpochId::REFERENCE, || {
            self.panels_of(STEP, &*self.labelled(EpochId::REFERENCE)?)
        })
    }

    /// The panels among the stones of an epoch, ascending, but for stones that a person edited. `name`: of the folder
    /// that holds the result.
    pub fn panels_of(&self, name: &str, labelled: &Labelled) -> Result<Vec<StoneId>> {
        let key = Key::new(STEP, &(), &[labelled.key.as_str()]);
        let step = self.context.step(name, key, |step, _| {
            let mut reliefs = StoneReliefs::new(&labelled.stones);
            for tile in 0..labelled.ingested.tiles.tile_count() {
                self.context.progress.check()?;
                let (cloud, labels) = (labelled.ingested.tiles.load(tile)?, labelled.labels(tile)?);
                for (i, stone) in labels.stone.iter().enumerate().filter(|(_, stone)| **stone != 0) {
                    reliefs.add(*stone, &cloud.world(i));
                }
            }
            write_json(&step.file(FILE), &panels(&labelled.stones, &reliefs))
        })?;
        let mut found: Vec<StoneId> = read_json(&step.file(FILE))?;
        found.retain(|id| !labelled.edited.contains_key(id));
        Ok(found)
    }
}
