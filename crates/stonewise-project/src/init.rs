//! A project file from what lies in a folder.

mod epoch;
mod listing;
mod order;

use epoch::{CLOUDS, Found, MASKS, look, scans_beside};
use listing::{files, folders, is_made_by_stonewise, name};
use order::order;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_base::files::write_text;
use stonewise_io::cloud::is_unread_cloud;

/// A project file for the surveys of a folder, and why it is this one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Proposal {
    /// The text of the project file.
    pub text: String,
    /// What was chosen for each epoch, and what was left out with the reason, one line each.
    pub lines: Vec<String>,
}

/// What [`init()`] wrote, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Initialised {
    /// The project file.
    pub path: PathBuf,
    /// What was chosen for each epoch, and what was left out with the reason, one line each.
    pub lines: Vec<String>,
}

/// Names of folders that hold no survey.
const NO_EPOCHS: [&str; 7] = [
    "truth",
    "results",
    "report",
    "evidence",
    "work",
    "previous",
    "unfinished",
];

/// What is said of clouds that are recognised and not read.
const NOT_READ: &str = "a format that is not read";

/// Names of masks in a line at most.
const NAMES: usize = 4;

/// The first lines of a project file. Editors read the first one.
const HEAD: &str = "#:schema ./stonewise.schema.json
# Paths are relative to this file. Editors complete and explain all keys once the schema is beside this file:
# stonewise self schema > stonewise.schema.json
";

/// Writes `dir/stonewise.toml`: one epoch for each folder of `dir` that holds a cloud in it or below, else for
/// each scan that lies in `dir` itself, in order of time as far as names tell it.
///
/// Of what is missing the file says so in a comment, and of what could be taken instead. Folders that
/// stonewise made, and those of truth, are left out. An existing file is not overwritten.
///
/// # Errors
/// There is a project file; no folder holds a cloud; a folder cannot be read.
pub fn init(dir: &Path) -> Result<Initialised> {
    let path = dir.join("stonewise.toml");
    if path.exists() {
        return Err(Error::Output {
            path,
            message: "there is a project file already, which stays as it is: change it in an editor or with `stonewise studio`, and look at the \
                      survey with `stonewise check`".into(),
        });
    }
    let Proposal { text, lines } = propose(dir)?;
    write_text(&path, &text)?;
    Ok(Initialised { path, lines })
}

/// The project file that [`init()`] would write; writes nothing.
///
/// # Errors
/// No folder holds a cloud; a folder cannot be read.
pub fn propose(dir: &Path) -> Result<Proposal> {
    let mut lines = Vec::new();
    let mut epochs = Vec::new();
    for folder in folders(dir)? {
        let folder_name = name(&folder);
        if folder.ends_with(MASKS) {
            continue;
        }
        if NO_EPOCHS.contains(&folder_name.as_str()) {
            lines.push(format!("left out: {folder_name}/ (by its name no epoch)"));
        } else if is_made_by_stonewise(&folder) {
            lines.push(format!("left out: {folder_name}/ (stonewise made it)"));
        } else {
            let found = look(dir, &folder)?;
            match found.clouds.is_empty() {
                true => lines.push(format!("left out: {folder_name}/ (no point cloud in it)")),
                false => epochs.push(found),
            }
        }
    }
    let beside = scans_beside(dir)?;
    if epochs.is_empty() {
        epochs = beside;
    } else {
        let scans = beside.iter().flat_map(|scan| &scan.clouds);
        lines
            .extend(scans.map(|scan| format!("left out: {} (beside the folders of epochs)", scan.display())));
    }
    lines.extend(unread(dir)?);
    if epochs.is_empty() {
        let mut message = format!(
            "no point cloud ({}) in it or in its folders; put each epoch into a folder, or its scan here",
            CLOUDS.join(", ")
        );
        lines.retain(|line| line.contains(NOT_READ));
        if !lines.is_empty() {
            message = format!("{message}\n{}", lines.join("\n"));
        }
        return Err(Error::Input {
            path: dir.to_path_buf(),
            message,
        });
    }
    let why = order(dir, &mut epochs);
    let names: Vec<&str> = epochs.iter().map(|e| e.name.as_str()).collect();
    lines.push(format!("order of time: {} ({why})", names.join(", ")));
    for epoch in &epochs {
        lines.extend(epoch.lines());
    }
    lines.extend(unused_masks(dir, &epochs)?);
    Ok(Proposal {
        text: project_text(dir, &epochs),
        lines,
    })
}

