//! What the majority of the photos decided about single instances.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::results::names::audit;
use stonewise_core::id::ImageId;
use stonewise_core::transfer::AuditEvent;
use stonewise_io::table::{Table, write_csv};

/// Writes `audit_epochN.csv`: what the majority of the photos decided about merged, split and dropped
/// instances.
pub fn write_audit(context: &Context, number: usize, photos: &Segmented, labelled: &Labelled) -> Result<()> {
    let rows: Vec<AuditRow> = labelled
        .transfer
        .audit
        .iter()
        .map(|e| AuditRow::new(e, photos))
        .collect();
    let mut table = Table::new();
    table.push(
        "event",
        rows.iter().map(|r| r.event.to_owned()).collect::<Vec<_>>(),
    )?;
    table.push(
        "photo",
        rows.iter()
            .map(|r| r.photo.clone())
            .collect::<Vec<Option<String>>>(),
    )?;
    table.push("instance", rows.iter().map(|r| r.instance).collect::<Vec<_>>())?;
    table.push(
        "stones",
        rows.iter().map(|r| r.stones.clone()).collect::<Vec<_>>(),
    )?;
    table.push("share", rows.iter().map(|r| r.share).collect::<Vec<_>>())?;
    table.push("points", rows.iter().map(|r| r.points).collect::<Vec<_>>())?;
    Ok(write_csv(&context.out.join(audit(number)), &table)?)
}

struct AuditRow {
    event: &'static str,
    photo: Option<String>,
    instance: Option<u32>,
    stones: String,
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
            stones: String::new(),
            share: None,
            points: None,
        };
        match event {
            AuditEvent::SplitInstance {
                photo,
                instance,
                stones,
            } => {
                let stones: Vec<String> = stones.iter().map(|s| s.0.to_string()).collect();
                Self {
                    event: "split_instance",
                    photo: name(photo),
                    instance: Some(instance.0),
                    stones: stones.join(" "),
                    ..empty
                }
            }
            AuditEvent::JoinedFragment {
                photo,
                instance,
                stone,
                share,
            } => Self {
                event: "joined_fragment",
                photo: name(photo),
                instance: Some(instance.0),
                stones: stone.0.to_string(),
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
            AuditEvent::DroppedIslands { stone, points, .. } => Self {
                event: "dropped_islands",
                stones: stone.0.to_string(),
                points: Some(*points),
                ..empty
            },
            AuditEvent::DroppedStone { stone, points, .. } => Self {
                event: "dropped_stone",
                stones: stone.0.to_string(),
                points: Some(*points),
                ..empty
            },
        }
    }
}
