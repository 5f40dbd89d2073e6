//! Result tables: stones, outlines, M3C2, evaluation, audit.

use crate::error::{Error, Result};
use crate::pipeline::context::Context;
use crate::pipeline::label::Labelled;
use crate::pipeline::matching::Matched;
use crate::pipeline::photos::Segmented;
use crate::pipeline::registration::Registered;
use crate::pipeline::step::Key;
use crate::report::{OUTLINES_FILE, StoneOutline, StoneRow, write_outlines};
use nalgebra::{Matrix3, Point3};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use stonewise_core::change::ChangeField;
use stonewise_core::cloud::TileSource;
use stonewise_core::geometry::{OutlineParams, face_outline};
use stonewise_core::stone::MatchOutcome;
use stonewise_core::transfer::AuditEvent;
use stonewise_io::atomic::write_atomically;
use stonewise_io::cloud::{ExtraColumn, write_points_laz};
use stonewise_io::table::{Table, write_csv};

/// One row for each stone of the first epoch.
pub fn stone_rows(
    context: &Context,
    first: &Labelled,
    second: &Labelled,
    matched: &Matched,
    registered: &Registered,
) -> Vec<StoneRow> {
    let error_m = context.project.settings.registration.epoch_error_m;
    // Both epochs carry the error of their registration.
    let stated = Matrix3::identity() * (2.0 * error_m * error_m);
    let partners: BTreeMap<_, _> = second.stones.iter().map(|s| (s.id, s)).collect();
    let outcomes: BTreeMap<_, _> = matched.report.outcomes.iter().copied().collect();
    let motions: BTreeMap<_, _> = registered.results.iter().map(|r| (r.first, r)).collect();
    let row = |stone: &stonewise_core::stone::Stone| {
        let outcome = outcomes.get(&stone.id)?;
        let partner = match outcome {
            MatchOutcome::Matched { second } => partners.get(second).copied(),
            MatchOutcome::Unmatched(_) => None,
        };
        let found = registered
            .datum
            .as_ref()
            .map(|d| d.mean_square_at(&stone.centroid));
        Some(StoneRow::new(
            stone,
            outcome,
            partner,
            motions.get(&stone.id).copied(),
            &(stated + found.unwrap_or_else(Matrix3::zeros)),
        ))
    };
    first.stones.iter().filter_map(row).collect()
}

/// Writes the outlines of the first epoch's stones.
pub fn write_stone_outlines(context: &Context, first: &Labelled) -> Result<()> {
    let key = Key::new("outlines", &(), &[first.key.as_str()]);
    let step = context.step("outlines", key, |step, _| {
        Ok(write_outlines(step.path(), &stone_outlines(context, first)?)?)
    })?;
    let to = context.out.join(OUTLINES_FILE);
    write_atomically(&to, |partial| {
        fs::copy(step.file(OUTLINES_FILE), partial).map(|_| ())
    })
    .map_err(Error::io("writing", &to))
}

fn stone_outlines(context: &Context, first: &Labelled) -> Result<Vec<StoneOutline>> {
    let mut points: BTreeMap<u32, Vec<Point3<f64>>> = BTreeMap::new();
    context
        .progress
        .begin("outlines", first.tiled.tiles.tile_count() as u64);
    for tile in 0..first.tiled.tiles.tile_count() {
        context.progress.check()?;
        let (cloud, labels) = (first.tiled.tiles.load(tile)?, first.labels(tile)?);
        for (i, &stone) in labels.stone.iter().enumerate().filter(|(_, s)| **s != 0) {
            points.entry(stone).or_default().push(cloud.world(i));
        }
        context.progress.advance(1);
    }
    let params = OutlineParams::default();
    let outline = |stone: &stonewise_core::stone::Stone| {
        let ring = face_outline(points.get(&stone.id.0)?, &stone.normal, &params)?;
        Some(StoneOutline {
            stone_id: stone.id.0,
            normal: stone.normal,
            ring,
        })
    };
    Ok(first.stones.iter().filter_map(outline).collect())
}

/// Writes `m3c2.laz` and `m3c2.csv` (or another stem) with PDAL's dimension names.
///
/// In the LAZ an unknown number is NaN; in the CSV its cell is empty.
pub fn write_change(dir: &Path, stem: &str, field: &ChangeField) -> Result<()> {
    let points = &field.points;
    let real = |of: fn(&stonewise_core::change::ChangePoint) -> Option<f64>| {
        points.iter().map(of).collect::<Vec<_>>()
    };
    let columns: [(&str, Vec<Option<f64>>); 7] = [
        ("NormalX", real(|p| Some(p.normal.x))),
        ("NormalY", real(|p| Some(p.normal.y))),
        ("NormalZ", real(|p| Some(p.normal.z))),
        ("m3c2_distance", real(|p| p.distance_m)),
        ("m3c2_uncertainty", real(|p| p.detection_limit_m)),
        ("m3c2_std_dev1", real(|p| p.spread_m[0])),
        ("m3c2_std_dev2", real(|p| p.spread_m[1])),
    ];
    let significant: Vec<u16> = points.iter().map(|p| u16::from(p.is_significant())).collect();
    let counts = [0, 1].map(|e| points.iter().map(|p| p.counts[e]).collect::<Vec<u32>>());

    let mut table = Table::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        table.push(
            name,
            points.iter().map(|p| p.position[axis]).collect::<Vec<f64>>(),
        )?;
    }
    for (name, values) in &columns {
        table.push(name, values.clone())?;
    }
    table.push("m3c2_significant", significant.clone())?;
    table.push("m3c2_count1", counts[0].clone())?;
    table.push("m3c2_count2", counts[1].clone())?;
    write_csv(&dir.join(format!("{stem}.csv")), &table)?;

    let positions: Vec<Point3<f64>> = points.iter().map(|p| p.position).collect();
    let dense: Vec<(&str, Vec<f64>)> = columns
        .iter()
        .map(|(name, v)| (*name, v.iter().map(|c| c.unwrap_or(f64::NAN)).collect()))
        .collect();
    let mut extra: Vec<(&str, ExtraColumn)> = dense
        .iter()
        .map(|(name, v)| (*name, ExtraColumn::F64(v)))
        .collect();
    extra.push(("m3c2_significant", ExtraColumn::U16(&significant)));
    extra.push(("m3c2_count1", ExtraColumn::U32(&counts[0])));
    extra.push(("m3c2_count2", ExtraColumn::U32(&counts[1])));
    Ok(write_points_laz(
        &dir.join(format!("{stem}.laz")),
        &positions,
        &extra,
    )?)
}

/// Writes `audit_epochN.csv`: what the majority of the photos decided about merged, split and dropped instances.
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
    Ok(write_csv(
        &context.out.join(format!("audit_epoch{number}.csv")),
        &table,
    )?)
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
        let name = |image: &stonewise_core::id::ImageId| {
            photos.photos.get(image.0 as usize).map(|p| p.camera.clone())
        };
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
