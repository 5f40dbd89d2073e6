//! What was decided about the stones of all epochs before they are measured.

use super::audit::write_audit;
use super::carried::write_carry_audit;
use super::edits::write_edits_audit;
use crate::pipeline::graph::{Need, Step};
use crate::pipeline::steps::carry::CARRY;
use crate::pipeline::steps::edit::EDIT;
use crate::pipeline::until::Until;

/// Writes the tables of decisions.
pub static AUDITS: Step = Step {
    name: "audits",
    needs: &[Need::all(&CARRY), Need::same(&EDIT)],
    wanted: |until| until >= Until::Labelled,
    make: |run, _| {
        let epochs = &run.context.project.epochs;
        let mut attempts = Vec::new();
        for epoch in epochs.ids() {
            attempts.extend(run.carried(epoch)?.attempts.iter().cloned());
        }
        write_carry_audit(run.context, &attempts)?;
        write_edits_audit(run.context, run.corrected()?.edited.as_ref())?;
        epochs.ids().try_for_each(|epoch| {
            write_audit(run.context, epoch, &*run.posed(epoch)?, &*run.labelled(epoch)?)
        })
    },
    ..Step::PLAIN
};
