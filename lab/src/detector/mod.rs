//! Programs about the detector.

pub mod instances;
pub mod kept_walls;
pub mod overfit;
pub mod step_time;
pub mod training_crops;

use stonewise_segment::train::synth::SurveyKind;

/// The cloud that a word names.
fn survey_kind(word: &str) -> Option<SurveyKind> {
    match word {
        "none" => None,
        "terrestrial" => Some(SurveyKind::Terrestrial),
        "drone" => Some(SurveyKind::Drone),
        "stereo" => Some(SurveyKind::Stereo),
        other => panic!("{other}: none, terrestrial, drone or stereo"),
    }
}
