//! How long work reports its progress to its caller, and how the caller stops it.

use rayon::prelude::*;

/// The work was stopped by the caller before it was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Receives progress, and says whether the work should stop.
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

impl dyn Progress + '_ {
    /// Does a piece of work item by item, in order: begins it under this name, looks before each item whether
    /// to stop, and advances after it.
    ///
    /// # Errors
    /// The work on an item failed, or the caller stopped it.
    pub fn each<I, E>(
        &self,
        what: &str,
        items: I,
        mut work: impl FnMut(I::Item) -> Result<(), E>,
    ) -> Result<(), E>
    where
        I: IntoIterator<IntoIter: ExactSizeIterator>,
        E: From<Interrupted>,
    {
        let items = items.into_iter();
        self.begin(what, items.len() as u64);
        for item in items {
            self.check()?;
            work(item)?;
            self.advance(1);
        }
        Ok(())
    }

    /// Does a piece of work item by item, in two parts: prepares as many items at a time as there are threads, then
    /// takes what was prepared one after the other, in order, as [`Self::each`] does. Memory: the prepared items.
    ///
    /// # Errors
    /// The work on an item failed, or the caller stopped it.
    pub fn each_prepared<I, T, E>(
        &self,
        what: &str,
        items: I,
        prepare: impl Fn(I::Item) -> Result<T, E> + Sync,
        mut take: impl FnMut(I::Item, T) -> Result<(), E>,
    ) -> Result<(), E>
    where
        I: IntoIterator<Item: Copy + Send + Sync>,
        T: Send,
        E: From<Interrupted> + Send,
    {
        let items: Vec<I::Item> = items.into_iter().collect();
        self.begin(what, items.len() as u64);
        for group in items.chunks(rayon::current_num_threads()) {
            self.check()?;
            let prepared = group.par_iter().map(|item| prepare(*item));
            for (item, prepared) in group.iter().zip(prepared.collect::<Result<Vec<T>, E>>()?) {
                self.check()?;
                take(*item, prepared)?;
                self.advance(1);
            }
        }
        Ok(())
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
