//! `info`.

mod cloud;
mod described;
mod pictures;

use crate::args::InfoArgs;
use crate::commands::Outcome;
use crate::counted::counted;
use crate::note::note;
use crate::stdout::stdout;
use anyhow::{Result, bail};
use cloud::cloud;
use described::Described;
use pictures::{picture, pictures};
use serde_json::json;
use std::io::Write;
use std::path::Path;
use stonewise::Project;
use stonewise_io::cameras::{
    is_camera_file, is_camera_folder, is_sidecar_folder, read_cameras, unread_cameras,
};
use stonewise_io::cloud::{CloudError, CloudFormat};
use stonewise_io::image_io::is_photo;
use stonewise_io::masks::CocoMasks;

/// Says what each path is, one block or object each, on stdout; goes on after one that cannot be read.
pub fn info(args: &InfoArgs) -> Result<Outcome> {
    let (mut all, mut unreadable) = (Vec::new(), 0);
    for path in &args.paths {
        match describe(path) {
            Ok(Described { text, .. }) if !args.json => {
                writeln!(stdout(), "{}\n{text}", path.display())?;
            }
            Ok(Described { mut json, .. }) => {
                json["path"] = json!(path.display().to_string());
                all.push(json);
            }
            Err(error) if args.paths.len() == 1 => return Err(error),
            Err(error) => {
                note(&format!("error: {error:#}"));
                unreadable += 1;
            }
        }
    }
    if args.json {
        writeln!(stdout(), "{}", serde_json::to_string_pretty(&all)?)?;
    }
    if unreadable > 0 {
        bail!("{unreadable} of {} cannot be used", args.paths.len());
    }
    Ok(Outcome::Done)
}

fn describe(path: &Path) -> Result<Described> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_lowercase();
    if path.is_dir() {
        return if is_camera_folder(path) || is_sidecar_folder(path) {
            cameras(path)
        } else {
            pictures(path)
        };
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    match extension.as_str() {
        "toml" => project(path),
        "json" => json_file(path),
        "txt" | "bin" if matches!(&*name, "cameras" | "images" | "points3D") => cameras(path),
        _ if is_camera_file(path) => cameras(path),
        _ if is_photo(path) => picture(path),
        _ => match CloudFormat::of(path) {
            Err(CloudError::UnknownFormat(_)) => cameras(path),
            _ => cloud(path),
        },
    }
}

fn project(path: &Path) -> Result<Described> {
    let project = Project::read(path)?;
    let epochs = project.epochs.iter().map(|e| {
        format!(
            "  epoch {}: {} cloud(s), {}\n",
            e.name,
            e.clouds.len(),
            match &e.photos {
                Some(photos) => photos.images.display().to_string(),
                None => "no photos".to_owned(),
            }
        )
    });
    let epochs_json = project.epochs.iter().map(|e| {
        let clouds: Vec<String> = e.clouds.iter().map(|c| c.display().to_string()).collect();
        let images = e
            .photos
            .as_ref()
            .map(|photos| photos.images.display().to_string());
        json!({ "name": e.name, "clouds": clouds, "images": images })
    });
    Ok(Described {
        text: format!("  project {}\n{}", project.name, epochs.collect::<String>()),
        json: json!({ "kind": "project", "name": project.name, "epochs": epochs_json.collect::<Vec<_>>() }),
    })
}

fn cameras(path: &Path) -> Result<Described> {
    let file = read_cameras(path)?;
    let mut text = format!("  {}\n", counted(file.views.len(), "posed photo"));
    let mut photos = Vec::new();

    for view in &file.views {
        let (camera, c) = (&view.camera, view.centre());
        text += &format!(
            "  {}: {} x {} px, f {:.1} px, at ({:.3}, {:.3}, {:.3})\n",
            view.name, camera.width, camera.height, camera.focal_px[0], c.x, c.y, c.z
        );
        photos.push(json!({
            "name": view.name, "width": camera.width, "height": camera.height, "focal_px": camera.focal_px,
            "principal_point_px": camera.center_px, "centre_m": [c.x, c.y, c.z],
        }));
    }

    for (name, reason) in &file.skipped {
        text += &format!("  {name}: not usable: {reason}\n");
    }
    for warning in &file.warnings {
        text += &format!("  {warning}\n");
    }
    if file.rolling_shutter {
        text += "  rolling shutter\n";
    }
    if let Some(crs) = &file.crs {
        text += &format!("  CRS {crs}\n");
    }
    let skipped = file.skipped.iter();
    let skipped = skipped.map(|(name, reason)| json!({ "name": name, "reason": reason.to_string() }));

    let warnings: Vec<String> = file.warnings.iter().map(ToString::to_string).collect();
    Ok(Described {
        text,
        json: json!({
            "kind": "cameras", "photos": photos, "not_usable": skipped.collect::<Vec<_>>(), "warnings": warnings,
            "rolling_shutter": file.rolling_shutter, "crs": file.crs,
        }),
    })
}

/// Cameras bear a name of theirs, or are a list; masks are an object.
fn json_file(path: &Path) -> Result<Described> {
    let text = std::fs::read(path).unwrap_or_default();
    let text = text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(&text);
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
    if is_camera_file(path) || unread_cameras(path).is_some() || first != Some(&b'{') {
        return cameras(path);
    }
    let masks = CocoMasks::open(path)?;
    let mut text = format!("  masks (COCO) of {}\n", counted(masks.photos().count(), "photo"));
    let mut photos = Vec::new();
    for remark in masks.remarks() {
        text += &format!("  {remark}\n");
    }
    for photo in masks.photos() {
        text += &format!(
            "  {}: {} x {} px, {}\n",
            photo.file_name,
            photo.width,
            photo.height,
            counted(photo.masks, "mask")
        );
        photos.push(json!({
            "name": photo.file_name, "width": photo.width, "height": photo.height, "masks": photo.masks,
        }));
    }
    Ok(Described {
        text,
        json: json!({ "kind": "masks", "photos": photos, "remarks": masks.remarks() }),
    })
}
