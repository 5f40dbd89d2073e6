//! Figures that several programs print.

use nalgebra::{Matrix3, Vector3};
use stonewise_core::statistics;

/// Root mean square.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.into_iter().map(|v| v * v).collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// Median of the values that are numbers; NaN without any.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    statistics::median(&mut values).unwrap_or(f64::NAN)
}

/// Share of the numbers below `count` of which something holds; NaN where `count` is 0.
pub fn share(count: usize, holds: impl Fn(usize) -> bool) -> f64 {
    (0..count).filter(|&i| holds(i)).count() as f64 / count as f64
}

/// Square of a vector in units of its covariance; infinite where that has no inverse.
pub fn chi_square(v: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    covariance
        .cholesky()
        .map_or(f64::INFINITY, |c| v.dot(&c.solve(v)))
}

/// The most memory that this process had, megabytes; Linux only.
pub fn peak_memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM"));
    let kilobytes = line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok());
    kilobytes.unwrap_or(f64::NAN) / 1024.0
}

/// Lets the peak begin anew (proc(5), `clear_refs`); without effect where the system has no such file.
pub fn reset_peak_memory() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Processor time of all threads of this process so far, seconds; Linux only.
pub fn processor_seconds() -> f64 {
    /// Fixed for programs on Linux (`USER_HZ`, proc(5)).
    const TICKS_PER_SECOND: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let after_name = stat.rsplit_once(") ").unwrap().1;
    let ticks = after_name.split(' ').skip(14 - 3).take(2);
    ticks.map(|t| t.parse::<f64>().unwrap()).sum::<f64>() / TICKS_PER_SECOND
}
