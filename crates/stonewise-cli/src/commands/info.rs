//! `info`.

use crate::args::InfoArgs;
use crate::commands::Outcome;
use anyhow::Result;
use std::io::Write;
use std::path::Path;
use stonewise::Project;
use stonewise_io::cameras::read_cameras;
use stonewise_io::cloud::{CloudFormat, cloud_info};

/// Says what each path is, one block each, on stdout.
pub fn info(args: &InfoArgs) -> Result<Outcome> {
    for path in &args.paths {
        writeln!(std::io::stdout(), "{}\n{}", path.display(), describe(path)?)?;
    }
    Ok(Outcome::Done)
}

fn describe(path: &Path) -> Result<String> {
    let extension = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    match extension.as_str() {
        "toml" => project(path),
        "xml" | "json" => cameras(path),
        _ if path.is_dir() => cameras(path),
        _ if CloudFormat::of(path).is_ok() => cloud(path),
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
            e.images.display()
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
    let mut text = format!("  {:?}, {} points\n", info.format, info.records);
    if let Some(b) = info.bounds {
        text += &format!(
            "  from {:.3?} to {:.3?} m\n",
            b.min.coords.as_slice(),
            b.max.coords.as_slice()
        );
    }
    for scan in &info.scans {
        text += &format!("  scan {}: {} points\n", scan.name, scan.records);
    }
    if let Some(crs) = &info.crs {
        text += &format!("  CRS {crs}\n");
    }
    Ok(text)
}

fn cameras(path: &Path) -> Result<String> {
    let file = read_cameras(path)?;
    let mut text = format!("  {} posed photos\n", file.views.len());
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
    Ok(text)
}