/// Says which clouds in the folder and below are in formats that are not read.
fn unread(dir: &Path) -> Result<Vec<String>> {
    let mut lines = Vec::new();
    let mut open = vec![dir.to_path_buf()];
    while let Some(folder) = open.pop() {
        for file in files(&folder)? {
            if is_unread_cloud(&file) {
                let file = file.strip_prefix(dir).unwrap_or(&file).display().to_string();
                lines.push(format!(
                    "left out: {file} ({NOT_READ}: export it as E57, LAZ or PLY)"
                ));
            }
        }
        open.extend(folders(&folder)?.into_iter().filter(|f| !is_made_by_stonewise(f)));
    }
    lines.sort();
    Ok(lines)
}

/// Says which masks beside the epochs were not taken; those of an epoch's name are named with the epoch.
fn unused_masks(dir: &Path, epochs: &[Found]) -> Result<Option<String>> {
    let folder = dir.join(MASKS);
    if !folder.is_dir() {
        return Ok(None);
    }
    let mut unused = [files(&folder)?, folders(&folder)?].concat();
    unused.retain(|path| !epochs.iter().any(|epoch| epoch.is_mask(path)));
    let names: Vec<String> = unused.iter().take(NAMES).map(|p| name(p)).collect();
    let more = match unused.len().saturating_sub(NAMES) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let why = "masks/EPOCH.json or masks/EPOCH/ would be taken, with the name of an epoch's folder";
    Ok((!names.is_empty()).then(|| format!("left out: {}{more} in {MASKS}/ ({why})", names.join(", "))))
}

fn project_text(dir: &Path, epochs: &[Found]) -> String {
    let name = dir
        .canonicalize()
        .ok()
        .and_then(|d| Some(d.file_name()?.to_string_lossy().into_owned()));
    let mut text = HEAD.to_owned();
    let _ = writeln!(
        text,
        "[project]\nname = {}",
        quoted(&name.unwrap_or_else(|| "dam".into()))
    );
    for epoch in epochs {
        let _ = writeln!(text, "\n[[epochs]]\nname = {}", quoted(&epoch.name));
        text.push_str("# date = YYYY-MM-DD   # of the survey: for the report and for series\n");
        let _ = writeln!(text, "clouds = {}", quoted_list(&epoch.clouds));
        let has_photos = epoch.images.is_some() && epoch.cameras.is_some();
        if !has_photos {
            text.push_str("# Without images and cameras, stones are looked for in views of the clouds.\n");
        }
        for (key, found, what) in [
            ("images", &epoch.images, "not found: folder of the photos"),
            (
                "cameras",
                &epoch.cameras,
                "not found: of Metashape, RealityCapture, Pix4D, COLMAP or OpenSfM",
            ),
            (
                "masks",
                &epoch.masks,
                "none: the detector finds the stones; COCO json or folder of 16-bit label PNGs",
            ),
        ] {
            let _ = match found {
                Some(path) if has_photos => writeln!(text, "{key} = {}", quoted(&path.to_string_lossy())),
                Some(path) => writeln!(text, "# {key} = {}", quoted(&path.to_string_lossy())),
                None => writeln!(text, "# {key} = \"...\"   # {what}"),
            };
        }
    }
    if epochs.len() == 1 {
        text.push_str("\n# A second [[epochs]] is needed.\n");
    }
    text
}

/// A TOML string; paths are written with slashes, which Windows reads as well.
pub(crate) fn quoted(text: &str) -> String {
    toml::Value::String(text.replace('\\', "/")).to_string()
}

