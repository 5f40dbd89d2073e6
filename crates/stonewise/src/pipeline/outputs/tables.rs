//! The tables of a later epoch.

use crate::error::Result;
use crate::pipeline::doubts::DOUBTS;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::outputs::evidence::write_tracked_stones;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::{write_neighbours, write_stones};
use stonewise_core::epoch::EpochId;

/// Writes the stones of a later epoch.
pub static TABLES: Step = Step {
    name: "tables",
    about: About::Later,
    needs: &[Need::same(&MEASURE), Need::same(&DOUBTS)],
    wanted: |until| until >= Until::Registered,
    make: write_tables,
    ..Step::PLAIN
};

fn write_tables(run: &Run, later: EpochId) -> Result<()> {
    let (context, out) = (run.context, &run.context.out);
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    write_stones(out, later.index(), &measured.rows)?;
    if run.until == Until::Reported {
        let first = run.labelled(EpochId::REFERENCE)?;
        write_tracked_stones(context, later, &first, &registered, &measured)?;
    }
    match registered.neighbours.is_empty() {
        true => Ok(()),
        false => write_neighbours(out, later.index(), &registered.neighbours),
    }
}
