//! A run as units of work that any number of processes on any number of machines do.
//!
//! `plan` says which units there are and what each needs; `unit` does one. A unit is a step of the run, or one
//! photo of it, so that a run on one machine does the same work and leaves the same files. What is done is
//! noted in the results folder and nowhere else.

mod inputs;
mod list;
mod plan;
mod receipt;
mod unit;

pub use list::Unit;
pub use plan::{Coordinator, Plan, plan};
pub(super) use receipt::forget;
pub use unit::{UnitDone, do_unit};
