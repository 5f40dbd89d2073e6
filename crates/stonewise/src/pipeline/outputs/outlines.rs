//! The outlines of the first epoch's stones.

use crate::error::{Error, Result};
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::results::names::OUTLINES;
use crate::results::{StoneOutline, write_outlines};
use crate::storage::step::{Key, StepDir};
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::fs;
use stonewise_core::cloud::TileSource;
use stonewise_core::geometry::{OutlineParams, face_outline};
use stonewise_core::stone::Stone;
use stonewise_io::atomic::write_atomically;

/// The step that makes the outlines of the stones as they were found.
pub const OUTLINES_STEP: &str = "outlines";

/// Writes the outlines of the first epoch's stones.
pub fn write_stone_outlines(context: &Context, first: &Labelled) -> Result<()> {
    let name = match first.edited.is_empty() {
        true => OUTLINES_STEP,
        false => "outlines-edited",
    };
    let step = make_outlines(context, first, name)?;
    let to = context.out.join(OUTLINES);
    write_atomically(&to, |partial| fs::copy(step.file(OUTLINES), partial).map(|_| ()))
        .map_err(Error::io("writing", &to))
}

/// Makes the outlines in a step of this name.
pub fn make_outlines(context: &Context, first: &Labelled, name: &str) -> Result<StepDir> {
    let key = Key::new("outlines", &(), &[first.key.as_str()]);
    context.step(name, key, |step, _| {
        write_outlines(step.path(), &stone_outlines(context, first)?)
    })
}

fn stone_outlines(context: &Context, first: &Labelled) -> Result<Vec<StoneOutline>> {
    let mut points: BTreeMap<u32, Vec<Point3<f64>>> = BTreeMap::new();
    let tiles = &first.ingested.tiles;
    let all = 0..tiles.tile_count();
    context.progress.each("outlines", all, |tile| -> Result<()> {
        let (cloud, labels) = (tiles.load(tile)?, first.labels(tile)?);
        for (i, &stone) in labels.stone.iter().enumerate().filter(|(_, s)| **s != 0) {
            points.entry(stone).or_default().push(cloud.world(i));
        }
        Ok(())
    })?;
    let params = OutlineParams::default();
    let outline = |stone: &Stone| {
        let ring = face_outline(points.get(&stone.id.0)?, &stone.normal, &params)?;
        Some(StoneOutline {
            stone_id: stone.id.0,
            normal: stone.normal,
            ring,
        })
    };
    Ok(first.stones.iter().filter_map(outline).collect())
}
