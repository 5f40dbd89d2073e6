//! All results of the experiment.

use super::case::Case;
use super::detectors::MeasuredDetectors;
use super::options::{PaperOptions, PaperSurvey};
use crate::project::Project;

/// The runs, and where their stones come from.
#[derive(Default)]
pub(super) struct Outcome {
    pub cases: Vec<Case>,
    /// Figure 5, where there is a photo.
    pub example: Option<Example>,
    /// One for each survey.
    pub origins: Vec<MaskOrigin>,
    /// One for each set of labelled photos.
    pub detectors: Vec<MeasuredDetectors>,
}

/// A photo with the outlines of its stones, for the paper's figure 5.
pub(super) struct Example {
    pub photo: String,
    pub instances: usize,
    /// Where its stones come from, see [`MaskOrigin`].
    pub origin: String,
    pub jpeg: Vec<u8>,
}

/// Where the masks of a survey's stones come from.
#[derive(Clone, Debug)]
pub(super) struct MaskOrigin {
    pub survey: String,
    /// In words that complete "stones are ...".
    pub words: String,
}

impl MaskOrigin {
    /// `halves`: the halves of the survey, as they are measured.
    pub(super) fn of(survey: &PaperSurvey, halves: &Project, options: &PaperOptions) -> Self {
        let given = halves.epochs.first().and_then(|half| half.masks.as_ref());
        let words = match (given, options.train_minutes) {
            (Some(masks), _) => format!(
                "given as masks ({})",
                masks.file_name().unwrap_or_default().to_string_lossy()
            ),
            (None, Some(minutes)) if minutes > 0.0 => {
                "found by the detector that was trained on nine tenths of each labelled photo".to_owned()
            }
            _ => format!(
                "found by the {} detector",
                halves.settings.segment.model.display()
            ),
        };
        Self {
            survey: survey.name.clone(),
            words,
        }
    }
}
