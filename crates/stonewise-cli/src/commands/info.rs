//! `info`.

use crate::args::InfoArgs;
use crate::commands::Outcome;
use crate::counted::counted;
use crate::note::note;
use anyhow::{Result, bail};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use stonewise::Project;
use stonewise_core::geometry::Bounds;
use stonewise_io::cameras::{is_camera_folder, read_cameras};
use stonewise_io::cloud::{CloudFormat, cloud_info, measure_cloud};
use stonewise_io::image_io::{is_photo, photos_in, picture_head};
use stonewise_io::masks::{CocoMasks, read_label_png};

/// Extensions of point clouds, whatever their content.
const CLOUDS: [&str; 9] = ["las", "laz", "e57", "ply", "xyz", "csv", "asc", "pts", "neu"];
/// Difference of a header's box from that of the points from which on the header is wrong, metres: above all
/// roundings.
const WRONG_BOX_M: f64 = 0.02;

/// Says what each path is, one block each, on stdout; goes on after one that cannot be read.
pub fn info(args: &InfoArgs) -> Result<Outcome> {
    if let [path] = args.paths.as_slice() {
        writeln!(std::io::stdout(), "{}\n{}", path.display(), describe(path)?)?;
        return Ok(Outcome::Done);
    }
    let mut unreadable = 0;
    for path in &args.paths {
        match describe(path) {
            Ok(text) => writeln!(std::io::stdout(), "{}\n{text}", path.display())?,
            Err(error) => {
                note(&format!("error: {error:#}"));
                unreadable += 1;
            }
        }
    }
    if unreadable > 0 {
        bail!("{unreadable} of {} cannot be used", args.paths.len());
    }
    Ok(Outcome::Done)
}

fn describe(path: &Path) -> Result<String> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_lowercase();
    if path.is_dir() {
        return if is_camera_folder(path) {
            cameras(path)
        } else {
            pictures(path)
        };
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    match extension.as_str() {
        "toml" => project(path),
        "xml" => cameras(path),
        "json" => json(path),
        "txt" | "bin" if matches!(&*name, "cameras" | "images" | "points3D") => cameras(path),
        _ if is_photo(path) => picture(path),
        extension if CLOUDS.contains(&extension) || CloudFormat::of(path).is_ok() => cloud(path),
        _ => cameras(path),
    }
}

fn project(path: &Path) -> Result<String> {
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
    Ok(format!(
        "  project {}\n{}",
        project.name,
        epochs.collect::<String>()
    ))
}

fn cloud(path: &Path) -> Result<String> {
    let info = cloud_info(path)?;
    let mut text = format!("  {:?}, {}\n", info.format, counted(info.records, "point"));
    let bounds = match info.format {
        CloudFormat::Las => {
            let (summary, bounds) = measure_cloud(path)?;
            if summary.skipped > 0 {
                text += &format!("  {} of them have no position\n", summary.skipped);
            }
            bounds
        }
        _ => info.bounds,
    };
    if let Some(bounds) = bounds {
        text += &format!("  {}\n", extent(&bounds));
    }
    if let (Some(claimed), Some(found)) = (info.bounds, bounds)
        && (claimed.min - found.min)
            .amax()
            .max((claimed.max - found.max).amax())
            > WRONG_BOX_M
    {
        text += &format!("  its header is wrong: it says {}\n", extent(&claimed));
    }
    for scan in &info.scans {
        text += &format!("  scan {}: {}\n", scan.name, counted(scan.records, "point"));
    }
    if let Some(crs) = &info.crs {
        text += &format!("  CRS {crs}\n");
    }
    Ok(text)
}

fn extent(bounds: &Bounds) -> String {
    let [min, max] = [bounds.min, bounds.max];
    format!(
        "from {:.3?} to {:.3?} m",
        min.coords.as_slice(),
        max.coords.as_slice()
    )
}

fn cameras(path: &Path) -> Result<String> {
    let file = read_cameras(path)?;
    let mut text = format!("  {}\n", counted(file.views.len(), "posed photo"));
    for view in &file.views {
        let (camera, c) = (&view.camera, view.centre());
        text += &format!(
            "  {}: {} x {} px, f {:.1} px, at ({:.3}, {:.3}, {:.3})\n",
            view.name, camera.width, camera.height, camera.focal_px[0], c.x, c.y, c.z
        );
    }
    for (name, reason) in &file.skipped {
        text += &format!("  {name}: not usable: {reason}\n");
    }
    for warning in &file.warnings {
        text += &format!("  {warning}\n");
    }
    Ok(text)
}

/// OpenSfM writes a list, COCO an object.
fn json(path: &Path) -> Result<String> {
    let text = std::fs::read(path).unwrap_or_default();
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
    if first != Some(&b'{') {
        return cameras(path);
    }
    let masks = CocoMasks::open(path)?;
    let mut text = format!("  masks (COCO) of {}\n", counted(masks.photos().count(), "photo"));
    for photo in masks.photos() {
        text += &format!(
            "  {}: {} x {} px, {}\n",
            photo.file_name,
            photo.width,
            photo.height,
            counted(photo.masks, "mask")
        );
    }
    Ok(text)
}

/// A folder of photos, or of label images: those are grey.
fn pictures(folder: &Path) -> Result<String> {
    let paths = photos_in(folder)?;
    if paths.is_empty() {
        bail!(
            "neither photos, label images nor a COLMAP model in the folder: {}",
            folder.display()
        );
    }
    let (mut sizes, mut broken) = (BTreeMap::new(), String::new());
    for path in &paths {
        match picture_head(path) {
            Ok(head) => *sizes.entry((head.is_label, head.width, head.height)).or_insert(0) += 1,
            Err(error) if paths.len() == 1 => return Err(error.into()),
            Err(error) => broken += &format!("  not usable: {error}\n"),
        }
    }
    let mut text = String::new();
    for ((is_label, width, height), count) in sizes {
        let what = counted(count, if is_label { "label image" } else { "photo" });
        text += &format!("  {what} of {width} x {height} px\n");
    }
    Ok(text + &broken)
}

fn picture(path: &Path) -> Result<String> {
    let head = picture_head(path)?;
    let size = format!("{} x {} px", head.width, head.height);
    if !head.is_label {
        return Ok(format!("  photo, {size}\n"));
    }
    let labels = read_label_png(path)?;
    let mut values: Vec<u32> = labels.data().to_vec();
    values.sort_unstable();
    values.dedup();
    let instances = values.iter().filter(|&&value| value != 0).count();
    Ok(format!(
        "  label image, {size}, {}\n",
        counted(instances, "instance")
    ))
}
