//! What the next survey will be able to see, from the first one alone.
//!
//! The clouds of the first epoch stand for those of a repetition, with errors of registration of their own: every
//! station is moved as much as the stations of the epoch are found to be off. The photos are divided at random between
//! the two. What the adjustment then says of its accuracy is what it will say of a repetition.

mod expected;
mod page;
mod repetition;
mod table;

use crate::error::{Error, Result};
use crate::experiment::baseline::{InventoryStone, baseline};
use crate::experiment::halves::halves_of;
use crate::experiment::inner_work::InnerWork;
use crate::experiment::predicted::{limits_mm, medians_mm, without_chance};
use crate::files::{write_readable_json, write_text};
use crate::pipeline::{Context, Run, Until};
use crate::project::Project;
use crate::results::records::DatumState;
use crate::results::{RowMotion, Status, StoneRow, read_outlines};
use crate::storage::store::{Keeps, StepStore};
pub use expected::Design;
use expected::{Expected, Foreseen, expect, variances};
use page::page;
use repetition::moved_clouds;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::FaceFrame;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_io::table::{write_csv, write_parquet};
use table::stone_table;

/// Stones of two divisions of the photos are the same if their middles are nearer than this share of their size.
const SAME_PLACE: f64 = 0.4;
/// What the table as a whole holds.
const DESCRIPTION: &str = "One row per stone of the first epoch: what it is like, and the standard deviations that a \
    repetition of the survey will give. Empty cells: the stone will not be measured.";

/// Predicts what a repetition of the project's first survey will see; writes `design.json`, `design.csv`,
/// `design.parquet` and `design.html` into `out`. An interrupted prediction goes on where it stopped.
///
/// # Errors
/// What stops the registration of the two halves; no stone can be measured.
pub fn design(project: &Project, seed: u64, out: &Path, progress: &dyn Progress) -> Result<Design> {
    let store = Arc::new(StepStore::new(&out.join("work"), Keeps::Every)?);
    let inner = InnerWork(progress);
    progress.begin("the survey and its repetition", 4);
    let (baseline, inventory) = baseline(project, &out.join("baseline"), &store, &inner)?;
    progress.advance(1);
    let mut repeated = halves_of(project, project.epochs.reference(), seed, &store, &inner)?;
    let later = EpochId::at(1);

    for epoch in repeated.epochs.iter_mut() {
        epoch.clouds.clone_from(&project.epochs.reference().clouds);
        // A repetition is registered anew.
        epoch.same_survey_as = None;
    }

    progress.advance(1);
    let folder = out.join("repetition");
    let components = {
        let context = Context::with_store(&repeated, &folder, Arc::clone(&store), &inner)?;
        let registered = Run::new(&context, Until::Registered).registered(later)?;
        registered.epoch_errors.as_ref().and_then(|e| e.components)
    };
    progress.advance(1);

    if let Some(components) = components {
        let sizes = [components.translation_m, components.rotation_m];
        repeated.epochs[later].clouds = moved_clouds(&repeated.epochs[later], sizes, seed, &store)?;
    }

    let context = Context::with_store(&repeated, &folder, store, &inner)?;
    let run = Run::new(&context, Until::Registered);
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    progress.advance(1);
    let outlines = read_outlines(&folder)?;
    let (errors, relative) = (registered.errors(), registered.relative_errors());
    let sources = registered.epoch_errors.as_ref().map_or(1, |e| {
        let of_first = e.sources.iter().filter(|s| s.epoch == 0);
        of_first.count().max(1)
    });
    let shared_m = registered.epoch_errors.as_ref().map_or(0.0, |e| e.shared_error_m);
    let is_known = measured.datum.state != DatumState::Unknown;

    let expected = |row: &StoneRow, motion: &RowMotion| {
        let stone = StoneId(row.stone_id);
        let of_registration = match is_known {
            true => errors.get(&stone).map(|e| e.covariance),
            false => relative.get(&stone).map(|c| **c),
        };
        let normal = outlines.get(&row.stone_id).map(|o| o.normal);
        let face = FaceFrame::from_normal(&normal.unwrap_or_default()).face_from_world();
        let [all, registration] = [motion.covariance, of_registration.unwrap_or_default()]
            .map(|covariance| variances(&(face * covariance * face.transpose())));
        // What both epochs share by assumption stays, whatever the number of stations.
        let shared = if is_known { 2.0 * shared_m * shared_m } else { 0.0 };
        expect(all, registration, shared, sources, motion.deformation_sd)
    };

    let rows = without_chance(&measured.rows, registered.deformation.as_ref(), &outlines);
    let repeated: Vec<(&StoneRow, Option<Expected>)> = { rows.iter() }
        .map(|row| (row, row.motion.as_ref().map(|motion| expected(row, motion))))
        .collect();
    let all = foreseen(inventory, repeated);
    let found: Vec<&Expected> = all.iter().filter_map(|s| s.expected.as_ref()).collect();

    if found.is_empty() {
        return Err(Error::Survey(
            "no stone was measured: the survey shows no stone well enough".to_owned(),
        ));
    }

    let deformation = registered.deformation.as_ref();
    let design = Design {
        epoch: project.epochs.reference().name.clone(),
        seed,
        stones: [all.len(), found.len()],
        not_measured: { all.iter().filter(|s| s.expected.is_none()) }.fold(
            BTreeMap::new(),
            |mut counts, s| {
                *counts.entry(s.status.to_string()).or_default() += 1;
                counts
            },
        ),
        datum: measured.datum.state,
        sd_mm: medians_mm(&found, |e, axis| Some(e.sd[axis])),
        sd_deformation_mm: medians_mm(&found, |e, axis| e.deformation[axis]),
        zones_mm: limits_mm(deformation, |d| d.detection_limits_m),
        zones_in_face_mm: limits_mm(deformation, |d| d.limits_in_face_m),
        sources,
        sd_with_one_more_mm: medians_mm(&found, |e, axis| Some(e.one_more[axis])),
        sd_without_registration_mm: medians_mm(&found, |e, axis| Some(e.without_registration[axis])),
        baseline,
    };

    write_readable_json(&out.join("design.json"), &design)?;
    let table = stone_table(&all)?;
    write_parquet(&out.join("design.parquet"), &table)?;
    write_csv(&out.join("design.csv"), &table, DESCRIPTION, Some("stone_id"))?;
    write_text(&out.join("design.html"), &page(&design, &all))?;
    Ok(design)
}

/// The stones of the inventory, each with what the repetition says of the stone at its place. Half of the photos may not
/// show a stone that all of them show.
fn foreseen(
    inventory: Vec<InventoryStone>,
    mut repeated: Vec<(&StoneRow, Option<Expected>)>,
) -> Vec<Foreseen> {
    let at_the_place_of = |stone: InventoryStone| {
        let distance = |row: &StoneRow| (row.centroid - stone.row.centroid).norm();
        let nearest = { repeated.iter().enumerate() }
            .map(|(i, (row, _))| (i, distance(row)))
            .filter(|(_, distance)| *distance < SAME_PLACE * stone.row.area_m2.max(0.0).sqrt())
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match nearest {
            Some((i, _)) => {
                let (row, expected) = repeated.swap_remove(i);
                let status = row.status;
                Foreseen {
                    stone,
                    status,
                    expected,
                }
            }
            None => Foreseen {
                stone,
                status: Status::UnmatchedUnseen,
                expected: None,
            },
        }
    };
    inventory.into_iter().map(at_the_place_of).collect()
}
