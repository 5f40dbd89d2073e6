//! Time and memory for large walls: a simulated survey set side by side many times.

use crate::trial::Trial;
use crate::{Case, Options, simulated};
use nalgebra::Vector3;
use stonewise_core::cloud::Cloud;
use stonewise_core::id::StoneId;
use stonewise_core::progress::Silent;
use stonewise_core::registration::{PairPoints, PairSource, adjust};

/// Copies of a section, one beside and above the other, read copy by copy.
struct LongWall {
    pairs: Vec<PairPoints>,
    copies: usize,
}

impl PairSource for LongWall {
    type Error = std::convert::Infallible;

    fn batch_count(&self) -> usize {
        self.copies
    }

    fn load(&self, batch: usize) -> Result<Vec<PairPoints>, Self::Error> {
        let per_row = (self.copies as f64 * 4.0).sqrt().ceil() as usize;
        let shift = Vector3::new(
            0.0,
            4.0 * (batch % per_row) as f64,
            3.0 * (batch / per_row) as f64,
        );
        let moved = |c: &Cloud| Cloud::new(c.origin() + shift, c.offsets().to_vec());
        let copy = |p: &PairPoints| PairPoints {
            first: StoneId(p.first.0 + 1000 * batch as u32),
            second: StoneId(p.second.0 + 1000 * batch as u32),
            centroid: p.centroid + shift,
            centroid_second: p.centroid_second + shift,
            normal: p.normal,
            points_first: moved(&p.points_first),
            points_second: moved(&p.points_second),
        };
        Ok(self.pairs.iter().map(copy).collect())
    }
}

/// Time of the whole adjustment for about this many stones, and the most memory that the process had.
pub fn measure(sensor: &str, stones: usize, options: &Options) {
    let trial: Trial = simulated::build(Case::Bulge, sensor, 1, options);
    let pairs = trial.pairs(options.border_noises);
    let points: usize = pairs.iter().map(|p| p.points_first.len()).sum();
    let copies = stones.div_ceil(pairs.len());
    let count = copies * pairs.len();
    let mean_points = points / pairs.len();
    drop(trial);
    let start = std::time::Instant::now();
    let report = adjust(&LongWall { pairs, copies }, &options.network(), &Silent).unwrap();
    println!(
        "{count} stones of {mean_points} points an epoch, {sensor}: {:.0} s, {} iterations, converged {}, loose {}, peak memory {}",
        start.elapsed().as_secs_f64(),
        report.iterations,
        report.converged,
        report.loose,
        peak_memory().unwrap_or_default()
    );
}

fn peak_memory() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM"))?;
    Some(line.split_whitespace().skip(1).collect::<Vec<_>>().join(" "))
}
