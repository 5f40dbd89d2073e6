//! Everything that can stop a run.

use std::convert::Infallible;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Path, PathBuf};
use stonewise_core::change::CompareError;
use stonewise_core::progress::Interrupted;
use stonewise_core::registration::AdjustError;
use stonewise_core::transfer::TransferError;
use stonewise_segment::tiling::TilingError;
use toml::de::{DeTable, DeValue};

/// Why a run, or a step of it, could not be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The project file, or another file of parameters, does not parse or holds an impossible value.
    #[error("{path}:{line}: {message}", path = .path.display())]
    Project {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What is wrong, and the fix.
        message: String,
    },
    /// There is no project file.
    #[error(
        "{path}: no project file is there: name one, or the folder that holds stonewise.toml; `stonewise init {}` writes one",
        survey(.path).display(), path = .path.display()
    )]
    NoProject {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// Parameters that were given beside the project file cannot be.
    #[error("{0}")]
    Parameters(String),
    /// A file could not be read or written.
    #[error("{path}: {}", failed(.action, .cause), path = .path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error; part of the message, so not a `source`.
        cause: std::io::Error,
    },
    /// An input cannot be used.
    #[error("{path}: {message}", path = .path.display())]
    Input {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong, and the fix.
        message: String,
    },
    /// An output folder that must not be written into.
    #[error("{path}: {message}", path = .path.display())]
    Output {
        /// The folder, or the file in it.
        path: PathBuf,
        /// Why, and the fix.
        message: String,
    },
    /// Another process writes into the output folder.
    #[error("{path}: another run works in this folder; wait until it ends, or give another --out", path = .path.display())]
    Busy {
        /// The folder.
        path: PathBuf,
    },
    /// A unit of a plan whose inputs are not there yet.
    #[error("unit {unit} needs {}: do {} first", .first.join(", "), if .first.len() == 1 { "it" } else { "them" })]
    UnitFirst {
        /// The unit.
        unit: String,
        /// The units that come before it and are not done.
        first: Vec<String>,
    },
    /// There is no such unit, or no plan that holds for the inputs and the program of now.
    #[error("{path}: {message}", path = .path.display())]
    Plan {
        /// The plan or the input.
        path: PathBuf,
        /// What is wrong, and the fix.
        message: String,
    },
    /// Each input is valid, but together they are not.
    #[error("{0}")]
    Survey(String),
    /// The check of the survey found an error.
    #[error("{0}")]
    Check(String),
    /// The program may not take the address space that its work needs.
    #[error(
        "{what} takes about {needed_gb:.1} GB of address space, and only {limit_gb:.1} GB are allowed (`ulimit -v`): raise the limit, take \
         fewer threads (--threads), or try all the same with --force"
    )]
    AddressSpace {
        /// What needs it.
        what: String,
        /// How much, GiB.
        needed_gb: f64,
        /// How much the program may take, GiB.
        limit_gb: f64,
    },
    /// Two epochs have no stone in common.
    #[error(
        "no stone of epoch {:?} was found in epoch {:?} ({} and {} stones): do both show the same wall, in the same coordinates?",
        .epochs[0], .epochs[1], .stones[0], .stones[1]
    )]
    NoMatch {
        /// Names of the epochs.
        epochs: [String; 2],
        /// Number of their stones.
        stones: [usize; 2],
    },
    /// A point cloud could not be read or written.
    #[error(transparent)]
    Cloud(#[from] stonewise_io::cloud::CloudError),
    /// A table could not be read or written.
    #[error(transparent)]
    Table(#[from] stonewise_io::table::TableError),
    /// A camera file could not be read.
    #[error(transparent)]
    Cameras(#[from] stonewise_io::cameras::CameraError),
    /// Masks could not be read.
    #[error(transparent)]
    Masks(#[from] stonewise_io::masks::MaskError),
    /// The weights of the detector could not be read.
    #[error(transparent)]
    Weights(#[from] stonewise_segment::model::WeightsError),
    /// Labelled photos could not be used.
    #[error(transparent)]
    Labelled(#[from] stonewise_segment::dataset::DatasetError),
    /// The detector could not be trained.
    #[error(transparent)]
    Training(#[from] stonewise_segment::train::TrainError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] stonewise_io::image_io::ImageIoError),
    /// A simulated survey could not be made.
    #[error(transparent)]
    Simulate(Box<dyn std::error::Error + Send + Sync>),
    /// Labels could not be transferred to a cloud.
    #[error(transparent)]
    Transfer(TransferError),
    /// Stones could not be measured.
    #[error("{0}")]
    Registration(String),
    /// Clouds could not be compared.
    #[error(transparent)]
    Compare(CompareError),
    /// Layers could not be written.
    #[error(transparent)]
    Layers(#[from] stonewise_io::layers::LayerError),
    /// A result file does not hold what it should.
    #[error("{path}: {message}; create it again with `stonewise run`", path = .path.display())]
    Results {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The report cannot be printed.
    #[error("{0}")]
    Pdf(String),
    /// There is nothing to report on.
    #[error("{path}: no results here (no data/stones.parquet); give the folder that `stonewise run --out` wrote", path = .0.display())]
    NoResults(PathBuf),
    /// The folder holds results of a version that laid its files out otherwise.
    #[error(
        "{path}: these results are of an earlier version, which laid its files out otherwise: run again (`stonewise run PROJECT --out {path}`)",
        path = .0.display()
    )]
    OlderResults(PathBuf),
    /// The user stopped the run.
    #[error("interrupted; run the same command again to continue")]
    Interrupted,
}

impl From<Interrupted> for Error {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl From<TilingError<Infallible>> for Error {
    fn from(error: TilingError<Infallible>) -> Self {
        match error {
            TilingError::Interrupted(_) => Self::Interrupted,
            TilingError::Detector(never) => match never {},
        }
    }
}

impl From<TransferError> for Error {
    fn from(error: TransferError) -> Self {
        match error {
            TransferError::Interrupted(_) => Self::Interrupted,
            error => Self::Transfer(error),
        }
    }
}

impl From<CompareError> for Error {
    fn from(error: CompareError) -> Self {
        match error {
            CompareError::Interrupted(_) => Self::Interrupted,
            error => Self::Compare(error),
        }
    }
}

impl From<AdjustError<Error>> for Error {
    fn from(error: AdjustError<Error>) -> Self {
        match error {
            AdjustError::Interrupted(_) => Self::Interrupted,
            AdjustError::Source(error) => error,
            error => Self::Registration(error.to_string()),
        }
    }
}

impl Error {
    /// Whether the command was used wrongly: an invalid project or parameter file, invalid parameters, or an output
    /// folder that belongs to something else.
    pub fn is_wrong_usage(&self) -> bool {
        matches!(
            self,
            Self::Project { .. }
                | Self::NoProject { .. }
                | Self::Parameters(_)
                | Self::Output { .. }
                | Self::Plan { .. }
        )
    }

    /// Name under which `docs/src/messages.md` and `stonewise explain` say more of it.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Project { .. } => "project-file",
            Self::NoProject { .. } => "no-project",
            Self::Parameters(_) => "parameters",
            Self::Io { .. } => "file-access",
            Self::Input { .. } => "input",
            Self::Output { .. } => "output-folder",
            Self::Busy { .. } => "busy",
            Self::UnitFirst { .. } | Self::Plan { .. } => "plan",
            Self::Survey(_) => "survey",
            Self::Check(_) => "check-failed",
            Self::AddressSpace { .. } => "address-space",
            Self::NoMatch { .. } => "no-match",
            Self::Cloud(_) => "cloud-file",
            Self::Table(_) => "table-file",
            Self::Cameras(_) => "camera-file",
            Self::Masks(_) => "mask-file",
            Self::Weights(_) => "weights",
            Self::Labelled(_) => "labelled-photos",
            Self::Training(_) => "training",
            Self::Image(_) => "image-file",
            Self::Simulate(_) => "simulation",
            Self::Transfer(_) => "labels",
            Self::Registration(_) => "registration",
            Self::Compare(_) => "comparison",
            Self::Layers(_) => "layers",
            Self::Results { .. } => "damaged-results",
            Self::Pdf(_) => "pdf",
            Self::NoResults(_) => "no-results",
            Self::OlderResults(_) => "older-results",
            Self::Interrupted => "interrupted",
        }
    }

    /// Turns a system error into one that names the file.
    pub fn io<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(std::io::Error) -> Self + 'a {
        move |cause| Self::Io {
            action,
            path: path.to_path_buf(),
            cause,
        }
    }

    /// Turns an error of the TOML parser into an error of one line that names the file and the line in it.
    pub fn toml(path: &Path, text: &str, error: &toml::de::Error) -> Self {
        Self::in_text(
            path,
            text,
            error.span().map_or(0, |span| span.start),
            Self::toml_message(error),
        )
    }

    /// The message of the TOML parser in one line.
    pub fn toml_message(error: &toml::de::Error) -> String {
        error.message().trim().replace('\n', "; ")
    }

    /// Where a value stands in a TOML text, in bytes, or else the innermost table that is there. `key`: keys,
    /// and numbers in lists, between dots.
    pub fn place_in_toml(text: &str, key: &str) -> Range<usize> {
        let Ok(document) = DeTable::parse(text) else {
            return 0..0;
        };
        let root = DeValue::Table(document.into_inner());
        let (mut place, mut value) = (0..0, &root);
        for key in key.split('.') {
            let inner = match key.parse::<usize>() {
                Ok(number) => value.get(number),
                Err(_) => value.get(key),
            };
            let Some(inner) = inner else { break };
            (place, value) = (inner.span(), inner.get_ref());
        }
        place
    }

    /// What is wrong at a place of a file's text, counted in bytes.
    pub fn in_text(path: &Path, text: &str, place: usize, message: String) -> Self {
        Self::Project {
            path: path.to_path_buf(),
            line: text.get(..place).unwrap_or("").matches('\n').count() + 1,
            message,
        }
    }

    /// A result file that does not hold what it should.
    pub fn results(path: &Path, message: impl Into<String>) -> Self {
        Self::Results {
            path: path.to_path_buf(),
            message: message.into(),
        }
    }
}

/// What failed, and why; a missing file in plain words instead of the system's.
/// The folder of a project file, or that would hold one.
fn survey(path: &Path) -> &Path {
    let folder = match path.extension() {
        Some(_) => path.parent().unwrap_or(path),
        None => path,
    };
    match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    }
}

fn failed(action: &str, cause: &std::io::Error) -> String {
    match cause.kind() {
        ErrorKind::NotFound => format!("{action} failed: no such file or folder"),
        _ => format!("{action} failed: {cause}"),
    }
}

/// Result of everything in this crate.
pub type Result<T> = std::result::Result<T, Error>;
