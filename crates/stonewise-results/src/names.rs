//! The names of all result files.

use std::fmt;

/// What was run, on what, how, and how long it took.
pub const RUN: &str = "run.json";
/// The state of the wall, its zones and its stones for all later epochs.
pub const VERDICT: &str = "verdict.json";
/// Polygons of the stones of the first epoch.
pub const OUTLINES: &str = "outlines.json";
/// The unrolled wall, where stones were edited by hand: that of the stones as they were found.
pub const FACADE: &str = "facade.json";
/// Every edit of a person with who, when and why, and what it did in each epoch.
pub const EDITS_AUDIT: &str = "audit_edits.csv";
/// Every stone that was looked for in an epoch whose photos do not show it.
pub const CARRY_AUDIT: &str = "audit_carried.csv";
/// Rows of all later epochs, where there are more than one.
pub const SERIES: &str = "series.parquet";
/// The model in time of every stone, where there are more than two epochs.
pub const TRENDS_TABLE: &str = "trends.parquet";
/// What the path over all epochs means.
pub const TRENDS: &str = "trends.json";
/// Other instruments beside the stones around them.
pub const INSTRUMENTS: &str = "instruments.json";
/// Zones of deformation of all later epochs.
pub const ZONES: &str = "zones.parquet";
/// Scores against a table of true stones.
pub const EVALUATION_TRUTH: &str = "evaluation_truth.json";
/// Layers for QGIS.
pub const GEOPACKAGE: &str = "stones.gpkg";
/// The stones as a table with their polygons.
pub const GEOPARQUET: &str = "stones.geo.parquet";
/// The stones' faces for ParaView.
pub const FACES_VTP: &str = "stones.vtp";
/// The stones' centroids with their displacements for ParaView.
pub const DISPLACEMENTS_VTP: &str = "displacements.vtp";
/// The stones' faces as a coloured mesh.
pub const FACES_PLY: &str = "stones.ply";
/// The points of stones, coloured by their motion.
pub const FACE_CLOUD: &str = "stones.laz";
/// Remarks and signature of people; no run writes it.
pub const REMARKS: &str = "remarks.json";
/// Digests of all result files, as `b3sum` writes them.
pub const DIGESTS: &str = "digests.b3";
/// Folder of the report.
pub const REPORT_DIR: &str = "report";
/// The part of the yearly safety report on measurements, in the folder of the report.
pub const YEARLY: &str = "yearly.html";
/// Folder of the excerpts that the report shows.
pub const EVIDENCE_DIR: &str = "evidence";
/// Folder of the steps' files.
pub const WORK_DIR: &str = "work";

/// A file that every later epoch has: the second epoch's is `stones.csv`, the third's `stones_2.csv`, and so
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
    /// The report, in its folder.
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
            Self::ReportPage => ("index", "html"),
        };
        format!("{}.{extension}", numbered(stem, pair))
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
    format!("audit_epoch{epoch}.csv")
}

/// Folder of the clouds of an epoch, counted from 1.
pub fn epoch_dir(epoch: usize) -> String {
    format!("epoch{epoch}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_later_epochs_count_from_two() {
        assert_eq!(PairFile::StonesCsv.name(1), "stones.csv");
        assert_eq!(PairFile::M3c2Csv.name(2), "m3c2_2.csv");
        assert_eq!(PairFile::ReportPage.name(2), "index_2.html");
    }
}
