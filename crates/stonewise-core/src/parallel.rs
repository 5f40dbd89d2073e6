//! Pieces of work side by side.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Does independent pieces of work, as many at a time as rayon has threads, each on a thread of its own,
/// which may wait for others; results in order. The first error stops what has not begun.
///
/// # Errors
/// A piece of work failed; of several errors the first in order.
pub fn in_parallel<T: Send, E: Send>(
    count: usize,
    work: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<T, E>)>> = Mutex::default();
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

/// Does a piece of work, with whatever it would share out among rayon's threads, on a single one.
pub fn on_one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool.install(work),
        // Without another thread it takes those there are.
        Err(_) => work(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_work_keeps_its_order_and_stops_at_an_error() {
        let squares = in_parallel(50, |i| Ok::<_, &str>(i * i)).unwrap();
        assert!(squares.iter().enumerate().all(|(i, s)| *s == i * i) && squares.len() == 50);
        let begun = AtomicUsize::new(0);
        let failed = in_parallel(10_000, |i| {
            begun.fetch_add(1, Ordering::Relaxed);
            if i == 3 { Err("three") } else { Ok(i) }
        });
        assert_eq!(failed, Err("three"));
        assert!(begun.into_inner() < 10_000);
        assert!(in_parallel(0, Ok::<_, &str>).unwrap().is_empty());
    }

    #[test]
    fn work_on_one_thread_does_not_share() {
        let threads = || {
            let inside = on_one_thread(rayon::current_num_threads);
            (rayon::current_num_threads(), inside)
        };
        assert_eq!(stonewise_testing::on_threads(3, threads), (3, 1));
    }
}
