//! How a project file is read and checked.

use super::{Epoch, Origin, PhotoChoice, PhotoFiles, Project};
use crate::conditions::ConditionsFile;
use crate::distances::{RawDistances, distances, read_raw, targets};
use crate::edits::EditsFile;
use crate::instruments::InstrumentFile;
use crate::networks::{NetworkFile, check_networks};
use crate::sources::SourceRule;
use schemars::JsonSchema;
use serde::Deserialize;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_base::files::read_parameters;
use stonewise_base::messages::Said;
use stonewise_base::messages::notices::{EPOCH_WITHOUT_DATE, EPOCHS_NUMBERED};
use stonewise_base::profile::Profile;
use stonewise_base::report_params::{ReportParams, logo_type};
use stonewise_base::settings::{IngestParams, RegistrationParams, SegmentParams, Settings};
use stonewise_base::thresholds::Thresholds;
use stonewise_core::change::M3c2Params;
use stonewise_core::epoch::EpochId;
use stonewise_core::evaluate::{EvaluationParams, MotionField};
use stonewise_core::matching::MatchParams;
use stonewise_core::params::Params;
use stonewise_core::transfer::{CarryParams, StoneParams, TransferParams};
use stonewise_core::views::ViewParams;
use stonewise_io::cameras::MapFrame;
use stonewise_io::crs::{Geoid, MapSystem};
use stonewise_io::network::read_network;
use stonewise_io::text::as_stored;
use stonewise_segment::Weights;
use toml::Spanned;
use toml::value::Datetime;

/// What to do about backslashes.
const SLASHES: &str = "use / or single quotes in paths";
/// Keys that are gone, as the reader of TOML names them, and what to do instead.
const GONE_KEYS: [(&str, &str); 3] = [
    (
        "unknown field `start`, expected one of `buffer_m`",
        "the iteration starts at no motion, as in the paper; raise max_distance_m where stones move farther",
    ),
    (
        "unknown field `plane_radius_m`, expected one of `buffer_m`",
        "raise plane_neighbours instead",
    ),
    (
        "unknown field `tolerance_rad`, expected one of `buffer_m`",
        "tolerance_m limits what a step moves any point by, turns included",
    ),
];

/// A project file of stonewise: which surveys, and the parameters of every step.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawProject {
    /// The structure.
    project: RawHeader,
    /// The surveys, two or more, in time order.
    epochs: Vec<RawEpoch>,
    #[serde(default)]
    ingest: IngestParams,
    #[serde(default)]
    views: ViewParams,
    #[serde(default)]
    segment: SegmentParams,
    #[serde(default)]
    label: TransferParams,
    #[serde(default)]
    stones: StoneParams,
    #[serde(default)]
    carry: CarryParams,
    #[serde(default)]
    r#match: MatchParams,
    #[serde(default)]
    registration: RegistrationParams,
    #[serde(default)]
    m3c2: M3c2Params,
    #[serde(default)]
    evaluate: EvaluationParams,
    #[serde(default)]
    thresholds: Thresholds,
    #[serde(default)]
    report: ReportParams,
    /// Corrections of stones by hand.
    edits: Option<RawEdits>,
    /// Levels, temperatures and other readings over time.
    conditions: Option<RawConditions>,
    /// Other instruments: pendulums, targets, levelling.
    #[serde(default)]
    instruments: Vec<RawInstruments>,
    /// Known lengths, each an observation of the scale of its epoch.
    #[serde(default, deserialize_with = "read_raw")]
    distances: Option<RawDistances>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawInstruments {
    /// A CSV file with the columns name, x, y, z, date, dx, dy, dz, sd_x, sd_y, sd_z, metres; a cell is empty where
    /// nothing was measured.
    #[schemars(with = "Option<PathBuf>")]
    file: Option<Spanned<PathBuf>>,
    /// In place of `file`: an adjusted network of one epoch with its covariance, the XML of gama-local, the .info of JAG3D
    /// or a CSV file.
    #[schemars(with = "Option<PathBuf>")]
    network: Option<Spanned<PathBuf>>,
    /// Name of the epoch whose coordinates `network` has.
    #[schemars(with = "Option<String>")]
    epoch: Option<Spanned<String>>,
    /// Whether the instruments are observations of the datum: of each later epoch, or that of `network`.
    #[serde(default, rename = "use")]
    is_used: bool,
    /// Longest time between two readings of `file` that is interpolated, days. Nothing is extrapolated.
    #[serde(default = "longest_gap_of_instruments_days")]
    #[schemars(with = "f64", range(min = 0))]
    longest_gap_days: Spanned<f64>,
    /// How far from an instrument the stones lie at most that are compared with it, metres.
    #[serde(default = "reach_m")]
    #[schemars(with = "f64", range(min = 0))]
    reach_m: Spanned<f64>,
}

