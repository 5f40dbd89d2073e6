//! What is gathered of the points of a file while they pass by.

use std::collections::BTreeMap;

use nalgebra::Point3;
use serde::Serialize;
use stonewise_core::geometry::Bounds;

use super::spacing::Spacing;
use super::{PointChunk, Remark};
use crate::crs::Units;

/// Points per chunk of a pass that only looks.
pub(super) const CHUNK_POINTS: usize = 100_000;
/// Finest step of coordinates in text that is looked for, as a power of ten.
const FINEST_DECIMALS: usize = 5;
/// At least this many points are needed to distinguish coordinates in single precision from others.
const FEW_POINTS: u64 = 10;

/// The values of one field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldRange {
    /// Name.
    pub name: String,
    /// Smallest and largest finite value; `None` where there is none.
    pub range: Option<[f64; 2]>,
}

/// The points of one source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SourcePoints {
    /// Point source ID, or number of the scan from 1.
    pub number: u32,
    /// Points with a position.
    pub points: u64,
    /// First and last time, where its points have times.
    pub times: Option<[f64; 2]>,
}

/// How coordinates are rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rounding {
    /// LAS: steps from an offset, metres.
    Scaled {
        /// For each axis.
        scale: [f64; 3],
        /// For each axis.
        offset: [f64; 3],
    },
    /// To this many decimals.
    Decimals(usize),
    /// To single precision: the step at the largest coordinate, metres.
    Single(f64),
    /// To double precision.
    Double,
}

/// What times of points count from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// The beginning of the GPS week.
    GpsWeek,
    /// 6 January 1980, less 10^9 seconds.
    AdjustedGps,
    /// Unknown.
    #[default]
    Unknown,
}

/// When a file was written.
#[derive(Clone, Debug, PartialEq)]
pub enum Created {
    /// Year, month and day.
    Day(String),
    /// Seconds of GPS time since 6 January 1980.
    Gps(f64),
}

/// What the head of a file says.
#[derive(Default)]
pub(super) struct Head {
    pub format: String,
    pub software: Option<String>,
    pub created: Option<Created>,
    pub clock: Clock,
    pub rounding: Option<Rounding>,
    /// As the file names it.
    pub crs: Option<String>,
    pub units: Option<Units>,
    pub claimed_bounds: Option<Bounds>,
    pub remarks: Vec<Remark>,
}

/// Fields in the order in which they came up, with their ranges.
#[derive(Default)]
pub(super) struct Fields {
    pub list: Vec<FieldRange>,
}

impl Fields {
    pub fn extend(&mut self, name: &str, values: impl Iterator<Item = f64>) {
        let place = self.list.iter().position(|f| f.name == name).unwrap_or_else(|| {
            self.list.push(FieldRange {
                name: name.to_owned(),
                range: None,
            });
            self.list.len() - 1
        });
        let range = &mut self.list[place].range;
        for value in values.filter(|v| v.is_finite()) {
            let [low, high] = range.unwrap_or([value; 2]);
            *range = Some([low.min(value), high.max(value)]);
        }
    }
}

/// What is gathered of the points, chunk by chunk.
pub(super) struct Gathered {
    pub bounds: Option<Bounds>,
    pub fields: Fields,
    pub sources: BTreeMap<u32, SourcePoints>,
    pub spacing: Spacing,
    pub steps: Steps,
}

impl Default for Gathered {
    fn default() -> Self {
        Self {
            bounds: None,
            fields: Fields::default(),
            sources: BTreeMap::new(),
            spacing: Spacing::new(),
            steps: Steps::default(),
        }
    }
}

impl Gathered {
    pub fn add(&mut self, chunk: &PointChunk) {
        if let Some(new) = Bounds::of(chunk.positions.iter().copied()) {
            self.bounds = Some(self.bounds.map_or(new, |b| b.union(&new)));
        }
        self.spacing.add(&chunk.positions);
        self.steps.add(&chunk.positions);
        if let Some(all) = &chunk.intensities {
            self.fields.extend("intensity", all.iter().map(|v| f64::from(*v)));
        }

        if let Some(all) = &chunk.colors {
            for (k, name) in ["red", "green", "blue"].into_iter().enumerate() {
                self.fields.extend(name, all.iter().map(|c| f64::from(c[k])));
            }
        }

        if let Some(all) = &chunk.times_s {
            self.fields.extend("gps_time", all.iter().copied());
        }

        for i in 0..chunk.len() {
            let number = match (&chunk.sources, chunk.scan) {
                (Some(sources), _) => u32::from(sources[i]),
                (None, scan) => scan.map_or(0, |scan| scan as u32 + 1),
            };
            let source = self.sources.entry(number).or_insert(SourcePoints {
                number,
                points: 0,
                times: None,
            });
            source.points += 1;
            let time = chunk.times_s.as_ref().map(|all| all[i]);
            if let Some(time) = time.filter(|t| t.is_finite()) {
                let [low, high] = source.times.unwrap_or([time; 2]);
                source.times = Some([low.min(time), high.max(time)]);
            }
        }
    }
}

/// Which roundings all coordinates fit.
pub(super) struct Steps {
    points: u64,
    is_single: bool,
    largest: f64,
    /// The smallest number of decimals that holds all of them.
    decimals: usize,
}

impl Default for Steps {
    fn default() -> Self {
        Self {
            points: 0,
            is_single: true,
            largest: 0.0,
            decimals: 0,
        }
    }
}

impl Steps {
    fn add(&mut self, points: &[Point3<f64>]) {
        self.points += points.len() as u64;
        for value in points.iter().flat_map(|p| p.iter()) {
            self.is_single &= f64::from(*value as f32) == *value;
            self.largest = self.largest.max(value.abs());
            while self.decimals <= FINEST_DECIMALS && !has_decimals(*value, self.decimals) {
                self.decimals += 1;
            }
        }
    }

    pub fn rounding(&self) -> Rounding {
        if self.points < FEW_POINTS {
            Rounding::Double
        } else if self.decimals <= FINEST_DECIMALS {
            Rounding::Decimals(self.decimals)
        } else if self.is_single {
            let largest = self.largest as f32;
            Rounding::Single(f64::from(largest.next_up()) - f64::from(largest))
        } else {
            Rounding::Double
        }
    }
}

/// Whether a number has at most `decimals` decimal places, to the precision of a double.
fn has_decimals(value: f64, decimals: usize) -> bool {
    let scaled = value * 10f64.powi(decimals as i32);
    (scaled - scaled.round()).abs() <= 4.0 * f64::EPSILON * scaled.abs().max(1.0)
}
