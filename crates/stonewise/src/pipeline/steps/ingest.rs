//! Points of an epoch, ready to be worked on tile by tile.

use crate::error::{Error, Result};
use crate::pipeline::context::Context;
use crate::storage::epoch_tiles::EpochTiles;
use crate::storage::step::{Key, StepDir};
use crate::storage::tiles::{DiskTiles, cut_into_tiles};
use crate::texts::notices::INVALID_POINTS;
use nalgebra::Point3;
use stonewise_core::cloud::TileSource;

/// The tiles of an epoch and the step that made them.
pub struct Ingested {
    /// Folder and key of the tiles as surveyed.
    pub step: StepDir,
    /// The tiles, moved where the project says so.
    pub tiles: EpochTiles,
}

/// Cuts the clouds of an epoch into tiles.
pub fn ingest(context: &Context, number: usize) -> Result<Ingested> {
    let epoch = &context.project.epochs[number - 1];
    let digests = epoch
        .clouds
        .iter()
        .map(|c| context.digest(c))
        .collect::<Result<Vec<_>>>()?;
    let inputs: Vec<&str> = digests.iter().map(String::as_str).collect();
    let size_m = context.project.settings.ingest.size_m;
    let part = &context.project.part;
    let key = Key::new(
        "ingest",
        &(&context.project.settings.ingest, part, epoch.sources),
        &inputs,
    );
    let step = context.step(&format!("ingest-{number}"), key, |step, warnings| {
        let takes_part = |p: &Point3<f64>| part.as_ref().is_none_or(|part| part.contains(p));
        let invalid = cut_into_tiles(
            &epoch.clouds,
            epoch.sources,
            size_m,
            takes_part,
            step,
            context.progress,
        )?;
        if invalid > 0 {
            let message = INVALID_POINTS.say(&[("n", &invalid.to_string())]);
            warnings.notice("ingest", epoch.name.clone(), message);
        }
        Ok(())
    })?;
    let tiles = EpochTiles {
        surveyed: DiskTiles::open(step.path())?,
        motion: epoch.motion.clone(),
    };
    if tiles.tile_count() == 0 {
        return Err(Error::Survey(format!(
            "the clouds of epoch {:?} hold no points{}",
            epoch.name,
            if part.is_some() {
                " in the part that takes part"
            } else {
                ""
            }
        )));
    }
    Ok(Ingested { step, tiles })
}
