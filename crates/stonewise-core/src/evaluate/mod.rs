//! How right results are, where the truth is known: a field that moved the points, or a simulated survey.
//!
//! No stage of the method uses this module. Errors are estimate minus truth, metres.

mod calibration;
mod definitions;
mod detection;
mod evaluation;
mod external_truth;
mod labels;
mod motion_field;
mod neighbours;
mod ranks;
mod rotations;
mod sample;
mod score;
mod statistics;

pub use calibration::{Calibration, Coverage};
pub use definitions::definitions;
pub use detection::{Detection, LooseDetection};
pub use evaluation::Evaluation;
pub use external_truth::{Owned, TrueStone, TruthScore, owned_by_nearest, score_against_truth};
pub use labels::{LabelConfusion, LabelScore};
pub use motion_field::{MotionField, MotionFieldError};
pub use neighbours::{NeighbourScore, score_neighbours};
pub use ranks::{RankTest, Ranks};
pub use rotations::{RotationAxes, RotationScore, RotationStatistics, score_rotations};
pub use sample::{EvaluationParams, MotionSample, RotationEstimate, StoneOutcome};
pub use score::{Directions, MotionScore, score_change, score_motions, score_stones};
pub use statistics::ErrorStatistics;
