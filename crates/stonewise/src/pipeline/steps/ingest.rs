//! Points of an epoch, ready to be worked on tile by tile.

use crate::error::{Error, Result};
use crate::pipeline::context::Context;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Phase, Run, Step};
use crate::project::Epoch;
use crate::storage::epoch_tiles::{EpochTiles, KnownMotion};
use crate::storage::step::{Key, StepDir};
use crate::storage::tiles::{DiskTiles, Keeps, cut_into_tiles};
use crate::texts::notices::{INVALID_POINTS, UNUSED_POINTS};
use nalgebra::Point3;
use std::sync::Arc;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_io::cloud::{cloud_remarks, cloud_scans};

/// Cuts the clouds of an epoch into tiles.
pub static INGEST: Step = Step {
    name: "ingest",
    phase: Some(Phase::Read),
    about: About::Epoch,
    // Tiles are sorted in a buffer of a quarter of a gibibyte.
    cost: Some(|_, _| Cost::of(2, 256 << 20)),
    make: |run, epoch| run.ingested(epoch).map(drop),
    ..Step::PLAIN
};

impl Run<'_> {
    /// The tiles of an epoch.
    pub fn ingested(&self, epoch: EpochId) -> Result<Arc<Ingested>> {
        self.once(&INGEST, epoch, || ingest(self.context, epoch))
    }

    /// The tiles of the reference and of a later epoch, in the frame of the reference.
    pub fn clouds(&self, later: EpochId) -> Result<Pair<Arc<Ingested>>> {
        Ok(Pair::new(self.placed(EpochId::REFERENCE)?, self.placed(later)?))
    }
}

/// The tiles of an epoch and the step that made them.
pub struct Ingested {
    /// Folder and key of the tiles as surveyed.
    pub step: StepDir,
    /// The tiles, moved where the project says so.
    pub tiles: EpochTiles,
}

/// Positions of the scanners of an epoch, where its files name them.
pub fn scanners(epoch: &Epoch) -> Result<Vec<Point3<f64>>> {
    let mut positions = Vec::new();
    for cloud in &epoch.clouds {
        let scans = cloud_scans(cloud)?.into_iter();
        positions.extend(scans.filter_map(|scan| scan.origin));
    }
    Ok(positions)
}

fn ingest(context: &Context, id: EpochId) -> Result<Ingested> {
    let epoch = &context.project.epochs[id];
    let digests = epoch
        .clouds
        .iter()
        .map(|c| context.digest(c))
        .collect::<Result<Vec<_>>>()?;
    let inputs: Vec<&str> = digests.iter().map(String::as_str).collect();
    let size_m = context.project.settings.ingest.size_m;
    let part = &context.project.part;
    let keeps = match context.project.has_views(id) {
        true => Keeps::Values,
        false => Keeps::Places,
    };
    let key = Key::new(
        "ingest",
        &(&context.project.settings.ingest, part, epoch.sources, keeps),
        &inputs,
    );

    let step = context.step(&format!("ingest-{id}"), key, |step, warnings| {
        let takes_part = |p: &Point3<f64>| part.as_ref().is_none_or(|part| part.contains(p));
        let summary = cut_into_tiles(
            &epoch.clouds,
            epoch.sources,
            size_m,
            (keeps, takes_part),
            step,
            context.progress,
        )?;
        let [all, invalid, unused] =
            [summary.records, summary.skipped, summary.unused].map(|n| n.to_string());
        if summary.skipped > 0 {
            let message = INVALID_POINTS.say(&[("n", (&*invalid).into())]);
            warnings.notice("ingest", epoch.name.clone(), message);
        }
        if summary.unused > 0 {
            let message = UNUSED_POINTS.say(&[("n", (&*unused).into()), ("all", (&*all).into())]);
            warnings.notice("ingest", epoch.name.clone(), message);
        }
        for cloud in &epoch.clouds {
            // The check says what is doubtful.
            for remark in cloud_remarks(cloud)?.into_iter().filter(|r| !r.is_doubt) {
                warnings.notice("ingest", cloud.to_string_lossy(), remark.text);
            }
        }
        Ok(())
    })?;

    let tiles = EpochTiles {
        surveyed: DiskTiles::open(step.path())?,
        motion: epoch.motion.clone().map(KnownMotion::of_points),
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
