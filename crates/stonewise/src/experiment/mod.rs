//! Experiments: what becomes of the results under known motions, other parameters or another survey.
//!
//! Every variant is an ordinary run of a project. All runs of an experiment share a store of steps, so that
//! what variants have in common is done once, and an interrupted experiment goes on where it stopped.

mod baseline;
mod certify;
mod design;
mod halves;
mod inner_work;
mod known_motion;
mod paper;
mod predicted;
mod settings_with;
mod simulation;
mod survey_plan;
mod tables;
mod tune;

pub use baseline::Baseline;
pub use certify::{
    CalibratedSurvey, Calibration, CalibrationOptions, CalibrationRow, Certificate, CertifyOptions, Figure,
    calibrate, certify,
};
pub use design::{Design, design};
pub use paper::{PaperSurvey, PaperTables, paper};
pub use simulation::not_simulated;
pub use survey_plan::{
    PlanDesign, PlannedDrone, PlannedInstrument, PlannedPhotos, PlannedRegistration, PlannedStation,
    PlannedSurvey, PlannedTargets, SurveyPlan, Weakest, design_plan,
};
pub use tune::{Dimension, TuneOptions, Tuned, TunedPoint, default_grid, tune};
