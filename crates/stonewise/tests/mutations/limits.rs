//! Time and memory that inputs take, as Linux counts them; elsewhere wall time alone.

use std::fs;
use std::time::Duration;

/// Hundredths of a second are what `/proc` counts in, on every Linux in use.
const TICK: Duration = Duration::from_millis(10);

/// Processor time of all threads of this program so far.
pub fn processor_time() -> Option<Duration> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    let after_name = stat.rsplit_once(')')?.1;
    let mut fields = after_name.split_whitespace().skip(11);
    let user: u32 = fields.next()?.parse().ok()?;
    let system: u32 = fields.next()?.parse().ok()?;
    Some(TICK * (user + system))
}

/// Memory that work takes beyond what was resident when it began.
pub struct Memory {
    resident: u64,
}

impl Memory {
    /// Begins; the highest memory is counted anew.
    pub fn now() -> Self {
        let _ = fs::write("/proc/self/clear_refs", "5");
        Self {
            resident: status_bytes("VmRSS:").unwrap_or(0),
        }
    }

    /// Bytes, at most since the beginning.
    pub fn highest(&self) -> u64 {
        let highest = status_bytes("VmHWM:").unwrap_or(0);
        highest.saturating_sub(self.resident)
    }
}

fn status_bytes(key: &str) -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib << 10)
}
