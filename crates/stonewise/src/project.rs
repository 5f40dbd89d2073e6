//! The project file: which surveys, and every parameter of every step.

use crate::error::{Error, Result};
use crate::limits::impossible;
use crate::part::Part;
use crate::stable::StableArea;
use serde::{Deserialize, Serialize};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use stonewise_core::change::M3c2Params;
use stonewise_core::evaluate::{EvaluationParams, MotionField};
use stonewise_core::matching::MatchParams;
use stonewise_core::registration::{GicpParams, NetworkParams};
use stonewise_core::transfer::{StoneParams, TransferParams};
use stonewise_segment::Weights;
use stonewise_segment::tiling::TilingOptions;
use toml::Spanned;

/// A checked project: paths exist, values are possible.
#[derive(Clone, Debug)]
pub struct Project {
    /// The project file itself.
    pub path: PathBuf,
    /// Name of the structure.
    pub name: String,
    /// The surveys, in time order; two at least.
    pub epochs: Vec<Epoch>,
    /// Parameters of all steps.
    pub settings: Settings,
    /// Which points take part; all where absent. No key of the file: commands set it.
    pub part: Option<Part>,
}

/// One survey.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Name, as reports show it.
    pub name: String,
    /// Point clouds, all in one frame.
    pub clouds: Vec<PathBuf>,
    /// Folder of the photos.
    pub images: PathBuf,
    /// Camera file or COLMAP folder.
    pub cameras: PathBuf,
    /// COCO json or folder of label PNGs.
    pub masks: Option<PathBuf>,
    /// Known motion of the points, applied after labelling.
    pub motion: Option<MotionField>,
}

/// How stones are found in photos without masks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentParams {
    /// The network: `built-in`, or a file that `stonewise train` wrote.
    pub model: PathBuf,
    /// How photos are cut into tiles.
    pub tiling: TilingOptions,
}

impl Default for SegmentParams {
    fn default() -> Self {
        Self {
            model: PathBuf::from("built-in"),
            tiling: TilingOptions::default(),
        }
    }
}

/// Parameters of all steps, one table each in the project file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How clouds are cut.
    pub tiles: TileParams,
    /// Stones in photos without masks.
    pub segment: SegmentParams,
    /// Photo labels to points.
    pub transfer: TransferParams,
    /// The table of stones.
    pub stones: StoneParams,
    /// Stones across epochs.
    pub matching: MatchParams,
    /// One motion per stone.
    pub registration: RegistrationParams,
    /// Comparison along normals.
    pub m3c2: M3c2Params,
    /// Scoring against a known motion.
    pub evaluation: EvaluationParams,
}

/// How clouds are cut into tiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TileParams {
    /// Edge of a tile, metres. 4 m keeps offsets exact to a micrometre and a dense tile under 20 MB.
    pub size_m: f64,
}

impl Default for TileParams {
    fn default() -> Self {
        Self { size_m: 4.0 }
    }
}

/// How the motion of a stone is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// All stones together, each sharing with its neighbours as much as the noise demands.
    #[default]
    Network,
    /// Each stone by itself with its surroundings, by plane-to-plane ICP: the paper's way.
    Gicp,
}

/// Which estimator measures the stones, and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegistrationParams {
    /// Which estimator. The network: it is the better by far on noisy clouds, and where stones move singly.
    pub estimator: Estimator,
    /// Standard deviation of the epochs' common registration, per axis, metres; it enters absolute uncertainty.
    pub epoch_error_m: f64,
    /// Areas that did not move between the epochs: what they seem to have done is the error of the epochs' registration.
    /// It is reported apart and enters absolute uncertainty. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stable: Vec<StableArea>,
    /// Width of a stone's border, in noise levels of its points, where a point belongs to the stone by its place and not by
    /// its label. 3: farther inside, noise does not change a label; with 0 (labels alone) the whole wall of a UAV survey
    /// seems to move by 1 to 2 mm.
    pub border_noises: f64,
    /// Parameters of the network adjustment.
    pub network: NetworkParams,
    /// Parameters of plane-to-plane ICP.
    pub gicp: GicpParams,
}

