//! A detector that learnt from corrections: it is offered until a person takes it or does without.
//!
//! Everything lies in the folder `detector` beside the project file: `training` with the checkpoints, `offer.json`, and
//! the detectors that were taken.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use stonewise::results::Facade;
use stonewise::{Error, OutputFolder, Project, Result, StoneChange, Taught, keep_detector, teach};
use stonewise_base::files::{create_results_folder, read_json, write_json};
use stonewise_core::progress::Progress;

/// The folder beside the project file.
const FOLDER: &str = "detector";
const TRAINING: &str = "training";
const OFFER: &str = "offer.json";
/// Longest training, minutes: a week.
const LONGEST_MINUTES: f64 = 7.0 * 24.0 * 60.0;
/// Digits of its content that name a detector.
const DIGITS: usize = 12;

/// `POST /teaching`: trains the detector on the corrections.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NewTeaching {
    /// Minutes of training in all; those of an interrupted call count.
    pub minutes: f64,
}

impl NewTeaching {
    /// Whether a training can last so long.
    ///
    /// # Errors
    /// It cannot.
    pub fn check(&self) -> Result<()> {
        match self.minutes > 0.0 && self.minutes <= LONGEST_MINUTES {
            true => Ok(()),
            false => Err(Error::Parameters(format!(
                "the minutes must lie above 0 and at {LONGEST_MINUTES} at most"
            ))),
        }
    }
}

/// `GET /teaching`, and the answer to what is decided about an offer.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TeachingShown {
    /// The trained detector that waits for a decision.
    pub offer: Option<Offer>,
}

/// A trained detector, its scores, and what it would change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Offer {
    /// The folder of its training.
    pub training: String,
    /// How long it was trained, minutes.
    pub minutes: f64,
    /// Steps of the training.
    pub steps: u64,
    /// Masks of corrected stones and masks that are none, counted in each photo.
    pub corrected: usize,
    /// Stones in the blocks kept apart.
    pub kept: usize,
    /// The detector that the project uses, on these blocks.
    pub before: ScoreShown,
    /// The trained detector.
    pub after: ScoreShown,
    /// 95 % interval of the change of F1; absent where too few blocks were kept.
    pub gain_interval: Option<[f64; 2]>,
    /// Whether the gain is more than chance.
    pub is_better: bool,
    /// The stones that it would change.
    pub changes: Vec<StoneChange>,
}

/// How well the masks of a detector agree with the stones of the cloud.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScoreShown {
    /// Share of what it found that is right; absent where it found nothing.
    pub precision: Option<f64>,
    /// Share of the stones that it found.
    pub recall: Option<f64>,
    /// Harmonic mean of both.
    pub f1: Option<f64>,
}

/// The folder of a survey's detectors.
pub fn folder_of(survey: &Path) -> PathBuf {
    survey.join(FOLDER)
}

/// The file of the offer.
pub fn offer_of(survey: &Path) -> PathBuf {
    folder_of(survey).join(OFFER)
}

/// What waits for a decision.
///
/// # Errors
/// The file of the offer is damaged.
pub fn shown(survey: &Path) -> Result<TeachingShown> {
    let path = offer_of(survey);
    let offer = match path.exists() {
        true => Some(read_json(&path)?),
        false => None,
    };
    Ok(TeachingShown { offer })
}

/// Trains and leaves an offer.
///
/// # Errors
/// As [`stonewise::teach`].
pub fn train(
    (project, survey): (&Project, &Path),
    minutes: f64,
    results: &OutputFolder,
    wall: &Facade,
    progress: &dyn Progress,
) -> Result<()> {
    create_results_folder(&folder_of(survey))?;
    let training = folder_of(survey).join(TRAINING);
    let taught = teach(project, minutes, (results, &training), wall, progress)?;
    write_json(&offer_of(survey), &offer(taught))
}

