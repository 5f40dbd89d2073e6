//! The limit on a program's address space (`ulimit -v`). A program that meets it ends in the middle of its
//! work and names neither the reason nor the fix, so it is compared with the need before the work.

use crate::error::{Error, Result};
use std::fs;

/// Program and libraries as they are mapped: 54 MB in a release build, the detector's weights among them.
const PROGRAM: u64 = 64 << 20;
/// What a thread reserves: 64 MB by the allocator of glibc, 2 MB for its stack.
const PER_THREAD: u64 = 66 << 20;
/// Threads that do not compute: the first one, and the one that waits for signals.
const OTHER_THREADS: u64 = 2;
const GIB: f64 = (1u64 << 30) as f64;

/// Address space that the search for stones takes beyond the program and its threads, which is more than the
/// memory it uses: 0.40 GB with one thread, 0.51 with two, 0.97 with four (docs/src/performance.md), rounded
/// up, and 0.16 GB for the weights transformed for use.
const DETECTOR_BASE: u64 = 400 << 20;
const DETECTOR_PER_THREAD: u64 = 190 << 20;

/// Memory that can be used under the limit, bytes; `None` without a limit, or where it is not known.
pub fn room() -> Option<u64> {
    Some(limit()?.saturating_sub(reserved(rayon::current_num_threads())))
}

/// Compares the limit with what the program takes before it holds any data. To be called before the threads
/// are started: a thread that cannot be started is an error of its own, but memory that runs out at that time
/// aborts the program. `threads`: how many are to be started.
///
/// # Errors
/// The limit is too low.
pub fn require_start(threads: usize) -> Result<()> {
    match limit() {
        Some(limit) => compare(
            limit,
            reserved(threads),
            &format!("stonewise with --threads {threads}"),
        ),
        None => Ok(()),
    }
}

/// Compares the limit with the memory that some work takes, bytes; `what`: the work, as subject of the
/// message.
///
/// # Errors
/// The limit is too low.
pub fn require(memory: u64, what: &str) -> Result<()> {
    match limit() {
        Some(limit) => compare(
            limit,
            memory.saturating_add(reserved(rayon::current_num_threads())),
            what,
        ),
        None => Ok(()),
    }
}

/// Memory that the search for stones takes with the threads of now, bytes.
pub fn detector_memory() -> u64 {
    DETECTOR_BASE + DETECTOR_PER_THREAD * rayon::current_num_threads() as u64
}

fn compare(limit: u64, needed: u64, what: &str) -> Result<()> {
    if needed <= limit {
        return Ok(());
    }
    Err(Error::AddressSpace {
        what: what.to_owned(),
        needed_gb: needed as f64 / GIB,
        limit_gb: limit as f64 / GIB,
    })
}

fn reserved(threads: usize) -> u64 {
    PROGRAM + PER_THREAD * (threads as u64 + OTHER_THREADS)
}

/// The limit in force, bytes; `None` without one, or where it is not known.
fn limit() -> Option<u64> {
    limit_in(&fs::read_to_string("/proc/self/limits").ok()?)
}

/// The limit in the text of `/proc/self/limits`: the first number of its line.
fn limit_in(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|l| l.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_read_and_none_is_none() {
        let text = |limit: &str| {
            format!(
                "Max locked memory 65536 65536 bytes\nMax address space         {limit}  unlimited  bytes\n"
            )
        };
        assert_eq!(limit_in(&text("614400000")), Some(614_400_000));
        assert_eq!(limit_in(&text("unlimited")), None);
        assert_eq!(limit_in(""), None);
    }
}
