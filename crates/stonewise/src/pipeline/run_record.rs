//! `run.json`: what was run, on what, how, and how long it took.

use crate::error::{Error, Result};
use crate::files::write_readable_json;
use crate::pipeline::context::Context;
use crate::pipeline::label::Labelled;
use crate::pipeline::photos::Segmented;
use serde_json::{Value, json};
use std::path::Path;

/// Writes `run.json`.
pub fn write_run_record(context: &Context, photos: &[Segmented], labelled: &[Labelled]) -> Result<()> {
    let project = context.project;
    let epochs = project
        .epochs
        .iter()
        .zip(photos.iter().zip(labelled))
        .map(|(epoch, (photos, labelled))| {
            let clouds = epoch
                .clouds
                .iter()
                .map(|c| input(context, c))
                .collect::<Result<Vec<_>>>()?;
            Ok(json!({
                "name": epoch.name,
                "clouds": clouds,
                "cameras": input(context, &epoch.cameras)?,
                "masks": epoch.masks.as_deref().map(|m| input(context, m)).transpose()?,
                "images": epoch.images,
                "motion": epoch.motion,
                "points": labelled.tiled.tiles.surveyed.point_count(),
                "photos": photos.photos.len(),
                "stones": labelled.stones.len(),
            }))
        })
        .collect::<Result<Vec<Value>>>()?;
    let record = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "project": { "name": project.name, "file": project.path },
        "parameters": project.settings,
        "part": project.part,
        "epochs": epochs,
        "steps": context.times(),
        "warnings": context.warnings.sorted(),
    });
    write_readable_json(&context.out.join("run.json"), &record)
}

fn input(context: &Context, path: &Path) -> Result<Value> {
    let size = std::fs::metadata(path).map_err(Error::io("reading", path))?.len();
    Ok(json!({ "path": path, "bytes": size, "blake3": context.digest(path)? }))
}
