//! Time and memory for large walls.

use super::{Case, Options, simulated};
use crate::figures::peak_memory;
use stonewise_core::progress::Silent;
use stonewise_core::registration::{MemoryPairs, adjust};

/// Stones of the simulated wall on a square metre.
const STONES_PER_M2: f64 = 17.5;
/// Width of the wall over its height, as of a dam.
const SHAPE: f64 = 7.0;

/// Time of the whole adjustment for about this many stones, and the most memory that the process had.
pub fn measure(sensor: &str, stones: usize, options: &Options) {
    let area_m2 = stones as f64 / STONES_PER_M2;
    let height_m = (area_m2 / SHAPE).sqrt();
    let large = Options {
        height_m,
        width_m: area_m2 / height_m,
        ..options.clone()
    };
    let pairs = simulated::build(Case::Bulge, sensor, 1, &large).pairs(options.border_noises);
    let count = pairs.len();
    let points: usize = pairs.iter().map(|p| p.points_first.len()).sum();
    let source = MemoryPairs::new(pairs);
    let before = peak_memory();
    let start = std::time::Instant::now();
    let report = adjust(&source, &options.params(), &Silent).unwrap();
    println!(
        "{count} stones of {} points an epoch, {sensor}: {:.0} s, {} iterations, converged {}, {} breaks, {} loose, peak memory {} (points {before})",
        points / count.max(1),
        start.elapsed().as_secs_f64(),
        report.iterations,
        report.converged,
        report.breaks.len(),
        report.loose,
        peak_memory()
    );
}
