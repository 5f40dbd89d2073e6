//! Time and memory of the model in time, on made-up tables: what pairs of epochs show of the stones of a wall.
//!
//! `cargo run --release -p stonewise-lab -- series-time [stones=10000] [epochs=3,6,12,24]`. Processor seconds of the
//! common frame of all epochs and of the model with its answers, and the most memory of the program so far.

use crate::Outcome;
use crate::figures::{peak_memory_mb, processor_seconds};
use crate::table::Table;
use crate::words::Words;
use nalgebra::{Matrix3, Point3, Vector3};
use stonewise_core::id::StoneId;
use stonewise_core::series::{PairLook, SeriesEpoch, SeriesPlace, StoneSeries, analyse, keep_congruent};
use stonewise_core::statistics::{normal_pair, split_mix};

/// Standard deviation of a deformation, metres.
const SD_M: f64 = 1e-4;

pub fn run(words: &Words) -> Outcome {
    let stones: u32 = words.number("stones=").unwrap_or(10_000);
    let table = Table::begin([
        "stones",
        "epochs",
        "frame s",
        "model s",
        "s a stone and epoch",
        "memory",
    ]);

    for epochs in words.list("epochs=", "3,6,12,24") {
        let count: usize = epochs.parse()?;
        let mut places: Vec<SeriesPlace> = (0..stones).map(|i| place(i, count)).collect();
        let started = processor_seconds();
        keep_congruent(&mut places);
        let framed = processor_seconds();
        let series: Vec<StoneSeries> = (1..)
            .zip(&places)
            .map(|(id, place)| of_place(id, place))
            .collect();
        let epochs: Vec<SeriesEpoch> = (0..count).map(epoch).collect();
        let found = analyse(&epochs, &series, &[]);
        let ended = processor_seconds();
        assert_eq!(found.stones.len(), stones as usize);
        table.row(vec![
            stones.to_string(),
            count.to_string(),
            format!("{:.2}", framed - started),
            format!("{:.2}", ended - framed),
            format!("{:.1e}", (ended - started) / f64::from(stones) / count as f64),
            format!("{:.0} MB", peak_memory_mb()),
        ]);
    }

    Ok(())
}

/// Half-yearly epochs at changing levels.
fn epoch(k: usize) -> SeriesEpoch {
    let years = 2019.27 + 0.5 * k as f64;
    SeriesEpoch {
        name: k.to_string(),
        years: Some(years),
        of_year: years.rem_euclid(1.0),
        level: Some(300.0 + [0.0, 3.0, 1.0, 4.0, 2.5, 0.5, 3.5, 1.5][k % 8]),
        temperature: None,
    }
}

/// A stone of a wall of courses of a hundred; every tenth creeps by 1 mm a year.
fn place(stone: u32, epochs: usize) -> SeriesPlace {
    let normal = |k: usize| {
        let uniform =
            |salt: u64| split_mix((u64::from(stone) << 20) + 4 * k as u64 + salt) as f64 / u64::MAX as f64;
        normal_pair([uniform(0), uniform(1)])
    };
    let deformation = |k: usize| {
        let ([x, y], [z, _]) = (normal(2 * k), normal(2 * k + 1));
        let creep = if stone.is_multiple_of(10) {
            5e-4 * k as f64
        } else {
            0.0
        };
        let moved = Vector3::new(creep, 0.0, 0.0);
        (k > 0).then(|| {
            (
                moved + SD_M * Vector3::new(x, y, z),
                Matrix3::identity() * (SD_M * SD_M),
            )
        })
    };
    SeriesPlace {
        place: Point3::new(0.0, 0.4 * f64::from(stone % 100), 0.25 * f64::from(stone / 100)),
        deformations: (0..epochs).map(deformation).collect(),
    }
}

fn of_place(id: u32, place: &SeriesPlace) -> StoneSeries {
    let look = |found: &Option<(Vector3<f64>, Matrix3<f64>)>| {
        let (value, covariance) = (*found)?;
        Some(PairLook {
            value,
            variance: covariance.diagonal(),
            reference_share: 0.5,
        })
    };
    let pairs: Vec<Option<PairLook>> = place.deformations.iter().map(look).collect();
    StoneSeries::of_pairs(StoneId(id), 0, &pairs)
}
