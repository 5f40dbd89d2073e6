//! How long work tells its caller where it stands, and how the caller stops it.

/// The work was stopped by the caller before it was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Receiver of progress, and carrier of the wish to stop.
pub trait Progress: Sync {
    /// A piece of work of `total` units starts under this name.
    fn begin(&self, what: &str, total: u64);
    /// `units` more are done.
    fn advance(&self, units: u64);
    /// The steps of the work that begins now, in order, in words. What follows belongs to one of them, until
    /// the next list.
    fn agenda(&self, _steps: &[String]) {}
    /// Work on the step with this place in the list, counted from 0, begins or goes on; steps before it have
    /// ended.
    fn enter(&self, _step: usize) {}
    /// The step with this place in the list, or a part of it, was done earlier.
    fn take_over(&self, _step: usize) {}
    /// Which unit is worked on, such as "photo 3 of 14".
    fn detail(&self, _unit: &str) {}
    /// Something that a person should read now, in one line.
    fn note(&self, _line: &str) {}
    /// True once the work is to stop.
    fn is_cancelled(&self) -> bool;

    /// `Err(Interrupted)` once the work is to stop.
    ///
    /// # Errors
    /// The caller has cancelled the work.
    fn check(&self) -> Result<(), Interrupted> {
        if self.is_cancelled() {
            Err(Interrupted)
        } else {
            Ok(())
        }
    }
}

/// Reports nothing and never cancels.
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _what: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn is_cancelled(&self) -> bool {
        false
    }
}
