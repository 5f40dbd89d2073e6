//! Progress of an experiment: one unit a run, whatever the runs themselves report.

use stonewise_core::progress::Progress;

/// Lets work be stopped, but says nothing.
pub(super) struct Quiet<'a>(pub &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn advance(&self, _: u64) {}

    fn note(&self, line: &str) {
        self.0.note(line);
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}
