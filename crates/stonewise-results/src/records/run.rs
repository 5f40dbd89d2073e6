//! `run.json`: what was run, on what, how, and how long it took.

use super::{DatumState, Headlines, Timestamp};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use stonewise_base::part::Part;
use stonewise_base::settings::Settings;
use stonewise_base::warnings::Warning;
use stonewise_core::evaluate::MotionField;

/// The record of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Version of stonewise.
    pub version: String,
    /// Digest of the program; empty in records of earlier versions.
    #[serde(default)]
    pub program: String,
    /// Class of the processor, on which the last digits depend; empty in records of earlier versions.
    #[serde(default)]
    pub processor: String,
    /// When the run ended.
    pub finished_at: Timestamp,
    /// The project.
    pub project: ProjectRecord,
    /// The coordinate system of the first epoch's clouds; absent for a local frame.
    pub crs: Option<CrsRecord>,
    /// What is known about the registration of each later epoch, by its name.
    pub datum: BTreeMap<String, DatumState>,
    /// The verdict in a word and a sentence; absent in records of earlier versions.
    #[serde(default)]
    pub verdict: Option<Headlines>,
    /// The epochs, in time order.
    pub epochs: Vec<EpochRecord>,
    /// The part of the survey that took part; absent: all.
    pub part: Option<Part>,
    /// The file of edits by hand; absent where the project has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edits: Option<InputRecord>,
    /// The file of conditions; absent where the project names none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conditions: Option<InputRecord>,
    /// Files of other instruments.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub instruments: Vec<InputRecord>,
    /// Every parameter as it was used.
    pub parameters: Settings,
    /// The steps, in order.
    pub steps: Vec<StepTime>,
    /// What went wrong without stopping the run.
    pub warnings: Vec<Warning>,
}

/// The project that was run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProjectRecord {
    /// Name of the structure.
    pub name: String,
    /// The project file, from the folder of the results; its whole path where there is no such way.
    pub file: PathBuf,
}

/// A coordinate system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CrsRecord {
    /// Code of the EPSG; absent for a system that has none, as one that was restated in metres.
    pub epsg: Option<i32>,
    /// Name.
    pub name: String,
    /// Definition as WKT; empty where the clouds have none.
    pub wkt: String,
}

/// One epoch: its inputs, and how much was found in them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpochRecord {
    /// Name of the epoch.
    pub name: String,
    /// Date of the survey, as the project states it.
    pub date: Option<String>,
    /// Conditions during the survey, as the project states them.
    pub conditions: BTreeMap<String, f64>,
    /// Point clouds.
    pub clouds: Vec<InputRecord>,
    /// Camera file or folder; absent where views of the clouds took the place of photos.
    pub cameras: Option<InputRecord>,
    /// Masks; absent where the detector found the stones.
    pub masks: Option<InputRecord>,
    /// Folder of the photos; absent likewise.
    pub images: Option<PathBuf>,
    /// Known motion of the points.
    pub motion: Option<MotionField>,
    /// Points with finite coordinates.
    pub points: u64,
    /// Number of photos, or of views of the clouds, that were used.
    pub photo_count: usize,
    /// The photos and views in which the detector looked for stones; empty with masks.
    pub photos: Vec<PhotoScale>,
    /// Stones.
    pub stones: usize,
}

/// A photo, or a view of the clouds, in which the detector looked for stones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotoScale {
    /// Its file, relative to the folder of the photos; of a view its name.
    pub photo: PathBuf,
    /// The scale at which the detector looked at all of it, 1 = as it is.
    pub scale: f64,
}

/// An input file or folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InputRecord {
    /// Where it lies.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Digest of its content.
    pub blake3: String,
    /// The day on which it was written, where it says so: `YYYY-MM-DD`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub written: Option<String>,
}

/// Time and memory of one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepTime {
    /// Name of the step.
    pub step: String,
    /// Wall time, seconds; small where earlier results were taken.
    pub seconds: f64,
    /// Processor time of all threads, seconds; absent where the system does not report it.
    pub processor_seconds: Option<f64>,
    /// Whether the results of an earlier run were taken.
    pub resumed: bool,
    /// Highest memory of the process so far, bytes; absent where the system does not report it.
    pub peak_memory_bytes: Option<u64>,
}
