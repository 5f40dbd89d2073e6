//! Which stones of the first epoch are panels of a door or the like.

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::storage::step::Key;
use stonewise_core::cloud::TileSource;
use stonewise_core::id::StoneId;
use stonewise_core::transfer::{StoneReliefs, panels};

/// Name of the step.
const STEP: &str = "panels";

/// The panels among the stones of the first epoch, ascending, but for stones that a person edited.
pub fn panels_among(context: &Context, first: &Labelled) -> Result<Vec<StoneId>> {
    let key = Key::new(STEP, &(), &[first.key.as_str()]);
    let step = context.step(STEP, key, |step, _| {
        let mut reliefs = StoneReliefs::new(&first.stones);
        for tile in 0..first.ingested.tiles.tile_count() {
            context.progress.check()?;
            let (cloud, labels) = (first.ingested.tiles.load(tile)?, first.labels(tile)?);
            for (i, stone) in labels.stone.iter().enumerate().filter(|(_, stone)| **stone != 0) {
                reliefs.add(*stone, &cloud.world(i));
            }
        }
        write_json(&step.file("panels.json"), &panels(&first.stones, &reliefs))
    })?;
    let mut found: Vec<StoneId> = read_json(&step.file("panels.json"))?;
    found.retain(|id| !first.edited.contains_key(id));
    Ok(found)
}
