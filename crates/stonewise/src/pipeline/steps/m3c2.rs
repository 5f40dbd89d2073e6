//! M3C2 between two epochs of a project.

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::steps::ingest::Ingested;
use crate::pipeline::storage::step::Key;
use stonewise_core::change::{ChangeField, OutwardReference, m3c2_survey};

/// Compares two epochs along the normals of the first.
pub fn m3c2(
    context: &Context,
    epochs: [&Ingested; 2],
    number: usize,
    outward: &OutwardReference,
) -> Result<ChangeField> {
    let params = &context.project.settings.m3c2;
    let motions = epochs.map(|e| &e.tiles.motion);
    let key = Key::new("m3c2", &(params, motions), &epochs.map(|e| e.step.key().as_str()));
    let step = context.step(&format!("m3c2-{number}"), key, |step, _| {
        let mut field = ChangeField::default();
        m3c2_survey(
            &epochs[0].tiles,
            &epochs[1].tiles,
            outward,
            params,
            context.progress,
            |_, tile| {
                field.points.extend(tile.points);
                Ok(())
            },
        )?;
        write_json(&step.file("field.json"), &field)
    })?;
    read_json(&step.file("field.json"))
}
