//! Other instruments beside the stones around them.

use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::graph::{Need, Run, Step};
use crate::pipeline::steps::instruments::note_instruments;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::names::INSTRUMENTS as FILE;
use crate::results::records::{INSTRUMENTS_VERSION, InstrumentsRecord};

/// Writes `instruments.json` where the project names instruments.
pub static INSTRUMENTS: Step = Step {
    name: "instruments",
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until >= Until::Registered,
    applies: |project, _| project.instrument_files().next().is_some(),
    make: |run, _| write_instruments(run),
    ..Step::PLAIN
};

fn write_instruments(run: &Run) -> Result<()> {
    let context = run.context;
    let mut epochs = Vec::new();
    for later in context.project.epochs.later_ids() {
        if let Some(found) = &run.measured(later)?.instruments {
            note_instruments(context, found);
            epochs.push(found.clone());
        }
    }
    let record = InstrumentsRecord {
        version: INSTRUMENTS_VERSION,
        epochs,
    };
    write_readable_json(&context.out.join(FILE), &record)
}
