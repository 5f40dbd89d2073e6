//! `trends.json`: what the path of the wall over several epochs means.

use serde::{Deserialize, Serialize};
use stonewise_core::series::{Inseparable, SeriesAnswers, Term, VarianceFactor};

/// Version of the file's layout.
pub const TRENDS_VERSION: u32 = 1;

/// What was found of a series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrendsRecord {
    /// Version of the file's layout.
    pub version: u32,
    /// Names of the epochs with a date, in the order of time.
    pub epochs: Vec<String>,
    /// Names of those without, which take no part.
    pub undated: Vec<String>,
    /// Terms of the model, the trend first; none where there is no model.
    pub terms: Vec<Term>,
    /// Terms that the epochs cannot carry.
    pub not_separable: Vec<InseparableRecord>,
    /// How much larger the variances of errors are than claimed: along the wall, up and out.
    pub variance_factors: Option<[VarianceFactor; 3]>,
    /// Velocities of the newest epoch's zones of deformation.
    pub zones: Vec<ZoneTrend>,
    /// The four answers.
    pub answers: SeriesAnswers,
}

/// How fast a zone of deformation moves: the mean of its stones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZoneTrend {
    /// Epoch of the zone.
    pub epoch: String,
    /// As in the stone table of the epoch.
    pub zone_id: u32,
    /// Its stones that have a velocity.
    pub stones: usize,
    /// Along the wall, up and out, metres a year.
    pub velocity: [f64; 3],
    /// Standard deviations, for errors that all of its stones share: the mean of theirs.
    pub sd: [f64; 3],
}

/// A term that the epochs cannot carry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InseparableRecord {
    /// For programs.
    #[serde(flatten)]
    pub inseparable: Inseparable,
    /// For people, in the language of the report.
    pub text: String,
}
