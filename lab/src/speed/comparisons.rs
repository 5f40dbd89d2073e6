//! Processor time of the searches, comparisons and decoding that other programs do too.
//!
//! `cargo run --release -p stonewise-lab -- comparisons FOLDER`, with FOLDER as `lab/speed.py` makes it. It
//! reads the names of cases from standard input, one a line, runs each and answers `seconds processor_seconds
//! units`; `lab/speed.py` runs a case and the same work of another program in turn.
//!
//! Files `*.f64` of FOLDER are rows of three little-endian f64, metres: `first.f64` and `second.f64` (the clouds,
//! a wall that looks along -y), `core.f64` (core points of M3C2), `stones.f64` (centres of stones). `first.laz`, the
//! first cloud, serves only the case `laz`.

use super::survey::Survey;
use crate::Outcome;
use crate::figures::processor_seconds;
use crate::words::Words;
use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;
use stonewise_io::cloud::{CloudError, read_cloud};

pub fn run(words: &Words) -> Outcome {
    let folder = Path::new(words.as_slice().first().ok_or("name the FOLDER of the data")?);
    let survey = Survey::read(folder);
    for case in std::io::stdin().lock().lines() {
        let case = case?;
        let (wall, processor) = (Instant::now(), processor_seconds());
        let (units, values) = match case.as_str() {
            "c2c" => survey.c2c(),
            "m3c2" => survey.m3c2(),
            "gicp" => survey.gicp(0.0),
            "gicp-voxel" => survey.gicp(0.01),
            "laz" => points_of_laz(folder)?,
            _ => (0, Vec::new()),
        };
        println!(
            "{} {:.2} {units}",
            wall.elapsed().as_secs_f64(),
            processor_seconds() - processor
        );
        std::io::stdout().flush()?;
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(folder.join(format!("{case}.ours.f64")), bytes)?;
    }
    Ok(())
}

/// Reads all points of the first cloud, and keeps none.
fn points_of_laz(folder: &Path) -> Result<(usize, Vec<f64>), CloudError> {
    let summary = read_cloud(&folder.join("first.laz"), 1 << 20, |_| Ok::<(), CloudError>(()))?;
    Ok((summary.records as usize, Vec::new()))
}
