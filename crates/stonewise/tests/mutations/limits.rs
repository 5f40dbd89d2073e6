//! Time and memory that an input takes, as Linux counts them; elsewhere time alone.

use std::fs;
use std::time::{Duration, Instant};

/// Hundredths of a second are what `/proc` counts in, on every Linux in use.
const TICK: Duration = Duration::from_millis(10);

/// A moment, or what was spent since one.
pub struct Spent {
    started: Instant,
    /// Processor time of all threads.
    pub time: Duration,
    /// Bytes: at a moment what is resident, later the highest above that.
    pub memory: u64,
}

impl Spent {
    /// Now; the highest memory is counted anew.
    pub fn now() -> Self {
        let _ = fs::write("/proc/self/clear_refs", "5");
        Self {
            started: Instant::now(),
            time: processor_time().unwrap_or_default(),
            memory: status_bytes("VmRSS:").unwrap_or(0),
        }
    }

    pub fn since(start: &Self) -> Self {
        let started = Instant::now();
        let elapsed = started - start.started;
        // A look at the clock is cheap, and most inputs take no time at all.
        let time = if elapsed < TICK {
            elapsed
        } else {
            processor_time().map_or(elapsed, |now| now - start.time)
        };
        let highest = status_bytes("VmHWM:").unwrap_or(0);
        Self {
            started,
            time,
            memory: highest.saturating_sub(start.memory),
        }
    }
}

fn processor_time() -> Option<Duration> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    let after_name = stat.rsplit_once(')')?.1;
    let mut fields = after_name.split_whitespace().skip(11);
    let user: u32 = fields.next()?.parse().ok()?;
    let system: u32 = fields.next()?.parse().ok()?;
    Some(TICK * (user + system))
}

fn status_bytes(key: &str) -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib << 10)
}
