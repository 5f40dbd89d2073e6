//! Where training images come from.

use crate::Sample;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::Scope;

/// An endless supply of images, each identified by its number.
pub trait SampleSource: Sync {
    /// The image of this number: the same at every call, so that a training that was interrupted
    /// goes on as if it had not been.
    ///
    /// # Errors
    /// Why there is none.
    fn sample(&self, number: u64) -> Result<Sample, String>;
}

impl<F: Fn(u64) -> Result<Sample, String> + Sync> SampleSource for F {
    fn sample(&self, number: u64) -> Result<Sample, String> {
        self(number)
    }
}

/// Makes images ahead of time in threads of its own, and hands them out in order.
pub struct Prefetch {
    workers: Vec<Receiver<Result<Sample, String>>>,
    next: usize,
}

impl Prefetch {
    /// Starts `threads` workers at image `first`; each keeps up to `ahead` images ready. They end when this
    /// is dropped.
    pub fn start<'scope, 'env>(
        scope: &'scope Scope<'scope, 'env>,
        source: &'env dyn SampleSource,
        first: u64,
        threads: usize,
        ahead: usize,
    ) -> Self {
        let threads = threads.max(1);
        let worker = |index: usize| {
            let (sender, receiver) = sync_channel(ahead.max(1));
            let numbers = (first + index as u64..).step_by(threads);
            scope.spawn(move || supply(source, numbers, &sender));
            receiver
        };
        Self {
            workers: (0..threads).map(worker).collect(),
            next: 0,
        }
    }

    /// The next image; waits for it if need be.
    ///
    /// # Errors
    /// What the source says.
    pub fn take(&mut self) -> Result<Sample, String> {
        let sample = self.workers[self.next].recv();
        self.next = (self.next + 1) % self.workers.len();
        sample.unwrap_or_else(|_| Err("the thread that makes training images has ended".to_owned()))
    }
}

fn supply(
    source: &dyn SampleSource,
    numbers: impl Iterator<Item = u64>,
    sender: &SyncSender<Result<Sample, String>>,
) {
    for number in numbers {
        if sender.send(source.sample(number)).is_err() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::raster::Raster;

    #[test]
    fn images_come_in_order_for_any_number_of_threads() {
        let source = |number: u64| {
            let size = number as u32 + 1;
            let sample = Sample::new(
                Raster::filled(size, 1, [0; 3]),
                Raster::filled(size, 1, 0),
                Raster::filled(size, 1, false),
            );
            sample.map_err(|e| e.to_string())
        };
        for threads in [1, 3] {
            let numbers: Vec<u32> = std::thread::scope(|scope| {
                let mut feed = Prefetch::start(scope, &source, 5, threads, 2);
                (0..7).map(|_| feed.take().unwrap().image().width() - 1).collect()
            });
            assert_eq!(numbers, [5, 6, 7, 8, 9, 10, 11]);
        }
    }
}
