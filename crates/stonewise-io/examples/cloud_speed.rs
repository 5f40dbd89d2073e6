//! Points per second of reading a cloud, and of writing labels back onto it.
//!
//! `cargo run --release -p stonewise-io --example cloud_speed -- CLOUD OUT.laz`

#![allow(clippy::print_stdout, reason = "a program for the command line")]

use std::path::Path;
use std::time::Instant;

use stonewise_core::id::StoneId;
use stonewise_io::cloud::{CloudError, LabelColumns, PointLabel, read_cloud, write_labelled};

fn main() -> Result<(), CloudError> {
    let mut arguments = std::env::args().skip(1);
    let (Some(cloud), Some(out)) = (arguments.next(), arguments.next()) else {
        println!("usage: cloud_speed CLOUD OUT.laz");
        return Ok(());
    };
    for chunk_points in [50_000, 400_000, 1_000_000] {
        let started = Instant::now();
        let summary = read_cloud(Path::new(&cloud), chunk_points, |_| Ok::<(), CloudError>(()))?;
        report(&format!("read by {chunk_points}"), summary.records, started);
    }
    let started = Instant::now();
    let columns = LabelColumns::StoneAndMotion;
    let summary = write_labelled(Path::new(&cloud), Path::new(&out), columns, |chunk| {
        let label = |index: &u64| PointLabel {
            stone: Some(StoneId((index / 6000) as u32)),
            motion: None,
            ..PointLabel::default()
        };
        Ok::<_, CloudError>(chunk.indices.iter().map(label).collect())
    })?;
    report("labelled copy", summary.records, started);
    Ok(())
}

fn report(what: &str, points: u64, started: Instant) {
    let seconds = started.elapsed().as_secs_f64();
    let rate = points as f64 / seconds / 1e6;
    println!("{what}: {points} points in {seconds:.2} s, {rate:.2} million/s");
}
