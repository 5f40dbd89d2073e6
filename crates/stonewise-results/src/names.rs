//! The places of all result files in the folder of the results. What people open lies at its first level,
//! everything else in [`DATA_DIR`].

use std::fmt;
use std::path::{Path, PathBuf};
use stonewise_base::error::Error;

/// Folder of everything but what people open.
pub const DATA_DIR: &str = "data";

/// What was run, on what, how, and how long it took.
pub const RUN: &str = "run.json";
/// The state of the wall, its zones and its stones for all later epochs.
pub const VERDICT: &str = "verdict.json";
/// Polygons of the stones of the first epoch.
pub const OUTLINES: &str = "data/outlines.json";
/// The unrolled wall, where stones were edited by hand: that of the stones as they were found.
pub const FACADE: &str = "data/facade.json";
/// Every edit of a person with who, when and why, and what it did in each epoch.
pub const EDITS_AUDIT: &str = "data/audit_edits.csv";
/// Every stone that was looked for in an epoch whose photos do not show it.
pub const CARRY_AUDIT: &str = "data/audit_carried.csv";
/// Rows of all later epochs, where there are more than one.
pub const SERIES: &str = "data/series.parquet";
/// The model in time of every stone, where there are more than two epochs.
pub const TRENDS_TABLE: &str = "data/trends.parquet";
/// What the path over all epochs means.
pub const TRENDS: &str = "data/trends.json";
/// Other instruments beside the stones around them.
pub const INSTRUMENTS: &str = "data/instruments.json";
/// Zones of deformation of all later epochs.
pub const ZONES: &str = "data/zones.parquet";
/// Scores against a table of true stones.
pub const EVALUATION_TRUTH: &str = "data/evaluation_truth.json";
/// Layers for QGIS.
pub const GEOPACKAGE: &str = "stones.gpkg";
/// The stones as a table with their polygons.
pub const GEOPARQUET: &str = "data/stones.geo.parquet";
/// The stones' faces for ParaView.
pub const FACES_VTP: &str = "data/stones.vtp";
/// The stones' centroids with their displacements for ParaView.
pub const DISPLACEMENTS_VTP: &str = "data/displacements.vtp";
/// The stones' faces as a coloured mesh.
pub const FACES_PLY: &str = "data/stones.ply";
/// The unrolled wall as a drawing for CAD.
pub const DRAWING: &str = "data/stones.dxf";
/// The points of stones, coloured by their motion.
pub const FACE_CLOUD: &str = "data/stones.laz";
/// Remarks and signature of people; no run writes it.
pub const REMARKS: &str = "data/remarks.json";
/// Digests of all result files by their places in the folder of the results, as `b3sum` writes them.
pub const DIGESTS: &str = "data/digests.b3";
/// Folder of the report's tables.
pub const REPORT_DIR: &str = "data/report";
/// The part of the yearly safety report on measurements.
pub const YEARLY: &str = "yearly.html";
/// Folder of the excerpts that the report shows.
pub const EVIDENCE_DIR: &str = "data/evidence";
/// The profile of the report, where it is a file of the user's.
pub const PROFILE: &str = "data/evidence/profile.json";
/// Folder of the steps' files.
pub const WORK_DIR: &str = "work";

/// A file that every later epoch has: the second epoch's is `stones.csv`, the third's `data/stones_2.csv`, and so
/// on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairFile {
    /// The stone table as text.
    StonesCsv,
    /// The stone table.
    StonesParquet,
    /// The M3C2 core points as text.
    M3c2Csv,
    /// The M3C2 core points as a cloud.
    M3c2Laz,
    /// What became of every stone of the first epoch when its partner was sought.
    Matches,
    /// What the estimator says about itself.
    Registration,
    /// Covariances of the motions of neighbours relative to each other.
    Neighbours,
    /// Scores against the motion in the project file.
    Evaluation,
    /// The report.
    ReportPage,
}

impl PairFile {
    /// Name of the file of a pair: 1 for the second epoch against the first, 2 for the third.
    pub fn name(self, pair: usize) -> String {
        let (stem, extension) = match self {
            Self::StonesCsv => ("stones", "csv"),
            Self::StonesParquet => ("stones", "parquet"),
            Self::M3c2Csv => ("m3c2", "csv"),
            Self::M3c2Laz => ("m3c2", "laz"),
            Self::Matches => ("matches", "json"),
            Self::Registration => ("registration", "json"),
            Self::Neighbours => ("neighbours", "parquet"),
            Self::Evaluation => ("evaluation", "json"),
            Self::ReportPage => ("report", "html"),
        };
        format!("{}.{extension}", numbered(stem, pair))
    }

