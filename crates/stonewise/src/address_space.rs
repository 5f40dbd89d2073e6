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

/// Memory that can be used under the limit, bytes; `None` without a limit, or where it is not known.
pub(crate) fn room() -> Option<u64> {
    let limit = limit_in(&fs::read_to_string("/proc/self/limits").ok()?)?;
    Some(limit.saturating_sub(reserved()))
}

/// Compares the limit with the memory that some work takes, bytes; `what`: the work, as subject of the
/// message.
///
/// # Errors
/// The limit is too low.
pub(crate) fn require(memory: u64, what: &str) -> Result<()> {
    match room() {
        Some(room) if room < memory => {
            let total = |memory: u64| (memory + reserved()) as f64 / GIB;
            Err(Error::AddressSpace {
                what: what.to_owned(),
                needed_gb: total(memory),
                limit_gb: total(room),
            })
        }
        _ => Ok(()),
    }
}

fn reserved() -> u64 {
    PROGRAM + PER_THREAD * (rayon::current_num_threads() as u64 + OTHER_THREADS)
}

/// The limit in force, in the text of `/proc/self/limits`: the first number of its line.
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
