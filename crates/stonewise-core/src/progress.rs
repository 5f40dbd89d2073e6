//! How long work reports its progress to its caller, and how the caller stops it.

use rayon::prelude::*;

/// Most items in memory at a time, however many threads the machine has.
const AHEAD: usize = 8;

/// Number of items worked on at a time: one per thread, at most eight.
pub(crate) fn ahead() -> usize {
    rayon::current_num_threads().min(AHEAD)
}

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

    /// Does a piece of work item by item, in two parts: `prepare` runs on as many items at a time as there are
    /// threads, eight at most, then `take` gets the results one by one, in order. Looks before each whether to
    /// stop, and advances after it. Memory: one prepared item per thread, at most eight.
    ///
    /// # Errors
    /// The work on an item failed (of several, the first in order), or the caller stopped it.
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
        for group in items.chunks(ahead()) {
            self.check()?;
            let prepared: Vec<Result<T, E>> = group.par_iter().map(|item| prepare(*item)).collect();
            for (item, prepared) in group.iter().zip(prepared) {
                self.check()?;
                take(*item, prepared?)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prepared_items_are_taken_in_order_and_the_first_error_ends_the_work() {
        let squares = |wrong: &'static [u64]| {
            let progress: &dyn Progress = &Silent;
            let mut taken = Vec::new();
            let square = |i: u64| match wrong.contains(&i) {
                true => Err(Failed::At(i)),
                false => Ok(i * i),
            };
            let result = progress.each_prepared("squares", 0..50, square, |i, square| {
                taken.push((i, square));
                Ok(())
            });
            (result, taken)
        };
        let all: Vec<(u64, u64)> = (0..50).map(|i| (i, i * i)).collect();
        stonewise_testing::on_threads(3, || {
            assert_eq!(squares(&[]), (Ok(()), all.clone()));
            assert_eq!(squares(&[20, 19]), (Err(Failed::At(19)), all[..19].to_vec()));
        });
    }

    #[derive(Debug, PartialEq)]
    enum Failed {
        At(u64),
        Stopped,
    }

    impl From<Interrupted> for Failed {
        fn from(_: Interrupted) -> Self {
            Self::Stopped
        }
    }
}
