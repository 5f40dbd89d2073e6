//! What the majority of the photos decided about single instances.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::results::names::audit;
use std::path::Path;
use stonewise_core::epoch::EpochId;
use stonewise_core::id::ImageId;
use stonewise_core::transfer::AuditEvent;
use stonewise_io::table::{Table, write_csv};

/// What the table as a whole holds.
const DESCRIPTION: &str = "What the majority of the photos decided about merged, split and dropped instances of an epoch, one row per \
    decision. Empty cells: the decision has no such number.";

/// Meaning of the column `event`.
const EVENTS: &str = "the decision: split_instance (a mask that covers several stones was divided), joined_fragment (a mask of a part was given to its stone), \
        outvoted_instance (most photos show something else there), joined_parts (stones that another epoch shows as one, the number of the new stone first), divided_stone (another epoch shows it as several stones, which took its place), dropped_islands (parts cut off from their stone), dropped_stone (too few points)";

/// Writes `audit_epochN.csv`, what the majority of the photos decided about merged, split and dropped
/// instances, and the metadata of its columns.
pub fn write_audit(context: &Context, epoch: EpochId, photos: &Segmented, labelled: &Labelled) -> Result<()> {
    let events = labelled.transfer.audit.iter();
    let rows: Vec<AuditRow> = events.map(|e| AuditRow::new(e, photos)).collect();
    write_rows(&context.out.join(audit(epoch.number())), &rows)
}

fn write_rows(csv: &Path, rows: &[AuditRow]) -> Result<()> {
    let mut table = Table::new();
    let events: Vec<String> = rows.iter().map(|r| r.event.to_owned()).collect();
    table.push("event", "", EVENTS, events)?;
    let photos: Vec<Option<String>> = rows.iter().map(|r| r.photo.clone()).collect();
    table.push("photo", "", "photo of the mask, as the cameras name it", photos)?;
    let instances: Vec<Option<u32>> = rows.iter().map(|r| r.instance).collect();
    table.push("instance", "", "number of the mask in the photo", instances)?;
    let stones: Vec<Vec<u32>> = rows.iter().map(|r| r.stones.clone()).collect();
    table.push("stones", "", "stones that the decision is about", stones)?;
    let shares: Vec<Option<f64>> = rows.iter().map(|r| r.share).collect();
    table.push(
        "share",
        "",
        "share of the mask that the stone won, 0 to 1",
        shares,
    )?;
    let points: Vec<Option<u64>> = rows.iter().map(|r| r.points).collect();
    table.push("points", "", "points that lost their label", points)?;
    Ok(write_csv(csv, &table, DESCRIPTION, None)?)
}

struct AuditRow {
    event: &'static str,
    photo: Option<String>,
    instance: Option<u32>,
    stones: Vec<u32>,
    share: Option<f64>,
    points: Option<u64>,
}

impl AuditRow {
    fn new(event: &AuditEvent, photos: &Segmented) -> Self {
        let name = |image: &ImageId| photos.photos.get(image.0 as usize).map(|p| p.camera.clone());
        let empty = Self {
            event: "",
            photo: None,
            instance: None,
            stones: Vec::new(),
            share: None,
            points: None,
        };

        match event {
            AuditEvent::SplitInstance {
                photo,
                instance,
                stones,
            } => Self {
                event: "split_instance",
                photo: name(photo),
                instance: Some(instance.0),
                stones: stones.iter().map(|s| s.0).collect(),
                ..empty
            },
            AuditEvent::JoinedFragment {
                photo,
                instance,
                stone,
                share,
            } => Self {
                event: "joined_fragment",
                photo: name(photo),
                instance: Some(instance.0),
                stones: vec![stone.0],
                share: Some(*share),
                ..empty
            },
            AuditEvent::OutvotedInstance {
                photo,
                instance,
                share,
            } => Self {
                event: "outvoted_instance",
                photo: name(photo),
                instance: Some(instance.0),
                share: Some(*share),
                ..empty
            },
            AuditEvent::JoinedParts { stones } => Self {
                event: "joined_parts",
                stones: stones.iter().map(|s| s.0).collect(),
                ..empty
            },
            AuditEvent::DividedStone { stone } => Self {
                event: "divided_stone",
                stones: vec![stone.0],
                ..empty
            },
            AuditEvent::DroppedIslands { stone, points, .. } => Self {
                event: "dropped_islands",
                stones: vec![stone.0],
                points: Some(*points),
                ..empty
            },
            AuditEvent::DroppedStone { stone, points, .. } => Self {
                event: "dropped_stone",
                stones: vec![stone.0],
                points: Some(*points),
                ..empty
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_testing::check_csv_metadata;

    #[test]
    fn the_metadata_describe_every_column() {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join(audit(1));
        write_rows(&csv, &[]).unwrap();
        check_csv_metadata(&csv);
    }
}
