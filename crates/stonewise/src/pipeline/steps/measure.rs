//! The rows of the stones of a later epoch.

use super::instruments::{Before, InUse, compare};
use crate::error::Result;
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::outputs::outlines::OUTLINES;
use crate::pipeline::outputs::stone_rows::{motion_in_common, stone_rows};
use crate::pipeline::steps::register::{REGISTER, Registered, datum, since_reference};
use crate::pipeline::until::Until;
use crate::results::StoneRow;
use crate::results::records::{Datum, InstrumentsEpoch};
use nalgebra::Vector6;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;

/// Brings together what is known of every stone of a later epoch.
pub static MEASURE: Step = Step {
    name: "measure",
    about: About::Later,
    needs: &[Need::same(&REGISTER), Need::same(&OUTLINES)],
    wanted: |until| until >= Until::Registered,
    make: |run, epoch| run.measured(epoch).map(drop),
    ..Step::PLAIN
};

/// What was measured of a later epoch against the reference.
pub struct Measured {
    /// What is known about the registration of the epoch.
    pub datum: Datum,
    /// One row for each stone of the reference.
    pub rows: Vec<StoneRow>,
    /// Other instruments beside the stones; `None` where the project names none.
    pub instruments: Option<InstrumentsEpoch>,
    /// Those that are observations of the datum, where there are any.
    pub in_use: Option<InUse>,
    /// Whether errors that sources or stable areas show are taken off the motions.
    pub is_estimated: bool,
}

/// The rigid part of the registration error that sources or stable areas show; zero where they show none.
fn taken_off(datum: &Datum, registered: &Registered) -> Vector6<f64> {
    let errors = registered.epoch_errors.as_ref().filter(|_| datum.is_estimated());
    errors.map_or_else(Vector6::zeros, |e| e.rigid.error)
}

impl Run<'_> {
    /// What was measured of a later epoch.
    pub fn measured(&self, later: EpochId) -> Result<Arc<Measured>> {
        self.once(&MEASURE, later, || {
            let (labelled, registered) = (self.labelled_pair(later)?, self.registered(later)?);
            let first = &labelled.first;
            let datum = datum(
                self.context.project,
                since_reference(later),
                &registered,
                &first.stones,
            );
            let datum = datum.against(motion_in_common(first, &registered).as_ref());
            let labelled = labelled.each_ref().map(|l| &**l);
            let facade = &self.outlined()?.facade;
            let rows = stone_rows(labelled, &*self.matched(later)?, &registered, &datum, facade);
            let (mut datum, mut rows) = (datum, rows);
            let is_estimated = datum.is_estimated();
            let before = Before {
                taken_off: taken_off(&datum, &registered),
                datum: &mut datum,
                rows: &mut rows,
            };
            let normals = first.stones.iter().map(|s| (s.id, s.normal)).collect();
            let compared = compare(self.context.project, later, before, &normals)?;
            let (instruments, in_use) = compared.unzip();
            Ok(Measured {
                datum,
                rows,
                instruments,
                in_use: in_use.flatten(),
                is_estimated,
            })
        })
    }
}
