//! Every parameter of every step.

use crate::report_params::ReportParams;
use crate::stable::StableArea;
use crate::thresholds::Thresholds;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use stonewise_core::change::M3c2Params;
use stonewise_core::evaluate::EvaluationParams;
use stonewise_core::matching::MatchParams;
use stonewise_core::params::{Params, Range, Ranged, with_ranges};
use stonewise_core::registration::observers::EpochErrorParams;
use stonewise_core::registration::photos::PhotoParams;
use stonewise_core::registration::{AdjustmentParams, GicpParams};
use stonewise_core::transfer::{CarryParams, StoneParams, TransferParams};
use stonewise_core::views::ViewParams;
use stonewise_segment::tiling::TilingOptions;

/// How stones are found in photos without masks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct SegmentParams {
    /// The detector: `built-in`, or a file that `stonewise detector train` wrote.
    pub model: PathBuf,
    /// Photos that are to show each part of the wall, among which the detector's are chosen (`photos = "auto"`
    /// of an epoch).
    pub photos_per_place: u32,
    /// How photos are cut into tiles.
    pub tiling: TilingOptions,
}

impl Default for SegmentParams {
    fn default() -> Self {
        Self {
            model: PathBuf::from("built-in"),
            photos_per_place: 4,
            tiling: TilingOptions::default(),
        }
    }
}

impl Params for SegmentParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![Range::between(1.0, f64::INFINITY).holds("photos_per_place", self.photos_per_place)]
    }

    fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
        vec![("tiling", &self.tiling)]
    }
}

/// Parameters of all steps, one table each in the project file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How clouds are cut.
    pub ingest: IngestParams,
    /// Views of the clouds of epochs without photos, or beside photos.
    pub views: ViewParams,
    /// Stones in photos without masks.
    pub segment: SegmentParams,
    /// Photo labels to points.
    pub label: TransferParams,
    /// The table of stones.
    pub stones: StoneParams,
    /// Stones that the detector missed in one epoch, from others.
    pub carry: CarryParams,
    /// Stones across epochs.
    pub r#match: MatchParams,
    /// One motion per stone.
    pub registration: RegistrationParams,
    /// Comparison along normals.
    pub m3c2: M3c2Params,
    /// Scoring against a known motion.
    pub evaluate: EvaluationParams,
    /// Which motions call for attention, and which for an alarm.
    pub thresholds: Thresholds,
    /// The first page of the report.
    pub report: ReportParams,
}

impl Params for Settings {
    fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
        vec![
            ("ingest", &self.ingest),
            ("views", &self.views),
            ("segment", &self.segment),
            ("label", &self.label),
            ("stones", &self.stones),
            ("carry", &self.carry),
            ("match", &self.r#match),
            ("registration", &self.registration),
            ("m3c2", &self.m3c2),
            ("evaluate", &self.evaluate),
            ("thresholds", &self.thresholds),
        ]
    }
}

/// How clouds are cut into tiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct IngestParams {
    /// Edge of a tile, metres. 4 m keeps offsets exact to a micrometre and a dense tile under 20 MB.
    pub size_m: f64,
}

impl Default for IngestParams {
    fn default() -> Self {
        Self { size_m: 4.0 }
    }
}

impl Params for IngestParams {
    fn ranges(&self) -> Vec<Ranged> {
        // Offsets in a tile are single precision: at 100 m they are exact to 3 micrometres. Below half a
        // metre a wall of 200 m falls into more than 20,000 files.
        vec![Range::between(0.5, 100.0).holds("size_m", self.size_m)]
    }
}

/// How the motion of a stone is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// All stones together, each sharing with its neighbours as much as the noise demands.
    #[default]
    Adjustment,
    /// Each stone by itself with its surroundings, by plane-to-plane ICP: the paper's way.
    Gicp,
}

/// How epochs come into the frame of the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Align {
    /// Their clouds lie in it.
    #[default]
    None,
    /// By a rigid motion that brings their stones together.
    Stones,
}

/// Which estimator measures the stones, and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct RegistrationParams {
    /// Which estimator. The adjustment: it is the better by far on noisy clouds, and where stones move
    /// singly.
    pub estimator: Estimator,
    /// Standard deviation of the registration of an epoch, per axis, metres, as the user states it; 0 states
    /// that there is none. Absent: not stated, and without stable areas uncertainties hold for motions
    /// against the common motion of the stones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epoch_error_m: Option<f64>,
    /// Areas that did not move between the epochs: what they seem to have done is the error of the epochs'
    /// registration. It is reported apart and enters absolute uncertainty. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stable: Vec<StableArea>,
    /// Whether surfaces off the wall that both epochs show serve as stable areas, too. false, because
    /// clouds alone do not show whether ground and rock kept their place.
    pub auto_stable: bool,
    /// Whether the stones bring epochs of other frames to the frame of the reference. none: all clouds are taken
    /// as they lie. stones: the motion of the wall as a whole stays unknown, its deformation does not.
    pub align: Align,
    /// Width of a stone's border, in noise levels of its points, where a point belongs to the stone by its
    /// place and not by its label. 3: farther inside, noise does not change a label; with 0 (labels alone)
    /// the whole wall of a UAV survey seems to move by 1 to 2 mm.
    pub border_noises: f64,
    /// Parameters of the adjustment of all stones together.
    pub adjustment: AdjustmentParams,
    /// Stones tracked from photo to photo, as part of the adjustment.
    pub photos: PhotoParams,
    /// Parameters of plane-to-plane ICP.
    pub gicp: GicpParams,
    /// How the errors of stations, strips and whole epochs are found.
    pub observers: EpochErrorParams,
}

impl Default for RegistrationParams {
    fn default() -> Self {
        Self {
            estimator: Estimator::default(),
            epoch_error_m: None,
            stable: Vec::new(),
            auto_stable: false,
            align: Align::None,
            border_noises: 3.0,
            adjustment: AdjustmentParams::default(),
            photos: PhotoParams::default(),
            gicp: GicpParams::default(),
            observers: EpochErrorParams::default(),
        }
    }
}

impl Params for RegistrationParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::between(0.0, 1.0).holds("epoch_error_m", self.epoch_error_m),
            Range::NOT_NEGATIVE.holds("border_noises", self.border_noises),
        ]
    }

    fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
        vec![
            ("adjustment", &self.adjustment),
            ("photos", &self.photos),
            ("gicp", &self.gicp),
            ("observers", &self.observers),
        ]
    }
}
