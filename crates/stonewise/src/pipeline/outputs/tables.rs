//! The tables of a later epoch.

use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::doubts::DOUBTS;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::outputs::evidence::write_tracked_stones;
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::results::names::PairFile;
use crate::results::records::{DeformationRecord, InfluenceRecord, ObserversRecord, RegistrationRecord};
use crate::results::{write_neighbours, write_stones};
use stonewise_core::epoch::EpochId;

/// Writes the stones of a later epoch and what is known about its registration.
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
    // The verdict reads it, and says what it rests on.
    write_registration(run, later, Vec::new())?;
    match registered.neighbours.is_empty() {
        true => Ok(()),
        false => write_neighbours(out, later.index(), &registered.neighbours),
    }
}

/// Writes what is known about the registration of a later epoch.
pub(super) fn write_registration(run: &Run, later: EpochId, influence: Vec<InfluenceRecord>) -> Result<()> {
    let (registered, measured) = (run.registered(later)?, run.measured(later)?);
    let record = RegistrationRecord {
        estimator: registered.estimator.clone(),
        datum: measured.datum.clone(),
        observers: registered.epoch_errors.as_ref().map(ObserversRecord::from),
        deformation: registered.deformation.as_ref().map(DeformationRecord::from),
        checks: run.check_records(later)?,
        influence,
    };
    let name = PairFile::Registration.place(later.index());
    write_readable_json(&run.context.out.join(name), &record)
}
