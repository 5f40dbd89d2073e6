//! `trends.json`: what the path of the wall over several epochs means.

use serde::{Deserialize, Serialize};
use stonewise_core::series::{Basis, Estimate, Inseparable, SeriesAnswers, Term, VarianceFactor};

/// Version of the file's layout.
pub const TRENDS_VERSION: u32 = 2;

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
    /// The columns of the model with the values at which they are zero: of the trend years since 1970, of level and
    /// temperature their mean over the epochs.
    pub basis: Option<Basis>,
    /// Terms that the epochs cannot carry.
    pub not_separable: Vec<InseparableRecord>,
    /// Level and temperature over the time of the series, where they are known.
    pub conditions: Vec<ConditionRecord>,
    /// How much larger the variances of errors are than claimed: along the wall, up and out.
    pub variance_factors: Option<[VarianceFactor; 3]>,
    /// All stones that have a model, as zone 0.
    pub wall: Option<ZoneTrend>,
    /// The zones of deformation of the newest epoch that shows any.
    pub zones: Vec<ZoneTrend>,
    /// The four answers.
    pub answers: SeriesAnswers,
}

/// What a zone of deformation does over time, or the wall: the mean of its stones. Standard deviations are the means of
/// theirs, for errors that all of them share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZoneTrend {
    /// Epoch of the zone; empty for the wall.
    pub epoch: String,
    /// Number of the zone, as in the stone table of the epoch; 0 for the wall.
    pub zone_id: u32,
    /// Its stones that have a model.
    pub stones: usize,
    /// Other epochs of whose zones of deformation at least half of its stones are: they confirm it. Empty for the wall.
    #[serde(default)]
    pub confirmed_by: Vec<String>,
    /// Along the wall, up and out, metres a year.
    pub velocity: [f64; 3],
    /// Standard deviations.
    pub sd: [f64; 3],
    /// Metres for each metre of level, where the model has that.
    pub level: Option<EstimateRecord>,
    /// Metres for each degree, where the model has that.
    pub temperature: Option<EstimateRecord>,
    /// The yearly wave, where the model has that.
    pub season: Option<SeasonRecord>,
    /// Each epoch with a date.
    pub path: Vec<PathPoint>,
    /// The model between the epochs and half a year beyond, on days whose conditions are known.
    pub curve: Vec<CurvePoint>,
    /// The newest epoch less what the others predict for it under its conditions; absent where it shows too little.
    pub departure: Option<EstimateRecord>,
}

/// Values along the wall, up and out, with standard deviations of which 1.96 hold 95 %.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EstimateRecord {
    /// The values.
    pub value: [f64; 3],
    /// Their standard deviations.
    pub sd: [f64; 3],
}

impl From<Estimate> for EstimateRecord {
    fn from(estimate: Estimate) -> Self {
        Self {
            value: estimate.value.into(),
            sd: estimate.sd.into(),
        }
    }
}

/// A yearly wave.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeasonRecord {
    /// Half of what lies between its ends, metres.
    pub amplitude: EstimateRecord,
    /// Days since New Year at which it is largest.
    pub largest_on: EstimateRecord,
}

/// An epoch on the path of a zone; metres, along the wall, up and out, from where the reference shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathPoint {
    /// Name of the epoch.
    pub epoch: String,
    /// Its date.
    pub date: String,
    /// What it shows, with the error of that epoch alone; absent where it shows no stone of the zone.
    pub measured: Option<EstimateRecord>,
    /// What the model says of it.
    pub model: EstimateRecord,
}

/// The model on a day.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// The day.
    pub date: String,
    /// What the model gives, as in the path.
    #[serde(flatten)]
    pub model: EstimateRecord,
    /// Whether the day comes after the newest epoch, or its conditions lie beyond those of the epochs.
    pub extrapolated: bool,
}

/// A condition over the time of the series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConditionRecord {
    /// The term that it is.
    pub term: Term,
    /// Name as the project has it.
    pub name: String,
    /// Days with their values, of the epochs and between them.
    pub readings: Vec<(String, f64)>,
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
