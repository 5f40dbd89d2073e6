//! Processor time of the searches, comparisons and transfers that other programs do too.
//!
//! `cargo run --release -p stonewise-core --example measure_speed -- FOLDER`, with FOLDER as `bench/speed.py`
//! makes it. It reads the names of cases from standard input, one a line, runs each and answers `seconds
//! processor_seconds units`; `bench/speed.py` runs a case and the same work of another program in turn.
//!
//! Files of FOLDER are rows of three little-endian f64, metres: `first.f64` and `second.f64` (the clouds, a
//! wall that looks along -y), `core.f64` (core points of M3C2), `stones.f64` (centres of stones).

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod photos;
mod survey;

use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;
use survey::Survey;

/// Ticks of processor time in a second: fixed for programs on Linux (`USER_HZ`, proc(5)).
const TICKS_PER_SECOND: f64 = 100.0;

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "out/speed".to_owned());
    let survey = Survey::read(Path::new(&folder));
    for case in std::io::stdin().lock().lines() {
        let case = case.unwrap();
        let photos = (case == "label").then(|| photos::Photos::new(&survey));
        let (wall, processor) = (Instant::now(), processor_seconds());
        let (units, values) = match case.as_str() {
            "c2c" => survey.c2c(),
            "m3c2" => survey.m3c2(),
            "gicp" => survey.gicp(0.0),
            "gicp-voxel" => survey.gicp(0.01),
            "label" => photos.unwrap().label(),
            _ => (0, Vec::new()),
        };
        println!(
            "{} {:.2} {units}",
            wall.elapsed().as_secs_f64(),
            processor_seconds() - processor
        );
        std::io::stdout().flush().unwrap();
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(Path::new(&folder).join(format!("{case}.ours.f64")), bytes).unwrap();
    }
}

/// Processor time of all threads of this process so far; Linux only.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let after_name = stat.rsplit_once(") ").unwrap().1;
    let ticks: f64 = after_name
        .split(' ')
        .skip(14 - 3)
        .take(2)
        .map(|t| t.parse::<f64>().unwrap())
        .sum();
    ticks / TICKS_PER_SECOND
}
