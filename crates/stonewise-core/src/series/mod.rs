//! What the path of the wall over several epochs means: trend, level, temperature, season, steps.
//!
//! Every later epoch is measured against the reference, so that all differences share the reference's error. A
//! difference is therefore taken apart into two looks, one of each epoch, whose errors are independent (`look`). Over
//! the looks of all epochs a line in time and what conditions add to it are fitted to each stone (`fit`), with the
//! terms that epochs can carry (`terms`), a variance factor that stones lend each other (`moderated`), and the answers
//! to the four questions that a reading of a dam raises (`answers`; Lombardi 2001). Which epoch is the reference then does
//! not matter to velocities.

mod analyse;
mod answers;
mod basis;
mod congruent;
mod fit;
mod look;
mod moderated;
mod path;
mod steps;
mod stone_model;
mod terms;
#[cfg(test)]
mod tests;
mod zones;

pub use analyse::{SeriesFindings, StoneTrend, Trend, analyse};
pub use answers::{Answer, Departure, Extrapolation, SeriesAnswers, Unanswered, Word};
pub use basis::{Basis, SeriesEpoch, Term};
pub use congruent::{SeriesPlace, keep_congruent};
pub use look::{Look, PairLook, StoneSeries, covariance_between};
pub use moderated::VarianceFactor;
pub use path::Group;
pub use stone_model::{AxisModel, Estimate, Step, Wave};
pub use terms::{Inseparable, WhyInseparable};
