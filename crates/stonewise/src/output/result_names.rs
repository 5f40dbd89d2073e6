//! The names of all files that a run publishes in its folder.

use crate::project::Project;
use crate::results::names::{
    DATA_DIR, DISPLACEMENTS_VTP, DRAWING, EVALUATION_TRUTH, FACES_PLY, FACES_VTP, GEOPACKAGE, GEOPARQUET,
    WORK_DIR, epoch_dir, is_of_report,
};
use std::path::{Path, PathBuf};

/// Where the results of the last finished run lie until the next one has finished.
pub const PREVIOUS_DIR: &str = "previous";
/// Result files at the first level and in [`DATA_DIR`], without `_2`, `_3` (of later epochs) and extension.
/// Earlier versions had all of them at the first level.
const STEMS: [&str; 24] = [
    "report",
    "yearly",
    "stones",
    "matches",
    "registration",
    "neighbours",
    "m3c2",
    "evaluation",
    "evaluation_truth",
    "outlines",
    "displacements",
    "run",
    "series",
    "trends",
    "zones",
    "instruments",
    "verdict",
    "audit_epoch",
    "audit_edits",
    "audit_carried",
    "facade",
    "c2c",
    "c2m",
    "digests",
];
/// Files in the folder of the report's tables, likewise; earlier versions wrote the others.
const REPORT: [&str; 8] = [
    "index",
    "yearly",
    "epochs",
    "answers",
    "zones",
    "paths",
    "joints",
    "observations",
];
/// Their extensions; `csv-metadata.json` is `json`, and earlier versions wrote `geojson`.
const EXTENSIONS: [&str; 13] = [
    "csv", "parquet", "json", "geojson", "gpkg", "laz", "vtp", "ply", "dxf", "html", "jpg", "png", "b3",
];
/// Excerpts of the survey, without the numbers of epochs and pictures.
const EVIDENCE: [&str; 9] = [
    "crops",
    "crop_outlines",
    "sections",
    "tracks",
    "track_shifts",
    "cloud",
    "cameras",
    "logo",
    "profile",
];

/// Folders of pictures and tables, in [`DATA_DIR`] and, of earlier versions, beside it.
const BELOW: [&str; 2] = ["evidence", "report"];

/// Folders in an output folder that a run of the project writes into.
pub(super) fn result_folders(project: &Project) -> Vec<PathBuf> {
    let older = (1..=project.epochs.len()).map(|n| of_older_layout(Path::new(&epoch_dir(n))));
    let others = [DATA_DIR, WORK_DIR, PREVIOUS_DIR].into_iter().chain(BELOW);
    older.chain(others.map(PathBuf::from)).collect()
}

/// Whether a run publishes a file of this name, relative to the folder; the labelled clouds apart, see
/// [`cloud_names`].
pub(super) fn is_result(file: &Path) -> bool {
    let name = file
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let (stem, extension) = match name.split_once('.') {
        Some((stem, rest)) => (stem.to_owned(), rest.rsplit('.').next().unwrap_or_default()),
        None => return false,
    };
    // `stones_2` is `stones`, `audit_epoch1` is `audit_epoch`, `crops_1_000` is `crops`.
    let stem = stem.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    if !EXTENSIONS.contains(&extension) {
        return false;
    }
    match of_older_layout(file.parent().unwrap_or(Path::new(""))).to_str() {
        // `m3c2` ends with a digit of its own, as do `c2c` and `c2m` not.
        Some("") => STEMS.contains(&stem) || name.starts_with("m3c2.") || name.starts_with("m3c2_"),
        Some("evidence") => EVIDENCE.contains(&stem),
        Some("report") => REPORT.contains(&stem),
        _ => false,
    }
}

/// Where earlier versions had a file or folder: not in [`DATA_DIR`].
pub(super) fn of_older_layout(file: &Path) -> PathBuf {
    file.strip_prefix(DATA_DIR).unwrap_or(file).to_path_buf()
}

/// Whether a command makes this result anew from others after the run: the report, the layers, and scores
/// against a truth of the user's.
pub(super) fn is_made_anew(file: &Path) -> bool {
    let layers = [
        GEOPACKAGE,
        GEOPARQUET,
        FACES_VTP,
        DISPLACEMENTS_VTP,
        FACES_PLY,
        DRAWING,
    ];
    is_of_report(file) || file == EVALUATION_TRUTH || layers.iter().any(|layer| file == *layer)
}

/// The labelled clouds of one epoch in its [`epoch_dir`]: one LAZ per input, named after it; inputs
/// that share a stem are told apart by a number.
pub(crate) fn cloud_names(number: usize, clouds: &[PathBuf]) -> Vec<PathBuf> {
    let stem = |p: &PathBuf| p.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = |(i, cloud): (usize, &PathBuf)| {
        let twins = clouds[..i].iter().filter(|c| stem(c) == stem(cloud)).count();
        let number_of_twin = if twins == 0 {
            String::new()
        } else {
            format!("_{}", twins + 1)
        };
        PathBuf::from(epoch_dir(number)).join(format!("{}{number_of_twin}.laz", stem(cloud)))
    };
    clouds.iter().enumerate().map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_every_epoch_are_recognised_and_other_files_are_not() {
        for name in [
            "stones.csv",
            "stones_2.parquet",
            "stones.geo.parquet",
            "stones.copc.laz",
            "stones.geojson",
            "stones.csv-metadata.json",
            "m3c2.laz",
            "m3c2_3.csv",
            "audit_epoch2.csv",
            "evaluation_truth.json",
            "report.html",
            "yearly.html",
            "data/report_2.html",
            "data/stones_2.csv",
            "data/m3c2_2.laz",
            "data/digests.b3",
            "data/evidence/crops_1_000.jpg",
            "data/report/joints.csv",
            "report/index_2.html",
            "report/observations.json",
            "evidence/crops_1_000.jpg",
            "evidence/crop_outlines_2.parquet",
            "evidence/logo.png",
            "verdict.json",
        ] {
            assert!(is_result(Path::new(name)), "{name}");
        }
        for name in [
            "notes.csv",
            "stones.txt",
            "stones",
            "report/notes.html",
            "survey/stones.csv",
            "evidence/mine.jpg",
            "my_stones.csv",
            "stonewise.toml",
            "data/remarks.json",
            "data/notes.csv",
            "data/data/stones.csv",
        ] {
            assert!(!is_result(Path::new(name)), "{name}");
        }
    }

    #[test]
    fn clouds_of_one_stem_get_names_of_their_own() {
        let clouds = ["a/wall.laz", "b/wall.e57", "c.ply"].map(PathBuf::from);
        let names = ["wall", "wall_2", "c"].map(|stem| PathBuf::from(format!("data/epoch2/{stem}.laz")));
        assert_eq!(cloud_names(2, &clouds), names);
    }
}
