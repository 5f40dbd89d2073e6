//! The steps of the method, with their files, and the run that strings them together.
//!
//! `graph` says what a step declares, `list` names all of them: `steps` compute, `outputs` write what a user
//! opens. `run` walks over them, `agenda` announces them, and `units` shares them out among processes.

mod agenda;
mod clock;
mod clouds_only;
mod context;
mod cost;
mod doubts;
mod graph;
mod list;
mod outputs;
mod run;
mod steps;
mod units;
mod until;

pub use clouds_only::{Comparison, compare_clouds, tile_clouds};
pub(crate) use context::Context;
pub use context::PROJECT_STEP;
pub(crate) use graph::Run;
pub(crate) use outputs::verdict::verdict_of_tables;
pub use run::{PairSummary, Summary, run};
pub(crate) use run::{first_stones, run_in};
pub(crate) use steps::label::Labelled;
pub(crate) use steps::segment::Segmented;
pub(crate) use steps::stone_outlines::stone_outlines;
pub use units::{Coordinator, Plan, Unit, UnitDone, do_unit, plan};
pub use until::Until;
