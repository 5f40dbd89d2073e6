//! The steps of the method, with their files, and the run that strings them together.
//!
//! `units` shares a run out among processes. `storage` keeps files between steps, `steps` are the steps, `outputs` writes what a user opens.

mod agenda;
mod clock;
mod clouds_only;
mod context;
mod doubts;
mod look;
mod matched_pairs;
mod outputs;
mod run;
mod sources;
mod steps;
pub(crate) mod storage;
mod units;
mod until;

pub use clouds_only::{Comparison, compare_clouds, tile_clouds};
pub(crate) use context::Context;
pub use matched_pairs::{MatchedPair, PairPlaces};
pub use run::{PairSummary, Summary, run};
pub(crate) use run::{first_stones, run_in};
pub use sources::SourceRule;
pub(crate) use steps::segment::segment;
pub(crate) use storage::step::Key;
pub use storage::step::set_program;
pub(crate) use storage::store::{Keeps, StepStore};
pub use units::{Coordinator, Plan, PlanOptions, Stage, Unit, UnitDone, do_unit, plan};
pub use until::Until;