fn offer(taught: Taught) -> Offer {
    let Taught {
        adapted,
        model,
        changes,
    } = taught;
    let name = model.parent().and_then(Path::file_name).unwrap_or_default();
    let score = |[precision, recall, f1]: [Option<f64>; 3]| ScoreShown {
        precision,
        recall,
        f1,
    };
    let (before, after) = (&adapted.before, &adapted.after);
    Offer {
        training: name.to_string_lossy().into_owned(),
        minutes: adapted.minutes,
        steps: adapted.steps,
        corrected: adapted.corrected,
        kept: adapted.kept,
        before: score([before.precision, before.recall, before.f1]),
        after: score([after.precision, after.recall, after.f1]),
        gain_interval: adapted.gain_interval,
        is_better: adapted.is_better(),
        changes,
    }
}

/// Keeps the detector of the offer; its path as the project file names it.
///
/// # Errors
/// Nothing is offered, or the detector cannot be read or written.
pub fn accept(survey: &Path) -> Result<String> {
    let model = training_of(survey)?.join("model.safetensors");
    let bytes = fs::read(&model).map_err(Error::io("reading", &model))?;
    let digest = blake3::hash(&bytes).to_hex();
    let name = format!("taught-{}.safetensors", &digest[..DIGITS]);
    keep_detector(&model, &folder_of(survey).join(&name))?;
    Ok(format!("{FOLDER}/{name}"))
}

/// Takes the offer and its training away.
///
/// # Errors
/// Nothing is offered, or it cannot be removed.
pub fn close(survey: &Path) -> Result<()> {
    let (offer, training) = (offer_of(survey), training_of(survey)?);
    fs::remove_file(&offer).map_err(Error::io("removing", &offer))?;
    fs::remove_dir_all(&training).map_err(Error::io("removing", &training))
}

/// The folder of the training that is offered.
fn training_of(survey: &Path) -> Result<PathBuf> {
    let offer = shown(survey)?.offer;
    let name = offer.map(|o| o.training).unwrap_or_default();
    let is_key = !name.is_empty() && name.bytes().all(|b| b.is_ascii_hexdigit());
    match is_key {
        true => Ok(folder_of(survey).join(TRAINING).join(name)),
        false => Err(Error::Parameters("no detector is offered".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offered(training: &str) -> Offer {
        let score = ScoreShown {
            precision: None,
            recall: Some(0.5),
            f1: None,
        };
        Offer {
            training: training.to_owned(),
            minutes: 1.0,
            steps: 3,
            corrected: 2,
            kept: 4,
            before: score.clone(),
            after: score,
            gain_interval: None,
            is_better: false,
            changes: Vec::new(),
        }
    }

    #[test]
    fn an_offer_is_taken_whole_or_goes_and_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(shown(dir.path()).unwrap().offer, None);
        assert!(accept(dir.path()).is_err() && close(dir.path()).is_err());
        let training = folder_of(dir.path()).join(TRAINING).join("0123abcd");
        fs::create_dir_all(&training).unwrap();
        fs::write(training.join("model.safetensors"), "weights").unwrap();
        write_json(&offer_of(dir.path()), &offered("0123abcd")).unwrap();
        let taken = accept(dir.path()).unwrap();
        assert_eq!(fs::read_to_string(dir.path().join(&taken)).unwrap(), "weights");
        // Once more, because a kill came between this and the project file.
        assert_eq!(accept(dir.path()).unwrap(), taken);
        close(dir.path()).unwrap();
        assert!(dir.path().join(&taken).exists() && !training.exists());
        assert_eq!(shown(dir.path()).unwrap().offer, None);
    }

    #[test]
    fn an_offer_names_no_folder_elsewhere() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder_of(dir.path()).join(TRAINING)).unwrap();
        for name in ["", "..", "../..", "a/../..", "/etc"] {
            write_json(&offer_of(dir.path()), &offered(name)).unwrap();
            assert!(
                accept(dir.path()).is_err() && close(dir.path()).is_err(),
                "{name}"
            );
        }
        assert!(folder_of(dir.path()).exists());
    }
}