impl Default for RegistrationParams {
    fn default() -> Self {
        Self {
            estimator: Estimator::default(),
            epoch_error_m: 0.0,
            stable: Vec::new(),
            border_noises: 3.0,
            network: NetworkParams::default(),
            gicp: GicpParams::default(),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawProject {
    project: RawHeader,
    epochs: Vec<RawEpoch>,
    #[serde(default)]
    tiles: TileParams,
    #[serde(default)]
    segment: SegmentParams,
    #[serde(default)]
    transfer: TransferParams,
    #[serde(default)]
    stones: StoneParams,
    #[serde(default)]
    matching: MatchParams,
    #[serde(default)]
    registration: RegistrationParams,
    #[serde(default)]
    m3c2: M3c2Params,
    #[serde(default)]
    evaluation: EvaluationParams,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHeader {
    name: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEpoch {
    name: Spanned<String>,
    clouds: Spanned<Vec<Spanned<PathBuf>>>,
    images: Spanned<PathBuf>,
    cameras: Spanned<PathBuf>,
    masks: Option<Spanned<PathBuf>>,
    motion: Option<MotionField>,
}

impl Project {
    /// Reads and checks a project file.
    ///
    /// Errors name the line: a key that is not known, a file that does not exist, a value that cannot be.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_with(path, 2)
    }

    /// The same for a project that may have a single epoch, which is to be split.
    pub fn read_for_split(path: &Path) -> Result<Self> {
        Self::read_with(path, 1)
    }

    fn read_with(path: &Path, least_epochs: usize) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(Error::io("reading the project file", path))?;
        let source = Source { path, text: &text };
        let raw: RawProject = toml::from_str(&text)
            .map_err(|e| source.error(e.span().unwrap_or(0..0), e.message().trim().replace('\n', "; ")))?;
        if raw.epochs.len() < least_epochs {
            let at = text.find("[[epochs]]").unwrap_or(0);
            return Err(source.error(
                at..at,
                format!("{least_epochs} [[epochs]] at least are needed, in time order"),
            ));
        }
        let settings = Settings {
            tiles: raw.tiles,
            segment: source.segment(raw.segment)?,
            transfer: raw.transfer,
            stones: raw.stones,
            matching: raw.matching,
            registration: raw.registration,
            m3c2: raw.m3c2,
            evaluation: raw.evaluation,
        };
        source.check_settings(&settings)?;
        let epochs = raw
            .epochs
            .into_iter()
            .map(|e| source.epoch(e))
            .collect::<Result<Vec<_>>>()?;
        Ok(Self {
            path: path.to_path_buf(),
            name: raw.project.name.into_inner(),
            epochs,
            settings,
            part: None,
        })
    }
}

impl Project {
    /// Two clouds without photos, for comparisons of clouds alone.
    pub fn of_clouds(before: &Path, after: &Path, m3c2: M3c2Params) -> Self {
        let epoch = |name: &str, cloud: &Path| Epoch {
            name: name.to_owned(),
            clouds: vec![cloud.to_path_buf()],
            images: PathBuf::new(),
            cameras: PathBuf::new(),
            masks: None,
            motion: None,
        };
        Self {
            path: before.to_path_buf(),
            name: "clouds".to_owned(),
            epochs: vec![epoch("before", before), epoch("after", after)],
            settings: Settings {
                m3c2,
                ..Settings::default()
            },
            part: None,
        }
    }
}

/// The text of a project file, to point into.
struct Source<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Source<'_> {
    fn error(&self, span: Range<usize>, message: impl Into<String>) -> Error {
        let line = self.text.get(..span.start).unwrap_or("").matches('\n').count() + 1;
        Error::Project {
            path: self.path.to_path_buf(),
            line,
            message: message.into(),
        }
    }

    fn epoch(&self, raw: RawEpoch) -> Result<Epoch> {
        if raw.clouds.get_ref().is_empty() {
            return Err(self.error(raw.clouds.span(), "an epoch needs one cloud at least"));
        }
        if raw.name.get_ref().trim().is_empty() {
            return Err(self.error(raw.name.span(), "an epoch needs a name"));
        }
        let clouds = raw.clouds.into_inner();
        Ok(Epoch {
            name: raw.name.into_inner(),
            clouds: clouds
                .into_iter()
                .map(|c| self.existing(c))
                .collect::<Result<_>>()?,
            images: self.existing(raw.images)?,
            cameras: self.existing(raw.cameras)?,
            masks: raw.masks.map(|m| self.existing(m)).transpose()?,
            motion: raw.motion,
        })
    }

    /// The network's file, like all paths, is relative to the project file.
    fn segment(&self, mut params: SegmentParams) -> Result<SegmentParams> {
        let at = |key: &str| self.text.find(key).unwrap_or(0);
        if let Weights::File(file) = Weights::named(&params.model) {
            let start = at("model");
            params.model = self.existing(Spanned::new(start..start, file))?;
        }
        if let Some((key, what)) = params.tiling.impossible() {
            return Err(self.error(at(key)..at(key), format!("{key} {what}")));
        }
        Ok(params)
    }

    /// The path relative to the project file, which must exist.
    fn existing(&self, raw: Spanned<PathBuf>) -> Result<PathBuf> {
        let path = self.path.parent().unwrap_or(Path::new("")).join(raw.get_ref());
        if path.exists() {
            return Ok(path);
        }
        Err(self.error(
            raw.span(),
            format!(
                "no such file or folder: {} (paths are relative to the project file)",
                path.display()
            ),
        ))
    }

    /// Values that the types do not exclude.
    fn check_settings(&self, settings: &Settings) -> Result<()> {
        let Some((key, message)) = impossible(settings) else {
            return Ok(());
        };
        let at = self.text.find(&key).unwrap_or(0);
        Err(self.error(at..at, message))
    }
}
