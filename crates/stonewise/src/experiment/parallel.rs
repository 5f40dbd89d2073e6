//! Variants side by side.

use crate::error::Result;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Does independent pieces of work on threads of their own, which may wait for each other's steps; results in order.
/// The first error stops what has not begun.
pub(super) fn in_parallel<T: Send>(count: usize, work: impl Fn(usize) -> Result<T> + Sync) -> Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<T>)>> = Mutex::default();
    std::thread::scope(|scope| {
        for _ in 0..rayon::current_num_threads().min(count) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= count {
                        return;
                    }
                    let result = work(i);
                    if result.is_err() {
                        next.store(count, Ordering::Relaxed);
                    }
                    done.lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push((i, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn parallel_work_keeps_its_order_and_stops_at_an_error() {
        let squares = in_parallel(50, |i| Ok(i * i)).unwrap();
        assert!(squares.iter().enumerate().all(|(i, s)| *s == i * i) && squares.len() == 50);
        let begun = AtomicUsize::new(0);
        let failed = in_parallel(10_000, |i| {
            begun.fetch_add(1, Ordering::Relaxed);
            if i == 3 { Err(Error::Interrupted) } else { Ok(i) }
        });
        assert!(matches!(failed, Err(Error::Interrupted)));
        assert!(begun.into_inner() < 10_000);
        assert!(in_parallel(0, Ok).unwrap().is_empty());
    }
}
