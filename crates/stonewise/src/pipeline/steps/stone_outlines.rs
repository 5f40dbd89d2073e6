//! The outlines of an epoch's stones.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::results::{StoneOutline, write_outlines};
use crate::storage::step::{Key, StepDir};
use crate::storage::store::Name;
use nalgebra::Point3;
use std::collections::BTreeMap;
use stonewise_core::cloud::TileSource;
use stonewise_core::geometry::{OutlineParams, face_outline};
use stonewise_core::stone::Stone;

/// Makes the outlines of the reference's stones in a step of this name; those of the same labels once.
pub fn make_outlines(context: &Context, first: &Labelled, name: &str) -> Result<StepDir> {
    let key = Key::new("outlines", &(), &[first.key.as_str()]);
    let name = Name {
        step: name,
        folder: "outlines",
    };
    context.step(name, key, |step, _| {
        write_outlines(step.path(), &stone_outlines(context, first)?)
    })
}

/// The outlines of an epoch's stones. Cost: one pass over all tiles; memory holds the points of the stones.
pub fn stone_outlines(context: &Context, first: &Labelled) -> Result<Vec<StoneOutline>> {
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
