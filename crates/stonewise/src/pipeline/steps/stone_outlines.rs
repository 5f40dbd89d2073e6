//! The outlines of an epoch's stones.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::results::{StoneOutline, write_outlines};
use crate::storage::step::{Key, StepDir};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::geometry::{OutlineParams, face_outline};
use stonewise_core::transfer::TileLabels;

/// Makes the outlines of the reference's stones in a step of this name; those of the same labels once.
pub fn make_outlines(context: &Context, first: &Labelled, name: &str) -> Result<StepDir> {
    let key = Key::new("outlines", &(), &[first.key.as_str()]);
    context.step_in("outlines", name, key, &[], |step, _| {
        write_outlines(step.path(), &stone_outlines(context, first)?)
    })
}

/// The outlines of an epoch's stones. Cost: one pass over all tiles and one more over their labels; memory holds
/// a tile a thread, and the points of the stones that further tiles continue.
pub fn stone_outlines(context: &Context, first: &Labelled) -> Result<Vec<StoneOutline>> {
    let tiles = &first.ingested.tiles;
    let mut last_tiles: BTreeMap<u32, usize> = BTreeMap::new();
    for tile in 0..tiles.tile_count() {
        context.progress.check()?;
        let mut stones = first.labels(tile)?.stone;
        stones.sort_unstable();
        stones.dedup();
        last_tiles.extend(stones.into_iter().map(|stone| (stone, tile)));
    }
    let normals: BTreeMap<u32, Vector3<f64>> = first.stones.iter().map(|s| (s.id.0, s.normal)).collect();
    let mut points: BTreeMap<u32, Vec<Point3<f64>>> = BTreeMap::new();
    let mut outlines: BTreeMap<u32, StoneOutline> = BTreeMap::new();
    let all = 0..tiles.tile_count();
    let load = |tile| first.points(tile);
    let take = |tile, (cloud, labels): (Cloud, TileLabels)| {
        for (i, &stone) in labels.stone.iter().enumerate().filter(|(_, s)| **s != 0) {
            points.entry(stone).or_default().push(cloud.world(i));
        }
        let complete: Vec<_> = points
            .extract_if(.., |stone, _| last_tiles.get(stone) == Some(&tile))
            .collect();
        outlines.par_extend(complete.into_par_iter().filter_map(|(stone_id, points)| {
            let normal = *normals.get(&stone_id)?;
            let ring = face_outline(&points, &normal, &OutlineParams::default())?;
            Some((
                stone_id,
                StoneOutline {
                    stone_id,
                    normal,
                    ring,
                },
            ))
        }));
        Ok(())
    };
    context.progress.each_prepared("outlines", all, load, take)?;
    Ok(outlines.into_values().collect())
}
