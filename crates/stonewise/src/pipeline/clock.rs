//! Wall time, processor time and memory of this process.

use crate::results::records::StepTime;
use std::fs;
use std::time::Instant;

/// Ticks of processor time in a second: fixed for programs on Linux (`USER_HZ`, proc(5)).
const TICKS_PER_SECOND: f64 = 100.0;

/// Times since a moment.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    wall: Instant,
    processor_seconds: Option<f64>,
}

impl Clock {
    /// Starts now.
    pub fn start() -> Self {
        Self {
            wall: Instant::now(),
            processor_seconds: processor_seconds(),
        }
    }

    /// What a step took that began with the clock; `resumed`: whether an earlier run did it.
    pub fn step_time(&self, step: &str, resumed: bool) -> StepTime {
        StepTime {
            step: step.to_owned(),
            seconds: self.wall_seconds(),
            processor_seconds: self.processor_seconds(),
            resumed,
            peak_memory_bytes: peak_memory_bytes(),
        }
    }

    /// Wall time since the start, seconds.
    fn wall_seconds(&self) -> f64 {
        self.wall.elapsed().as_secs_f64()
    }

    /// Processor time of all threads since the start, seconds, to a hundredth; `None` where the system does
    /// not report it.
    fn processor_seconds(&self) -> Option<f64> {
        Some(processor_seconds()? - self.processor_seconds?)
    }
}

/// Processor time of this process so far, user and system, where Linux reports it.
fn processor_seconds() -> Option<f64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    // Fields count from 1; the second is the name in brackets, which may hold spaces.
    let after_name = stat.rsplit_once(") ")?.1;
    let mut times = after_name.split(' ').skip(14 - 3).take(2).map(str::parse::<f64>);
    Some((times.next()?.ok()? + times.next()?.ok()?) / TICKS_PER_SECOND)
}

/// Highest resident memory of this process, where Linux reports it.
fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_busy_thread_takes_processor_time() {
        let clock = Clock::start();
        let mut sum = 0u64;
        while clock.wall_seconds() < 5.0 && clock.processor_seconds().unwrap() < 0.05 {
            sum = std::hint::black_box(sum + 1);
        }
        assert!(clock.processor_seconds().unwrap() >= 0.05);
        assert!(peak_memory_bytes().unwrap() > 1 << 20);
    }
}
