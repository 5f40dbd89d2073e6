//! A thinned cloud.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::results::ThinPoint;
use nalgebra::Point3;
use stonewise_core::cloud::TileSource;
use stonewise_core::statistics::split_mix;

/// Points kept of an epoch, about.
const WANTED: u64 = 220_000;
/// Colour of a point that no photo shows.
const GREY: [u8; 3] = [150; 3];

/// A kept point on its way to a colour.
pub struct Candidate {
    pub point: ThinPoint,
    /// Where it was surveyed; elsewhere only where the project moves the epoch.
    pub surveyed: Point3<f64>,
    /// The photo that will colour it.
    pub photo: Option<usize>,
}

/// Every n-th point at random, the same ones in every run.
pub fn thin_cloud(context: &Context, epoch: &Labelled) -> Result<Vec<Candidate>> {
    let tiles = &epoch.ingested.tiles;
    let every = tiles.surveyed.point_count().div_ceil(WANTED).max(1);
    let mut kept = Vec::new();
    let all = 0..tiles.tile_count();
    let candidates = |tile| -> Result<Vec<Candidate>> {
        let (moved, surveyed, labels) = (tiles.load(tile)?, tiles.surveyed.load(tile)?, epoch.labels(tile)?);
        let chosen =
            (0..moved.len()).filter(|&i| split_mix((tile as u64) << 40 | i as u64).is_multiple_of(every));
        let candidates = chosen.map(|i| Candidate {
            point: ThinPoint {
                position: moved.world(i),
                colour: GREY,
                stone: labels.stone[i],
            },
            surveyed: surveyed.world(i),
            photo: None,
        });
        Ok(candidates.collect())
    };
    context
        .progress
        .each_prepared("thin cloud", all, candidates, |_, candidates| {
            kept.extend(candidates);
            Ok(())
        })?;
    Ok(kept)
}
