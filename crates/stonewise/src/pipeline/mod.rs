//! The steps of the method, with their files, and the run that strings them together.
//!
//! `units` shares a run out among processes. `steps` are the steps, `outputs` writes what a user opens.

mod agenda;
mod clock;
mod clouds_only;
mod context;
mod doubts;
mod look;
mod outputs;
mod run;
mod steps;
mod units;
mod until;

pub use clouds_only::{Comparison, compare_clouds, tile_clouds};
pub(crate) use context::Context;
pub use run::{PairSummary, Summary, run};
pub(crate) use run::{first_stones, run_in};
pub(crate) use steps::segment::segment;
pub use units::{Coordinator, Plan, PlanOptions, Stage, Unit, UnitDone, do_unit, plan};
pub use until::Until;