    /// Place of the file of a pair in the folder of the results, with `/`.
    pub fn place(self, pair: usize) -> String {
        match (self, pair) {
            (Self::StonesCsv | Self::ReportPage, 1) => self.name(pair),
            _ => format!("{DATA_DIR}/{}", self.name(pair)),
        }
    }
}

/// A name of a pair without an extension: `stones` for the first, `stones_2` for the second.
pub fn numbered(stem: impl fmt::Display, pair: usize) -> String {
    match pair {
        1 => stem.to_string(),
        _ => format!("{stem}_{pair}"),
    }
}

/// Decisions about the mask instances of an epoch, counted from 1.
pub fn audit(epoch: usize) -> String {
    format!("{DATA_DIR}/audit_epoch{epoch}.csv")
}

/// Folder of the labelled clouds of an epoch, counted from 1.
pub fn epoch_dir(epoch: usize) -> String {
    format!("{DATA_DIR}/epoch{epoch}")
}

/// Whether a file of the results, by its place, belongs to the report: a page, or a table beside the pages.
pub fn is_of_report(file: &Path) -> bool {
    file.starts_with(REPORT_DIR) || is_report_page(file)
}

/// Whether a file of the results, by its place, is a page of the report.
pub fn is_report_page(file: &Path) -> bool {
    let is_later = |name: &str| {
        let pair = name
            .strip_prefix("data/report_")
            .and_then(|name| name.strip_suffix(".html"));
        pair.is_some_and(|pair| pair.bytes().all(|b| b.is_ascii_digit()))
    };
    let name = file.to_string_lossy().replace('\\', "/");
    name == PairFile::ReportPage.place(1) || name == YEARLY || is_later(&name)
}

/// Whether `dir` holds results of an earlier version, which had almost everything at the first level.
pub fn is_of_older_layout(dir: &Path) -> bool {
    dir.join(PairFile::StonesParquet.name(1)).is_file()
}

/// The table of the first pair, which all results have.
///
/// # Errors
/// `dir` holds no results, or those of an older layout.
pub fn stones_in(dir: &Path) -> Result<PathBuf, Error> {
    let table = dir.join(PairFile::StonesParquet.place(1));
    match table.is_file() {
        true => Ok(table),
        false if is_of_older_layout(dir) => Err(Error::OlderResults(dir.to_path_buf())),
        false => Err(Error::NoResults(dir.to_path_buf())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_later_epochs_count_from_two_and_lie_below() {
        assert_eq!(PairFile::StonesCsv.place(1), "stones.csv");
        assert_eq!(PairFile::StonesCsv.place(2), "data/stones_2.csv");
        assert_eq!(PairFile::StonesParquet.place(1), "data/stones.parquet");
        assert_eq!(PairFile::ReportPage.place(1), "report.html");
        assert_eq!(PairFile::ReportPage.place(3), "data/report_3.html");
        assert_eq!(PairFile::M3c2Csv.name(2), "m3c2_2.csv");
    }

    #[test]
    fn pages_of_the_report_are_known_by_their_places() {
        for page in ["report.html", "yearly.html", "data/report_2.html"] {
            assert!(
                is_report_page(Path::new(page)) && is_of_report(Path::new(page)),
                "{page}"
            );
        }
        for other in [
            "notes.html",
            "data/report.html",
            "data/report_a.html",
            "data/report/joints.csv",
        ] {
            assert!(!is_report_page(Path::new(other)), "{other}");
        }
        assert!(is_of_report(Path::new("data/report/joints.csv")));
    }

    #[test]
    fn results_of_an_older_layout_are_named_as_such() {
        let folder = tempfile::tempdir().unwrap();
        let error = || stones_in(folder.path()).unwrap_err();
        assert!(matches!(error(), Error::NoResults(_)));
        std::fs::write(folder.path().join("stones.parquet"), "").unwrap();
        assert!(matches!(error(), Error::OlderResults(_)) && error().to_string().contains("run again"));
    }
}
