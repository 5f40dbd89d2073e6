//! Figures that several programs print.

use nalgebra::{Matrix3, Vector3};
use stonewise_core::statistics;

/// Half-width of a 95 % interval, standard deviations.
pub const Z95: f64 = 1.959_963_984_540_054;
/// 95 % quantile of chi-square with three degrees of freedom.
pub const CHI2_3_95: f64 = 7.814_727_903_251_179;

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

/// Coverage of the 95 % intervals of errors on an axis; `errors`: errors and their standard deviations.
pub fn coverage(errors: &[&[Vector3<f64>; 2]], axis: usize) -> String {
    let inside = errors.iter().filter(|[e, sd]| e[axis].abs() <= Z95 * sd[axis]);
    format!("{:.3}", inside.count() as f64 / errors.len().max(1) as f64)
}

/// Root mean squares of errors (`part` 0) or standard deviations (1) along, up and out, thousandths of their unit.
pub fn rms_of_axes(errors: &[&[Vector3<f64>; 2]], part: usize) -> String {
    let axis = |a: usize| format!("{:.3}", 1e3 * rms(errors.iter().map(|s| s[part][a])));
    [0, 1, 2].map(axis).join(" / ")
}

/// Square of a vector in units of its covariance; infinite where that has no inverse.
pub fn chi_square(v: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    covariance
        .cholesky()
        .map_or(f64::INFINITY, |c| v.dot(&c.solve(v)))
}

/// The most memory that this process had, as the system says it.
pub fn peak_memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status
        .lines()
        .find(|l| l.starts_with("VmHWM"))
        .unwrap_or_default();
    line.split_whitespace().skip(1).collect::<Vec<_>>().join(" ")
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