fn quoted_list(paths: &[PathBuf]) -> String {
    let all: Vec<String> = paths.iter().map(|p| quoted(&p.to_string_lossy())).collect();
    format!("[{}]", all.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn survey(files: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for file in files {
            let path = dir.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        }
        dir
    }

    fn written(files: &[&str]) -> (String, String) {
        let dir = survey(files);
        let done = init(dir.path()).unwrap();
        (fs::read_to_string(done.path).unwrap(), done.lines.join("\n"))
    }

    #[test]
    fn folders_of_results_and_truth_are_no_epochs_and_are_named() {
        let (text, lines) = written(&[
            "2024/wall.laz",
            "2025/wall.laz",
            "truth/wall.laz",
            "out/work/marker.json",
            "out/epoch1/wall.laz",
            "old/run.json",
            "old/stones.csv",
            "old/epoch1/wall.laz",
            "notes/a.txt.bak",
        ]);
        assert!(text.starts_with("#:schema ./"), "{text}");
        assert_eq!(text.matches("[[epochs]]").count(), 2, "{text}");
        for left in [
            "truth/",
            "out/ (stonewise made it)",
            "old/ (stonewise made it)",
            "notes/ (no point cloud",
        ] {
            assert!(lines.contains(&format!("left out: {left}")), "{left}: {lines}");
        }
        assert!(lines.contains("2024: clouds 2024/wall.laz"), "{lines}");
    }

    #[test]
    fn clouds_of_all_sensors_are_taken_and_the_sensors_named() {
        let (text, lines) = written(&["a/cloud_tls.laz", "a/cloud_uav.laz", "b/x_UAV.laz"]);
        assert!(
            text.contains("\nclouds = [\"a/cloud_tls.laz\", \"a/cloud_uav.laz\"]")
                && text.contains("\nclouds = [\"b/x_UAV.laz\"]"),
            "{text}"
        );
        assert!(
            lines.contains("a: clouds of 2 sensors by their names (terrestrial, drone)"),
            "{lines}"
        );
        assert!(!lines.contains("b: clouds of"), "{lines}");
    }

    #[test]
    fn two_flights_are_taken_by_the_folder_above_them() {
        let (text, _) = written(&[
            "a/photos/flight1/1.jpg",
            "a/photos/flight2/2.jpg",
            "a/x.laz",
            "b/flight/1.jpg",
            "b/masks/1.png",
            "b/scans/day 1/x.laz",
        ]);
        assert!(text.contains("images = \"a/photos\""), "{text}");
        assert!(
            text.contains("images = \"b/flight\"") && text.contains("masks = \"b/masks\""),
            "{text}"
        );
        assert!(text.contains("b/scans/day 1/x.laz"), "{text}");
    }

    #[test]
    fn scans_in_one_folder_are_an_epoch_each() {
        let (text, lines) = written(&[
            "dam_2025.laz",
            "dam_2024.laz",
            "README.txt",
            "dam_2024.rcp",
            "2024.pcd",
        ]);
        let place = |what: &str| text.find(what).unwrap();
        assert!(place("clouds = [\"dam_2024.laz\"]") < place("clouds = [\"dam_2025.laz\"]"));
        assert!(
            text.contains("\n# images = ") && text.contains("\n# cameras = "),
            "{text}"
        );
        assert_eq!(text.matches("[[epochs]]").count(), 2, "{text}");
        assert!(
            lines.contains("left out: dam_2024.rcp (a format that is not read")
                && lines.contains("left out: 2024.pcd (a format"),
            "{lines}"
        );
        let (text, _) = written(&["2024_tls.laz", "2024_uav.laz", "2025_tls.laz", "2025_uav.laz"]);
        assert_eq!(text.matches("[[epochs]]").count(), 2, "{text}");
        assert!(
            text.contains("\nclouds = [\"2025_tls.laz\", \"2025_uav.laz\"]"),
            "{text}"
        );
    }

    #[test]
    fn scans_of_all_formats_are_taken_and_cameras_are_no_clouds() {
        let (text, lines) = written(&[
            "2024/a.ptx",
            "2024/b.PTS",
            "2025/c.e57",
            "2025/dam_calibrated_camera_parameters.txt",
            "2025/photos/1.tif",
        ]);
        assert!(
            text.contains("clouds = [\"2024/a.ptx\", \"2024/b.PTS\"]"),
            "{text}"
        );
        assert!(text.contains("clouds = [\"2025/c.e57\"]"), "{text}");
        assert!(
            text.contains("cameras = \"2025/dam_calibrated_camera_parameters.txt\"")
                && text.contains("images = \"2025/photos\""),
            "{text}"
        );
        assert!(!lines.contains("left out"), "{lines}");
    }

    #[test]
    fn files_of_an_opf_project_are_no_masks() {
        let (text, lines) = written(&[
            "2024/x.laz",
            "2024/images/1.jpg",
            "2024/dam.opf",
            "2024/camera_list.json",
            "2024/input_cameras.json",
            "2024/scene_reference_frame.json",
            "2024/calibration/calibrated_cameras.json",
            "2025/x.laz",
        ]);
        assert!(text.contains("cameras = \"2024/dam.opf\""), "{text}");
        assert!(
            !text.contains("\nmasks = ") && !lines.contains("left out"),
            "{text}{lines}"
        );
    }

    #[test]
    fn cameras_of_realitycapture_and_bundler_are_no_clouds() {
        let files = [
            "2024/x.laz",
            "2024/cams.csv",
            "2024/images/1.png",
            "2025/x.laz",
            "2025/2.png",
            "2025/2.xmp",
        ];
        let survey = survey(&[files.as_slice(), &["2026/x.laz", "2026/a.out", "2026/a.list.txt"]].concat());
        let of = |path: &str| survey.path().join(path);
        let header = "#name,x,y,alt,heading,pitch,roll,f\n1.png,1,2,3,0,0,0,30\n";
        std::fs::write(of("2024/cams.csv"), header).unwrap();
        std::fs::write(
            of("2025/2.xmp"),
            "<a b=\"http://www.capturingreality.com/ns/xcr/1.1#\"/>",
        )
        .unwrap();
        std::fs::write(of("2026/a.out"), "# Bundle file v0.3\n").unwrap();
        let Proposal { text, lines } = propose(survey.path()).unwrap();
        for part in [
            "clouds = [\"2024/x.laz\"]\nimages = \"2024/images\"\ncameras = \"2024/cams.csv\"",
            "clouds = [\"2025/x.laz\"]\nimages = \"2025\"\ncameras = \"2025\"",
            "clouds = [\"2026/x.laz\"]",
        ] {
            assert!(text.contains(part), "{text}");
        }
        let left_out = "left out: 2026/a.out (Bundler files are not read: export the cameras as COLMAP";
        assert!(lines.join("\n").contains(left_out), "{lines:?}");
    }

    #[test]
    fn a_model_of_colmap_beside_the_cloud_hides_only_its_own_points() {
        let (text, _) = written(&["2024/images.txt", "2024/points3D.txt", "2024/x.ply", "2025/x.ply"]);
        assert!(text.contains("clouds = [\"2024/x.ply\"]"), "{text}");
    }

    #[test]
    fn folders_before_and_after_are_in_this_order() {
        let (text, lines) = written(&["after/x.laz", "before/x.laz"]);
        assert!(
            text.find("\"before\"").unwrap() < text.find("\"after\"").unwrap(),
            "{text}"
        );
        assert!(lines.contains("order of time: before, after ("), "{lines}");
    }

    #[test]
    fn masks_beside_the_epochs_are_found_by_their_name() {
        let (text, _) = written(&["a/x.laz", "b/x.laz", "masks/a.json", "masks/b/1.png"]);
        assert!(
            text.contains("masks = \"masks/a.json\"") && text.contains("masks = \"masks/b\""),
            "{text}"
        );
    }

    #[test]
    fn masks_are_left_out_only_where_no_epoch_took_them() {
        let (_, lines) = written(&["a/x.laz", "b/x.laz", "masks/a.json", "masks/b/1.png"]);
        assert!(!lines.contains("left out"), "{lines}");
        let (text, lines) = written(&["a/x.laz", "b/x.laz", "masks/a.json", "masks/wall_b.json"]);
        assert!(text.contains("masks = \"masks/a.json\""), "{text}");
        assert!(lines.contains("left out: wall_b.json in masks/ ("), "{lines}");
    }
}
