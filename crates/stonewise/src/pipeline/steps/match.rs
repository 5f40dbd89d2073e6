//! The same stones in two epochs.

use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::storage::step::Key;
use nalgebra::Point3;
use stonewise_core::cloud::TileSource;
use stonewise_core::geometry::{CellSet, cell_of};
use stonewise_core::id::StoneId;
use stonewise_core::matching::{Footprints, MatchReport, Surroundings, footprint_overlap, match_stones};
use stonewise_core::stone::MatchOutcome;

/// Edge of the cells in which the second epoch's coverage is noted, metres: about half a stone.
const COVERAGE_CELL_M: f64 = 0.1;

/// Matches of two epochs.
pub struct Matched {
    /// What became of every stone.
    pub report: MatchReport,
}

impl Matched {
    /// Matched stones, ascending by stone of the first epoch.
    pub fn pairs(&self) -> Vec<(StoneId, StoneId)> {
        let partner = |(first, outcome): &(StoneId, MatchOutcome)| match outcome {
            MatchOutcome::Matched { second } => Some((*first, *second)),
            MatchOutcome::Unmatched(_) => None,
        };
        self.report.outcomes.iter().filter_map(partner).collect()
    }
}

/// Finds the stones of the first epoch in the second.
pub fn r#match(context: &Context, first: &Labelled, second: &Labelled, number: usize) -> Result<Matched> {
    let report = match_in(context, &format!("match-{number}"), first, second)?;
    Ok(Matched { report })
}

/// The same in a step of this name.
pub fn match_in(context: &Context, name: &str, first: &Labelled, second: &Labelled) -> Result<MatchReport> {
    let params = &context.project.settings.r#match;
    let key = Key::new("match", params, &[first.key.as_str(), second.key.as_str()]);
    let step = context.step(name, key, |step, _| {
        let (_, footprints) = survey(context, first)?;
        let (covered, footprints_2) = survey(context, second)?;
        let overlap = footprint_overlap(&footprints, &footprints_2);
        let sees =
            |p: &Point3<f64>| neighbourhood(cell_of(p, COVERAGE_CELL_M)).any(|cell| covered.contains(&cell));
        let surroundings = Surroundings {
            covered: &sees,
            overlap: Some(&overlap),
        };
        let report = match_stones(&first.stones, &second.stones, &surroundings, params);
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
    for tile in 0..epoch.ingested.tiles.tile_count() {
        context.progress.check()?;
        let (cloud, labels) = (epoch.ingested.tiles.load(tile)?, epoch.labels(tile)?);
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
    }
    Ok((covered, footprints))
}

fn neighbourhood(cell: Cell) -> impl Iterator<Item = Cell> {
    (0..27i64).map(move |i| [cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1])
}
