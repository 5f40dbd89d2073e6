//! A project file from what lies in a folder.

use crate::error::{Error, Result};
use crate::files::write_text;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Extensions of point clouds.
const CLOUDS: [&str; 8] = ["laz", "las", "e57", "ply", "xyz", "txt", "csv", "asc"];
/// Extensions of photos.
const PHOTOS: [&str; 3] = ["jpg", "jpeg", "png"];
/// Names of the files that make a folder a COLMAP model.
const COLMAP: [&str; 2] = ["images.txt", "images.bin"];

/// What was found of one epoch; paths relative to the project's folder.
#[derive(Default)]
struct Found {
    name: String,
    clouds: Vec<PathBuf>,
    images: Option<PathBuf>,
    cameras: Option<PathBuf>,
    masks: Option<PathBuf>,
}

/// Writes `dir/stonewise.toml`: one epoch for each folder of `dir` that holds a cloud, in order of name.
///
/// Of what is missing the file says so in a comment. An existing file is not overwritten. Returns its path.
pub fn init(dir: &Path) -> Result<PathBuf> {
    let path = dir.join("stonewise.toml");
    if path.exists() {
        return Err(Error::Input {
            path,
            message: "there is a project file already; remove it to start anew".into(),
        });
    }
    let epochs: Vec<Found> = folders(dir)?
        .into_iter()
        .map(|folder| look(dir, &folder))
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .filter(|f| !f.clouds.is_empty())
        .collect();
    if epochs.is_empty() {
        let message = format!(
            "no folder with a point cloud ({}) in it; make one folder per epoch",
            CLOUDS.join(", ")
        );
        return Err(Error::Input {
            path: dir.to_path_buf(),
            message,
        });
    }
    write_text(&path, &project_text(dir, &epochs))?;
    Ok(path)
}

fn project_text(dir: &Path, epochs: &[Found]) -> String {
    let name = dir
        .canonicalize()
        .ok()
        .and_then(|d| Some(d.file_name()?.to_string_lossy().into_owned()));
    let mut text = String::from("# Paths are relative to this file. Parameters: docs/src/project-file.md.\n");
    let _ = writeln!(
        text,
        "[project]\nname = {}",
        quoted(&name.unwrap_or_else(|| "dam".into()))
    );
    for epoch in epochs {
        let _ = writeln!(text, "\n[[epochs]]\nname = {}", quoted(&epoch.name));
        let clouds: Vec<String> = epoch
            .clouds
            .iter()
            .map(|c| quoted(&c.to_string_lossy()))
            .collect();
        let _ = writeln!(text, "clouds = [{}]", clouds.join(", "));
        for (key, found, what) in [
            ("images", &epoch.images, "folder of the photos"),
            (
                "cameras",
                &epoch.cameras,
                "Metashape XML, COLMAP folder or OpenSfM json",
            ),
            ("masks", &epoch.masks, "COCO json or folder of 16-bit label PNGs"),
        ] {
            let _ = match found {
                Some(path) => writeln!(text, "{key} = {}", quoted(&path.to_string_lossy())),
                None => writeln!(text, "# {key} = \"...\"   # not found: {what}"),
            };
        }
    }
    if epochs.len() == 1 {
        text.push_str("\n# A second [[epochs]] is needed.\n");
    }
    text
}

/// A TOML string.
pub(crate) fn quoted(text: &str) -> String {
    toml::Value::String(text.replace('\\', "/")).to_string()
}

fn look(root: &Path, folder: &Path) -> Result<Found> {
    let relative = |path: &Path| path.strip_prefix(root).unwrap_or(path).to_path_buf();
    let mut found = Found {
        name: folder
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        ..Found::default()
    };
    let mut open = vec![folder.to_path_buf()];
    while let Some(dir) = open.pop() {
        let files = files(&dir)?;
        let count = |extensions: &[&str]| files.iter().filter(|f| has_extension(f, extensions)).count();
        let is_colmap = files.iter().any(|f| COLMAP.contains(&name(f).as_str()));
        let is_masks = name(&dir).contains("mask");
        if is_colmap {
            found.cameras.get_or_insert(relative(&dir));
        } else if count(&PHOTOS) > 0 {
            let slot = if is_masks {
                &mut found.masks
            } else {
                &mut found.images
            };
            slot.get_or_insert(relative(&dir));
        }
        for file in &files {
            if has_extension(file, &["xml"]) {
                found.cameras = Some(relative(file));
            } else if has_extension(file, &["json"]) {
                let slot = if name(file).contains("reconstruction") {
                    &mut found.cameras
                } else {
                    &mut found.masks
                };
                slot.get_or_insert(relative(file));
            } else if has_extension(file, &CLOUDS) && !is_colmap {
                found.clouds.push(relative(file));
            }
        }
        open.extend(folders(&dir)?.into_iter().rev());
    }
    Ok(found)
}

fn name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase()
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension()
        .is_some_and(|e| extensions.contains(&e.to_string_lossy().to_lowercase().as_str()))
}

fn folders(dir: &Path) -> Result<Vec<PathBuf>> {
    Ok(entries(dir)?.into_iter().filter(|p| p.is_dir()).collect())
}

fn files(dir: &Path) -> Result<Vec<PathBuf>> {
    Ok(entries(dir)?.into_iter().filter(|p| p.is_file()).collect())
}

fn entries(dir: &Path) -> Result<Vec<PathBuf>> {
    let mut entries = fs::read_dir(dir)
        .and_then(|all| {
            all.map(|e| e.map(|e| e.path()))
                .collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(Error::io("listing", dir))?;
    entries.sort();
    Ok(entries)
}
