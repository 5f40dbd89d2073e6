//! Points per second of reading a cloud, and of writing labels back onto it.
//!
//! `cargo run --release -p stonewise-lab -- clouds CLOUD OUT.laz`

use crate::Outcome;
use crate::words::Words;
use std::path::Path;
use std::time::Instant;
use stonewise_core::id::StoneId;
use stonewise_io::cloud::{CloudError, LabelColumns, PointLabel, read_cloud, write_labelled};

pub fn run(words: &Words) -> Outcome {
    let [cloud, out] = words.as_slice() else {
        return Err("usage: clouds CLOUD OUT.laz".into());
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
