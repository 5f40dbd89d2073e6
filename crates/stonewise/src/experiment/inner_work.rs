//! Progress of an experiment: each run is one unit, and the work inside it is the detail. Of several runs at a time,
//! the detail is what one of them began last.

use stonewise_core::progress::Progress;

/// Reports the work inside one unit of an experiment as its detail.
pub(super) struct InnerWork<'a>(pub &'a dyn Progress);

impl Progress for InnerWork<'_> {
    fn begin(&self, what: &str, _: u64) {
        self.0.detail(what);
    }

    fn advance(&self, _: u64) {}

    fn note(&self, line: &str) {
        self.0.note(line);
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}
