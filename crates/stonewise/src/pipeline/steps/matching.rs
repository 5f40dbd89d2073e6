//! Matches of the stones of two epochs, before and after their labels are corrected.

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::Run;
use crate::pipeline::steps::label::Labelled;
use crate::storage::step::Key;
use nalgebra::Point3;
use std::sync::Arc;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::{CellSet, cell_of, cells_around};
use stonewise_core::id::StoneId;
use stonewise_core::matching::{Footprints, MatchReport, Surroundings, footprint_overlap, match_stones};
use stonewise_core::transfer::TileLabels;

/// Edge of the cells in which the second epoch's coverage is noted, metres: about half a stone.
const COVERAGE_CELL_M: f64 = 0.1;

impl Run<'_> {
    /// Finds the stones of the reference in a later epoch, in a step of this name. The same labels are compared
    /// once, for all callers.
    pub fn matches(&self, name: &str, labelled: Pair<&Labelled>, later: EpochId) -> Result<Arc<MatchReport>> {
        let params = &self.context.project.settings.r#match;
        let key = Key::new("match", params, &labelled.map(|l| l.key.as_str()).into_array());
        let names = [format!("match-{later}"), format!("{name}-{later}")];
        self.known(key.clone().as_str(), || find(self.context, names, key, labelled))
    }
}

fn find(
    context: &Context,
    [folder, name]: [String; 2],
    key: Key,
    labelled: Pair<&Labelled>,
) -> Result<MatchReport> {
    let step = context.step_in(&folder, &name, key, &[], |step, _| {
        let (_, footprints) = survey(context, labelled.first)?;
        let (covered, footprints_2) = survey(context, labelled.later)?;
        let overlap = footprint_overlap(&footprints, &footprints_2);
        let sees =
            |p: &Point3<f64>| cells_around(cell_of(p, COVERAGE_CELL_M)).any(|cell| covered.contains(&cell));
        let surroundings = Surroundings {
            covered: &sees,
            overlap: Some(&overlap),
        };
        let params = &context.project.settings.r#match;
        let stones = labelled.map(|l| &l.stones);
        let report = match_stones(stones.first, stones.later, &surroundings, params);
        write_json(&step.file("matches.json"), &report)
    })?;
    read_json(&step.file("matches.json"))
}

type Cell = [i64; 3];

/// Cells that hold points which a photo of the epoch sees, and where its stones lie.
fn survey(context: &Context, epoch: &Labelled) -> Result<(CellSet<Cell>, Footprints)> {
    let mut covered = CellSet::default();
    let mut last = None;
    let mut footprints = Footprints::new();
    let tiles = &epoch.ingested.tiles;
    let load = |tile| epoch.points(tile);
    let take = |_, (cloud, labels): (Cloud, TileLabels)| {
        for i in (0..cloud.len()).filter(|&i| labels.seen[i]) {
            let place = cloud.world(i);
            let cell = cell_of(&place, COVERAGE_CELL_M);
            if last.replace(cell) != Some(cell) {
                covered.insert(cell);
            }
            if labels.stone[i] != 0 {
                footprints.add(StoneId(labels.stone[i]), &place);
            }
        }
        Ok(())
    };
    let all = 0..tiles.tile_count();
    context.progress.each_prepared("footprints", all, load, take)?;
    Ok((covered, footprints))
}
