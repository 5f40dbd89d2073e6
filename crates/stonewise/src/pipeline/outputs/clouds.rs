//! The input clouds again, with the stone of every point.

use crate::error::{Error, Result};
use crate::output::cloud_names;
use crate::pipeline::context::Context;
use crate::pipeline::cost::Cost;
use crate::pipeline::graph::{About, Need, Phase, Run, Step};
use crate::pipeline::outputs::outlines::OUTLINES;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::StoneRow;
use crate::storage::step::Key;
use std::collections::BTreeMap;
use std::path::PathBuf;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::EpochId;
use stonewise_core::id::StoneId;
use stonewise_io::cloud::{LabelColumns, PointLabel, PointMotion, write_labelled};

/// Writes the clouds of an epoch with the stone of every point.
pub static CLOUDS: Step = Step {
    name: "clouds",
    phase: Some(Phase::Write),
    about: About::Epoch,
    needs: &[
        Need::first_later(&MEASURE).when(|_, epoch| epoch.is_reference()),
        Need::same(&OUTLINES),
    ],
    wanted: |until| matches!(until, Until::Labelled | Until::Reported),
    cost: Some(|sizes, epoch| Cost::of(1, sizes.cloud_bytes(epoch))),
    make: |run, epoch| run.write_clouds(epoch),
    ..Step::PLAIN
};

impl Run<'_> {
    /// The points of the reference get the motions of the first later epoch, too, in a run that goes so far.
    fn write_clouds(&self, epoch: EpochId) -> Result<()> {
        let first_later = self.context.project.epochs.later_ids().next();
        let moved = first_later.filter(|_| epoch.is_reference() && self.until == Until::Reported);
        let measured = moved.map(|later| self.measured(later)).transpose()?;
        let rows = measured.as_ref().map(|m| m.rows.as_slice());
        let labelled = self.labelled(epoch)?;
        self.once(&CLOUDS, epoch, || {
            write_clouds(self.context, epoch, &labelled, rows)
        })
        .map(drop)
    }
}

/// Writes every cloud of an epoch, in input order, with `stone_id`; with motions too where rows are given.
fn write_clouds(
    context: &Context,
    id: EpochId,
    labelled: &Labelled,
    rows: Option<&[StoneRow]>,
) -> Result<()> {
    let epoch = &context.project.epochs[id];
    let names = cloud_names(id.number(), &epoch.clouds);
    let outputs: Vec<PathBuf> = names.iter().map(|name| context.out.join(name)).collect();
    let motions = rows.map_or_else(BTreeMap::new, motions);
    let key = Key::new("clouds", &format!("{motions:?}"), &[labelled.key.as_str()]);
    let name = format!("clouds-{id}");
    // Clouds of the last run are needed where it did this step.
    if let Some(output) = context.output.filter(|_| context.store.has(&name, &key)) {
        names.iter().try_for_each(|name| output.bring_back(name))?;
    }
    context.step_in(&name, &name, key, &outputs, |_, _| {
        for (file, (input, output)) in epoch.clouds.iter().zip(&outputs).enumerate() {
            let stones = stones_of_file(labelled, file as u32)?;
            let columns = if rows.is_some() {
                LabelColumns::StoneAndMotion
            } else {
                LabelColumns::Stone
            };
            let title = format!(
                "write {}",
                output.file_name().unwrap_or_default().to_string_lossy()
            );
            context.progress.begin(&title, stones.len() as u64);
            write_labelled(input, output, columns, |chunk| {
                context.progress.check()?;
                context.progress.advance(chunk.len() as u64);
                let label = |&index: &u64| {
                    let stone = stones.get(index as usize).copied().filter(|&s| s != 0);
                    PointLabel {
                        stone: stone.map(StoneId),
                        motion: stone.and_then(|s| motions.get(&s).copied()),
                        dropped: false,
                    }
                };
                Ok::<_, Error>(chunk.indices.iter().map(label).collect())
            })?;
        }
        Ok(())
    })?;
    Ok(())
}

fn motions(rows: &[StoneRow]) -> BTreeMap<u32, PointMotion> {
    let motion = |row: &StoneRow| {
        let m = row.motion.as_ref()?;
        Some((
            row.stone_id,
            PointMotion {
                displacement_m: m.displacement.cast(),
                significant: m.significant,
            },
        ))
    };
    rows.iter().filter_map(motion).collect()
}

/// Stone of every record of one input file, 0 for none.
fn stones_of_file(labelled: &Labelled, file: u32) -> Result<Vec<u32>> {
    let tiles = &labelled.ingested.tiles.surveyed;
    let mut stones = Vec::new();
    for tile in 0..tiles.tile_count() {
        let (origin, labels) = (tiles.provenance(tile)?, labelled.labels(tile)?);
        for ((&from, &index), &stone) in origin.file.iter().zip(&origin.index).zip(&labels.stone) {
            if from == file {
                let index = index as usize;
                if stones.len() <= index {
                    stones.resize(index + 1, 0);
                }
                stones[index] = stone;
            }
        }
    }
    Ok(stones)
}