fn longest_gap_of_instruments_days() -> Spanned<f64> {
    Spanned::new(0..0, 31.0)
}

fn reach_m() -> Spanned<f64> {
    Spanned::new(0..0, 2.0)
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawConditions {
    /// A CSV file with a column `date` and any others, whose values are interpolated to the dates of the epochs. What an
    /// epoch's own `conditions` say wins.
    #[schemars(with = "PathBuf")]
    file: Spanned<PathBuf>,
    /// Longest time between two readings that is interpolated, days. Nothing is extrapolated.
    #[serde(default = "longest_gap_days")]
    #[schemars(with = "f64", range(min = 0))]
    longest_gap_days: Spanned<f64>,
}

fn longest_gap_days() -> Spanned<f64> {
    Spanned::new(0..0, 7.0)
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawEdits {
    /// A file of corrections by hand, JSON.
    #[schemars(with = "PathBuf")]
    file: Spanned<PathBuf>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawHeader {
    /// Name of the structure, as reports show it.
    #[schemars(with = "String")]
    name: Spanned<String>,
    /// Name of the epoch that motions count from. Absent: the first.
    #[schemars(with = "Option<String>")]
    reference: Option<Spanned<String>>,
    /// Coordinate system of the clouds: a WKT, or a code such as `EPSG:25832` or `EPSG:25832+7837` (horizontal and
    /// vertical system). Absent: what the clouds name.
    #[schemars(with = "Option<String>")]
    crs: Option<Spanned<String>>,
    /// Lengths that were taken off the clouds' coordinates, x, y, z, metres.
    #[serde(default)]
    false_origin: [f64; 3],
    /// Grid of the geoid above which the heights of the clouds are: GTX, or GeoTIFF such as PROJ's. Absent: heights
    /// above the ellipsoid.
    #[schemars(with = "Option<PathBuf>")]
    geoid: Option<Spanned<PathBuf>>,
}

/// A date, with or without quotes.
#[derive(Deserialize)]
#[serde(try_from = "toml::Value")]
struct SurveyDate(Datetime);

impl TryFrom<toml::Value> for SurveyDate {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<Self, String> {
        let date = match &value {
            toml::Value::Datetime(date) => Some(*date),
            toml::Value::String(text) => text.parse().ok(),
            _ => None,
        };
        date.map(Self)
            .ok_or_else(|| format!("{value} is no date: write it as 2024-05-31"))
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawEpoch {
    /// Name, which no other epoch has.
    #[schemars(with = "String")]
    name: Spanned<String>,
    /// Date of the survey.
    #[schemars(with = "Option<String>")]
    date: Option<Spanned<SurveyDate>>,
    /// Conditions during the survey: any numbers by name, such as `reservoir_level_m`.
    #[serde(default)]
    conditions: BTreeMap<String, f64>,
    /// Point clouds, one or more, all in one frame: LAS, LAZ, COPC, E57, PLY or XYZ.
    #[schemars(with = "Vec<PathBuf>", length(min = 1))]
    clouds: Spanned<Vec<Spanned<PathBuf>>>,
    /// Folder of the photos that the cameras name. Absent, with `cameras`: views of the clouds are looked at.
    #[schemars(with = "Option<PathBuf>")]
    images: Option<Spanned<PathBuf>>,
    /// Cameras: Metashape XML, COLMAP folder, RealityCapture CSV and others.
    #[schemars(with = "Option<PathBuf>")]
    cameras: Option<Spanned<PathBuf>>,
    /// In which photos the detector looks for stones, where there are no masks.
    #[serde(default)]
    photos: PhotoChoice,
    /// Masks of the stones: COCO json, or a folder of 16-bit label PNGs. Absent: the detector finds them.
    #[schemars(with = "Option<PathBuf>")]
    masks: Option<Spanned<PathBuf>>,
    /// A known motion of the points, applied after labelling, by which the run scores itself.
    motion: Option<MotionField>,
    /// What counts as one station or strip, which has an error of its own.
    #[serde(default)]
    sources: SourceRule,
    /// Name of an earlier epoch of the same survey: a source in both has the same error in both.
    #[schemars(with = "Option<String>")]
    same_survey_as: Option<Spanned<String>>,
    /// What the points come from. Absent: intensities or times show a scanner, colours alone photos.
    origin: Option<Origin>,
    /// Name of the bundle adjustment that gave the cameras. Absent: epochs with a camera of equal parameters share one.
    bundle: Option<String>,
}

impl Project {
    /// Reads and checks a project file.
    ///
    /// # Errors
    /// With the line: a key that is not known, a file that does not exist, a value that cannot be.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_with(path, 2)
    }

    /// Reads a project that may have a single epoch, which is to be split.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_for_split(path: &Path) -> Result<Self> {
        Self::read_with(path, 1)
    }

    fn read_with(path: &Path, least_epochs: usize) -> Result<Self> {
        let path = &project_file(path);
        Self::parse_with(path, &project_text(path)?, least_epochs)
    }

    /// The project that a file at `path` with this text would be.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        Self::parse_with(path, text, 2)
    }

    /// The project that a file at `path` with this text would be, of `least_epochs` epochs at least.
    pub(crate) fn parse_with(path: &Path, text: &str, least_epochs: usize) -> Result<Self> {
        let source = Source { path, text };
        let raw: RawProject = toml::from_str(text).map_err(|e| source.not_toml(&e))?;
        if raw.epochs.len() < least_epochs {
            let at = text.find("[[epochs]]").unwrap_or(0);
            return Err(source.error(
                at..at,
                match raw.epochs.len() {
                    1 => "2 [[epochs]] at least are needed, in time order; of one, `stonewise design` shows the wall and what the next will see"
                        .to_owned(),
                    _ => format!("{least_epochs} [[epochs]] at least are needed, in time order"),
                },
            ));
        }
        let settings = Settings {
            ingest: raw.ingest,
            views: raw.views,
            segment: source.segment(raw.segment)?,
            label: raw.label,
            stones: raw.stones,
            carry: raw.carry,
            r#match: raw.r#match,
            registration: raw.registration,
            m3c2: raw.m3c2,
            evaluate: raw.evaluate,
            thresholds: raw.thresholds,
            report: source.report(raw.report)?,
        };
        settings
            .check()
            .map_err(|e| source.error(source.place(&e.key), e.to_string()))?;
        let map = source.map_frame(&raw.project)?;
        source.check_names(&raw.epochs)?;
        source.check_dates(&raw.epochs)?;
        let mut epochs = Vec::new();
        for epoch in raw.epochs {
            epochs.push(source.epoch(epoch, &map, &epochs)?);
        }
        let mut notes = Vec::new();
        let conditions = raw.conditions.map(|c| source.conditions(c)).transpose()?;
        if let Some(file) = &conditions {
            notes.extend(add_conditions(file, &mut epochs));
        }
        if let Some(name) = &raw.project.reference {
            notes.extend(source.put_reference_first(name, &mut epochs)?);
        }
        let (instruments, networks) = source.instruments(raw.instruments, &epochs)?;
        let line = |number: Option<usize>| {
            let key = number.map_or_else(|| "distances".to_owned(), |k| format!("distances.{k}"));
            source.line(source.place(&key))
        };
        let targets = targets(&instruments, &networks);
        let distances = raw
            .distances
            .map(|raw| distances(raw, path, line, &epochs, &targets));
        let distances = distances.transpose()?.unwrap_or_default();
        let edits = raw.edits.map(|edits| source.edits(edits, &epochs)).transpose()?;
        Ok(Self {
            path: path.to_path_buf(),
            name: raw.project.name.into_inner(),
            epochs: epochs.into(),
            settings,
            notes,
            edits,
            conditions,
            instruments,
            networks,
            distances,
            part: None,
        })
    }

    /// Name of the structure in a project file that need not be valid otherwise.
    pub fn name_in(path: &Path) -> Option<String> {
        let text = fs::read_to_string(path).ok()?;
        let table: toml::Table = toml::from_str(&text).ok()?;
        Some(table.get("project")?.get("name")?.as_str()?.to_owned())
    }
}

/// The project file itself, where a folder is given.
fn project_file(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join("stonewise.toml")
    } else {
        path.to_path_buf()
    }
}

/// What the project file holds.
fn project_text(path: &Path) -> Result<String> {
    if !path.exists() {
        return Err(Error::NoProject {
            path: path.to_path_buf(),
        });
    }
    read_parameters(path)
}

/// The text of a project file, to point into.
struct Source<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Source<'_> {
    /// The line of a place, counted from 1.
    fn line(&self, span: Range<usize>) -> usize {
        self.text.get(..span.start).unwrap_or("").matches('\n').count() + 1
    }

    fn error(&self, span: Range<usize>, message: impl Into<String>) -> Error {
        Error::in_text(self.path, self.text, span.start, message.into())
    }

    /// Where a value stands, or else the innermost table that is there. `path`: keys, and numbers in arrays.
    fn place(&self, path: &str) -> Range<usize> {
        Error::place_in_toml(self.text, path)
    }

    fn map_frame(&self, header: &RawHeader) -> Result<MapFrame> {
        if let Some(crs) = &header.crs {
            MapSystem::parse(crs.get_ref()).map_err(|reason| {
                let message = format!("crs: {reason}; give a WKT or a code such as \"EPSG:25832\"");
                self.error(crs.span(), message)
            })?;
        }
        let geoid = header.geoid.clone().map(|path| self.existing(path)).transpose()?;
        if let (Some(path), Some(place)) = (&geoid, &header.geoid) {
            Geoid::read(path).map_err(|error| self.error(place.span(), error.to_string()))?;
        }
        Ok(MapFrame {
            crs: header.crs.as_ref().map(|crs| crs.get_ref().clone()),
            false_origin: header.false_origin,
            geoid,
        })
    }

    /// `earlier`: the epochs before it.
    fn epoch(&self, raw: RawEpoch, map: &MapFrame, earlier: &[Epoch]) -> Result<Epoch> {
        if raw.clouds.get_ref().is_empty() {
            return Err(self.error(raw.clouds.span(), "an epoch needs one cloud at least"));
        }
        if raw.name.get_ref().trim().is_empty() {
            return Err(self.error(raw.name.span(), "an epoch needs a name"));
        }
        let clouds = raw.clouds.into_inner().into_iter().map(|c| self.existing(c));
        let clouds = clouds.collect::<Result<_>>()?;
        let photos = self.photos(raw.images, raw.cameras)?;
        if let (Some(masks), None) = (&raw.masks, &photos) {
            let message = "masks need the photos in which they were drawn: add `images` and `cameras` to this epoch, or remove \
                           `masks`";
            return Err(self.error(masks.span(), message));
        }
        Ok(Epoch {
            name: raw.name.into_inner(),
            date: raw.date.map(|d| d.into_inner().0.to_string()),
            conditions: raw.conditions,
            clouds,
            photos,
            photo_choice: raw.photos,
            masks: raw.masks.map(|m| self.existing(m)).transpose()?,
            motion: raw.motion,
            map: map.clone(),
            sources: raw.sources,
            same_survey_as: raw
                .same_survey_as
                .map(|name| self.earlier(&name, earlier))
                .transpose()?,
            origin: raw.origin,
            bundle: raw.bundle,
        })
    }

    /// The photos of an epoch, which need a camera file, and the other way round.
    fn photos(
        &self,
        images: Option<Spanned<PathBuf>>,
        cameras: Option<Spanned<PathBuf>>,
    ) -> Result<Option<PhotoFiles>> {
        match (images, cameras) {
            (Some(images), Some(cameras)) => Ok(Some(PhotoFiles {
                images: self.existing(images)?,
                cameras: self.existing(cameras)?,
            })),
            (None, None) => Ok(None),
            (Some(images), None) => Err(self.error(
                images.span(),
                "photos need their cameras: add `cameras = ...` to this epoch (Metashape XML, COLMAP folder or OpenSfM json), or \
                 remove `images` to have the stones found in views of the clouds",
            )),
            (None, Some(cameras)) => Err(self.error(
                cameras.span(),
                "cameras need their photos: add `images = ...` to this epoch, or remove `cameras` to have the stones found in views \
                 of the clouds",
            )),
        }
    }

    /// Moves the named epoch to the front; a note where that changes the numbers of epochs.
    fn put_reference_first(&self, name: &Spanned<String>, epochs: &mut [Epoch]) -> Result<Option<Said>> {
        let Some(at) = epochs.iter().position(|e| e.name == *name.get_ref()) else {
            let names: Vec<&str> = epochs.iter().map(|e| e.name.as_str()).collect();
            let message = format!("reference must name an epoch: {}", names.join(", "));
            return Err(self.error(name.span(), message));
        };
        for epoch in epochs.iter_mut() {
            epoch.same_survey_as = epoch.same_survey_as.map(|same| match same.index().cmp(&at) {
                Ordering::Less => EpochId::at(same.index() + 1),
                Ordering::Equal => EpochId::REFERENCE,
                Ordering::Greater => same,
            });
        }
        epochs[..=at].rotate_right(1);
        // An epoch names an earlier one; the reference now comes before that one.
        if let Some(same) = epochs[0].same_survey_as.take()
            && let Some(twin) = epochs.get_mut(same.index())
        {
            twin.same_survey_as = Some(EpochId::REFERENCE);
        }
        let note = || {
            let numbered = epochs.iter().zip(1..).map(|(e, n)| format!("{n} {}", e.name));
            let numbered: Vec<String> = numbered.collect();
            EPOCHS_NUMBERED.say(&[
                ("name", name.get_ref().as_str().into()),
                ("numbered", numbered.join(", ").into()),
            ])
        };
        Ok((at > 0).then(note))
    }

    /// The epoch of that name.
    fn earlier(&self, name: &Spanned<String>, earlier: &[Epoch]) -> Result<EpochId> {
        let found = earlier
            .iter()
            .position(|e| e.name == *name.get_ref())
            .map(EpochId::at);
        found.ok_or_else(|| {
            let names: Vec<&str> = earlier.iter().map(|e| e.name.as_str()).collect();
            let message = format!("same_survey_as must name an earlier epoch: {}", names.join(", "));
            self.error(name.span(), message)
        })
    }

    /// The detector's file, like all paths, is relative to the project file.
    fn segment(&self, mut params: SegmentParams) -> Result<SegmentParams> {
        if let Weights::File(file) = Weights::named(&params.model) {
            params.model = self.existing(Spanned::new(self.place("segment.model"), file))?;
        }
        Ok(params)
    }

    /// The edits by hand, whose file is read at once: a mistake in it is one of the project.
    fn edits(&self, raw: RawEdits, epochs: &[Epoch]) -> Result<EditsFile> {
        let edits = EditsFile::read(&self.existing(raw.file)?)?;
        let names: Vec<&str> = epochs.iter().map(|e| e.name.as_str()).collect();
        edits.check_epochs(&names)?;
        Ok(edits)
    }

    /// The readings, whose file is read at once: a mistake in it is one of the project.
    fn conditions(&self, raw: RawConditions) -> Result<ConditionsFile> {
        let days = self.not_negative(&raw.longest_gap_days, "conditions.longest_gap_days")?;
        ConditionsFile::read(&self.existing(raw.file)?, days)
    }

    /// Other instruments, whose files are likewise read at once.
    fn instruments(
        &self,
        raw: Vec<RawInstruments>,
        epochs: &[Epoch],
    ) -> Result<(Vec<InstrumentFile>, Vec<NetworkFile>)> {
        let (mut files, mut networks) = (Vec::new(), Vec::new());
        let names: Vec<&str> = epochs.iter().map(|e| e.name.as_str()).collect();
        for (k, raw) in raw.into_iter().enumerate() {
            let days = self.not_negative(&raw.longest_gap_days, "instruments.longest_gap_days")?;
            let reach_m = self.not_negative(&raw.reach_m, "instruments.reach_m")?;
            match (raw.file, raw.network, raw.epoch) {
                (Some(file), None, None) => {
                    let path = self.existing(file)?;
                    files.push(InstrumentFile::read(&path, raw.is_used, days, reach_m)?);
                }
                (None, Some(network), Some(epoch)) => {
                    let line = self.line(network.span());
                    let found = names.iter().position(|name| name == epoch.get_ref());
                    let epoch = found.map(EpochId::at).ok_or_else(|| {
                        let message = format!("epoch must name an epoch: {}", names.join(", "));
                        self.error(epoch.span(), message)
                    })?;
                    networks.push(NetworkFile {
                        epoch,
                        is_used: raw.is_used,
                        reach_m,
                        network: read_network(&self.existing(network)?).map_err(|e| Error::Project {
                            path: e.path,
                            line: e.line,
                            message: e.message,
                        })?,
                        stated: (self.path.to_path_buf(), line),
                    });
                }
                _ => {
                    let message = "a table of instruments needs `file`, or `network` with the `epoch` whose coordinates it has";
                    return Err(self.error(self.place(&format!("instruments.{k}")), message));
                }
            }
        }
        check_networks(&networks, &names)?;
        Ok((files, networks))
    }

    fn not_negative(&self, value: &Spanned<f64>, key: &str) -> Result<f64> {
        let number = *value.get_ref();
        match number.is_finite() && number >= 0.0 {
            true => Ok(number),
            false => Err(self.error(value.span(), format!("{key} must be a number, 0 or more"))),
        }
    }

    /// Logo and profile, like all paths, are relative to the project file.
    fn report(&self, mut params: ReportParams) -> Result<ReportParams> {
        if let Some(logo) = params.logo {
            let place = self.place("report.logo");
            let path = self.existing(Spanned::new(place.clone(), logo))?;
            if let Err(reason) = logo_type(&path) {
                return Err(self.error(place, format!("logo: {reason}")));
            }
            params.logo = Some(path);
        }
        if Profile::shipped(&params.profile).is_none() {
            let place = self.place("report.profile");
            let path = self.existing(Spanned::new(place.clone(), params.profile));
            let names = Profile::names();
            params.profile = path.map_err(|error| {
                let fix = format!("{error}; or name a profile of the program: {names}");
                self.error(place, fix)
            })?;
            Profile::read(&params.profile)?;
        }
        Ok(params)
    }

    /// What the reader of TOML says, with the fix where it is a usual slip.
    fn not_toml(&self, error: &toml::de::Error) -> Error {
        let span = error.span().unwrap_or(0..0);
        let message = Error::toml_message(error);
        let start = self
            .text
            .get(..span.start)
            .unwrap_or("")
            .rfind('\n')
            .map_or(0, |i| i + 1);
        let line = self.text.get(start..).unwrap_or("").lines().next().unwrap_or("");
        let fix = match line.split_once('=') {
            Some((key, value))
                if message.contains("expected a sequence") && value.trim().starts_with(['"', '\'']) =>
            {
                format!(": write it as a list: {} = [{}]", key.trim(), value.trim())
            }
            _ if message.contains("escape") => format!(": {SLASHES}"),
            _ => {
                let gone = GONE_KEYS.iter().find(|(unknown, _)| message.starts_with(unknown));
                gone.map_or(String::new(), |(_, fix)| format!(": {fix}"))
            }
        };
        self.error(span, message + &fix)
    }

    /// The path relative to the project file, which must exist.
    fn existing(&self, raw: Spanned<PathBuf>) -> Result<PathBuf> {
        if raw.get_ref().to_string_lossy().contains(char::is_control) {
            return Err(self.error(raw.span(), format!("a path with control characters: {SLASHES}")));
        }
        let path = as_stored(&self.path.parent().unwrap_or(Path::new("")).join(raw.get_ref()));
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

    /// Names of epochs stand in tables and layers: no two may be alike.
    fn check_names(&self, epochs: &[RawEpoch]) -> Result<()> {
        for (number, epoch) in epochs.iter().enumerate() {
            let name = epoch.name.get_ref().trim();
            if epochs[..number].iter().any(|e| e.name.get_ref().trim() == name) {
                let message =
                    format!("two epochs are named {name:?}: give each its own name, such as its date");
                return Err(self.error(epoch.name.span(), message));
            }
        }
        Ok(())
    }

    /// Epochs must be in time order, because motions count from the first one by default.
    fn check_dates(&self, epochs: &[RawEpoch]) -> Result<()> {
        let dated = epochs.iter().filter_map(|epoch| {
            let date = epoch.date.as_ref()?;
            Some((epoch, date.span(), date.get_ref().0.date?))
        });
        let dated: Vec<_> = dated.collect();
        for pair in dated.windows(2) {
            let [(earlier, _, before), (later, span, after)] = pair else {
                continue;
            };
            if after < before {
                let [first, second] = [earlier, later].map(|e| e.name.get_ref());
                let message = format!(
                    "epochs must be in time order, but {second:?} of {after} stands after {first:?} of {before}: change their \
                     order; if motions count from an epoch that is not the first, name it in `reference`"
                );
                return Err(self.error(span.clone(), message));
            }
        }
        Ok(())
    }
}

/// Adds to dated epochs the readings of their day that they do not state themselves; returns what is not known.
fn add_conditions(file: &ConditionsFile, epochs: &mut [Epoch]) -> Vec<Said> {
    let mut notes = Vec::new();
    for epoch in epochs {
        let Some(date) = &epoch.date else {
            let file = file.path.to_string_lossy();
            notes.push(EPOCH_WITHOUT_DATE.say(&[
                ("name", epoch.name.as_str().into()),
                ("file", file.as_ref().into()),
            ]));
            continue;
        };
        let found = file.at(date);
        for (name, value) in found.values {
            epoch.conditions.entry(name).or_insert(value);
        }
        let open = found
            .gaps
            .into_iter()
            .filter(|(name, _)| !epoch.conditions.contains_key(name));
        notes.extend(open.map(|(_, gap)| gap));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_come_from_the_file_and_the_epochs_own_win() {
        let dir = tempfile::tempdir().unwrap();
        for file in ["a.laz", "b.laz"] {
            fs::write(dir.path().join(file), "").unwrap();
        }
        fs::write(
            dir.path().join("levels.csv"),
            "date,level_m,air_c\n2025-04-01,10,5\n2025-04-03,12,\n",
        )
        .unwrap();
        let file = dir.path().join("stonewise.toml");
        let read = |table: &str| {
            let text = format!(
                "[project]\nname = \"wall\"\n[[epochs]]\nname = \"a\"\ndate = 2025-04-02\nclouds = [\"a.laz\"]\n\
                 [[epochs]]\nname = \"b\"\ndate = 2025-04-03\nconditions = {{ level_m = 99.0 }}\nclouds = [\"b.laz\"]\n{table}"
            );
            fs::write(&file, text).unwrap();
            Project::read(&file)
        };
        let project = read("[conditions]\nfile = \"levels.csv\"\n").unwrap();
        let level = |epoch: usize| project.epochs[EpochId::at(epoch)].conditions["level_m"];
        assert_eq!((level(0), level(1)), (11.0, 99.0));
        let gaps: Vec<bool> = project
            .notes
            .iter()
            .map(|n| n.english.contains("no air_c on 2025-04-0"))
            .collect();
        assert_eq!(gaps, [true, true]);
        assert!(project.inputs().iter().any(|path| path.ends_with("levels.csv")));
        for (table, message) in [
            (
                "[conditions]\nfile = \"none.csv\"\n",
                "stonewise.toml:13: no such file or folder",
            ),
            (
                "[conditions]\nfile = \"levels.csv\"\nlongest_gap_days = -1\n",
                "stonewise.toml:14: conditions.longest",
            ),
        ] {
            let found = read(table).unwrap_err().to_string();
            assert!(found.contains(message), "{found}");
        }
    }

    #[test]
    fn instruments_are_read_with_the_project() {
        let dir = tempfile::tempdir().unwrap();
        for file in ["a.laz", "b.laz"] {
            fs::write(dir.path().join(file), "").unwrap();
        }
        let targets = "name,x,y,z,date,dx,sd_x\nT1,1,2,3,2025-04-02,0,0.001\n";
        fs::write(dir.path().join("targets.csv"), targets).unwrap();
        fs::write(dir.path().join("wrong.csv"), "name,x,y,z,date\nT1,1,2,3,\n").unwrap();
        fs::write(dir.path().join("net.csv"), "name,x,y,z\nT1,1,2,3\n").unwrap();
        fs::write(dir.path().join("net.cov"), "1e-8\n0 1e-8\n0 0 1e-8\n").unwrap();
        let file = dir.path().join("stonewise.toml");
        let read = |tables: &str| {
            let text = format!(
                "[project]\nname = \"wall\"\n[[epochs]]\nname = \"a\"\nclouds = [\"a.laz\"]\n\
                 [[epochs]]\nname = \"b\"\nclouds = [\"b.laz\"]\n{tables}"
            );
            fs::write(&file, text).unwrap();
            Project::read(&file)
        };
        let table = "[[instruments]]\nfile = \"targets.csv\"\n";
        let project = read(&format!("{table}use = true\n{table}reach_m = 0\n")).unwrap();
        let used: Vec<bool> = project.instruments.iter().map(|f| f.is_used).collect();
        assert_eq!(used, [true, false]);
        assert_eq!(project.instruments[0].reach_m, 2.0);
        assert_eq!(
            project
                .inputs()
                .iter()
                .filter(|p| p.ends_with("targets.csv"))
                .count(),
            2
        );
        let network = "[[instruments]]\nnetwork = \"net.csv\"\nepoch =";
        let project = read(&format!("{table}{network} \"b\"\nuse = true\n{network} \"a\"\n")).unwrap();
        let epochs: Vec<(usize, bool)> = { project.networks.iter() }
            .map(|n| (n.epoch.index(), n.is_used))
            .collect();
        assert_eq!(epochs, [(1, true), (0, false)]);
        assert!(project.inputs().iter().any(|p| p.ends_with("net.cov")));
        for (tables, message) in [
            (
                "[[instruments]]\nfile = \"none.csv\"\n",
                "stonewise.toml:10: no such file",
            ),
            (
                "[[instruments]]\nfile = \"wrong.csv\"\n",
                "wrong.csv:1: nothing is measured",
            ),
            (
                "[[instruments]]\nuse = true\n",
                "stonewise.toml:9: a table of instruments needs `file`, or `network` with the `epoch`",
            ),
            (
                "[[instruments]]\nnetwork = \"net.csv\"\nepoch = \"c\"\n",
                "stonewise.toml:11: epoch must name an epoch: a, b",
            ),
            (
                "[[instruments]]\nnetwork = \"wrong.csv\"\nepoch = \"a\"\n",
                "wrong.cov:1: cannot be read",
            ),
            (
                "[[instruments]]\nnetwork = \"net.csv\"\nepoch = \"b\"\n",
                "stonewise.toml:10: motions count from the reference",
            ),
            (
                &*format!("{table}reach_m = -1\n"),
                "stonewise.toml:11: instruments.reach_m must be",
            ),
            (
                &*format!("{table}longest_gap_days = nan\n"),
                "stonewise.toml:11: instruments.longest_gap_days",
            ),
        ] {
            let found = read(tables).unwrap_err().to_string();
            assert!(found.contains(message), "{found}");
        }
    }

    fn with_reference(reference: &str, same: [Option<&str>; 3]) -> Result<Project> {
        let dir = tempfile::tempdir().unwrap();
        for file in ["cloud.laz", "cameras.xml"] {
            fs::write(dir.path().join(file), "").unwrap();
        }
        let mut text = format!("[project]\nname = \"wall\"\nreference = \"{reference}\"\n");
        for (name, same) in ["2024", "2025", "2026"].into_iter().zip(same) {
            text += &format!(
                "[[epochs]]\nname = \"{name}\"\nclouds = [\"cloud.laz\"]\nimages = \".\"\ncameras = \"cameras.xml\"\n"
            );
            text += &same.map_or(String::new(), |same| format!("same_survey_as = \"{same}\"\n"));
        }
        let file = dir.path().join("stonewise.toml");
        fs::write(&file, text).unwrap();
        Project::read(&file)
    }

    #[test]
    fn epochs_out_of_time_order_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        for file in ["cloud.laz", "cameras.xml"] {
            fs::write(dir.path().join(file), "").unwrap();
        }
        let file = dir.path().join("stonewise.toml");
        let read = |dates: [&str; 3]| {
            let mut text = "[project]\nname = \"wall\"\n".to_owned();
            for (name, date) in ["a", "b", "c"].into_iter().zip(dates) {
                text += &format!(
                    "[[epochs]]\nname = \"{name}\"\n{date}\nclouds = [\"cloud.laz\"]\nimages = \".\"\ncameras = \"cameras.xml\"\n"
                );
            }
            fs::write(&file, text).unwrap();
            Project::read(&file).map_err(|e| e.to_string())
        };
        for sound in [
            [
                "date = 2024-05-01",
                "date = 2024-05-01",
                "date = 2025-01-01T08:00:00",
            ],
            ["", "date = 2024-05-01", ""],
            ["date = \"2024-05-01\"", "date = 2024-05-02", ""],
        ] {
            assert!(read(sound).is_ok(), "{sound:?}");
        }
        let message = read(["date = 2025-05-01", "", "date = 2024-11-30"]).unwrap_err();
        assert!(
            message.contains("\"c\" of 2024-11-30 stands after \"a\" of 2025-05-01: change their order"),
            "{message}"
        );
        assert!(message.contains("stonewise.toml:17: "), "{message}");
        let message = read(["date = \"May 2024\"", "", ""]).unwrap_err();
        assert!(
            message.contains("stonewise.toml:5: \"May 2024\" is no date: write it as 2024-05-31"),
            "{message}"
        );
    }

    #[test]
    fn photos_and_cameras_are_optional_together_and_masks_need_them() {
        let dir = tempfile::tempdir().unwrap();
        for file in ["cloud.laz", "cameras.xml", "masks.json"] {
            fs::write(dir.path().join(file), "").unwrap();
        }
        let file = dir.path().join("stonewise.toml");
        let read = |first: &str| {
            let text = format!(
                "[project]\nname = \"wall\"\n[[epochs]]\nname = \"a\"\nclouds = [\"cloud.laz\"]\n{first}\n\
                 [[epochs]]\nname = \"b\"\nclouds = [\"cloud.laz\"]\n"
            );
            fs::write(&file, text).unwrap();
            Project::read(&file).map_err(|e| e.to_string())
        };
        let both = read("images = \".\"\ncameras = \"cameras.xml\"").unwrap();
        let has_photos: Vec<bool> = both.epochs.iter().map(|e| e.photos.is_some()).collect();
        assert_eq!(has_photos, [true, false]);
        // Photos are chosen where there are some without masks, unless all are wanted.
        let files = "images = \".\"\ncameras = \"cameras.xml\"\n";
        for (keys, chooses) in [
            ("", true),
            ("photos = \"auto\"", true),
            ("photos = \"all\"", false),
            ("masks = \"masks.json\"", false),
        ] {
            let project = read(&format!("{files}{keys}")).unwrap();
            let found: Vec<bool> = project.epochs.ids().map(|e| project.chooses_photos(e)).collect();
            assert_eq!(found, [chooses, false], "{keys}");
        }
        let message = read(&format!("{files}photos = \"few\"")).unwrap_err();
        assert!(message.contains("stonewise.toml:8: "), "{message}");
        let without = &both.epochs.iter().last().unwrap();
        assert!(without.read_cameras().unwrap().views.is_empty());
        for (keys, fix) in [
            ("images = \".\"", "add `cameras = ...`"),
            ("cameras = \"cameras.xml\"", "add `images = ...`"),
            ("masks = \"masks.json\"", "add `images` and `cameras`"),
        ] {
            let message = read(keys).unwrap_err();
            assert!(
                message.contains("stonewise.toml:6: ") && message.contains(fix),
                "{message}"
            );
        }
    }

    #[test]
    fn the_reference_comes_first_and_parts_of_a_survey_stay_together() {
        let order = |project: &Project| {
            let one = |e: &Epoch| {
                (
                    e.name.clone(),
                    e.same_survey_as.map(|i| project.epochs[i].name.clone()),
                )
            };
            project.epochs.iter().map(one).collect::<Vec<_>>()
        };
        let entry = |name: &str, same: Option<&str>| (name.to_owned(), same.map(str::to_owned));
        let project = with_reference("2025", [None, Some("2024"), Some("2024")]).unwrap();
        assert_eq!(
            order(&project),
            [
                entry("2025", None),
                entry("2024", Some("2025")),
                entry("2026", Some("2024"))
            ]
        );
        assert!(
            project.notes[0].english.contains("1 2025, 2 2024, 3 2026"),
            "{:?}",
            project.notes
        );
        let unchanged = with_reference("2024", [None, None, Some("2025")]).unwrap();
        assert_eq!(
            order(&unchanged),
            [
                entry("2024", None),
                entry("2025", None),
                entry("2026", Some("2025"))
            ]
        );
        assert!(unchanged.notes.is_empty());
        let error = with_reference("2023", [None; 3]).unwrap_err().to_string();
        assert!(
            error.contains("stonewise.toml:3") && error.contains("2024, 2025, 2026"),
            "{error}"
        );
    }
}
