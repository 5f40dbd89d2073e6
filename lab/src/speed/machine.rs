//! What one core of this machine can do at most while all are busy, in memory and in arithmetic; the steps of a
//! run are compared with it in docs/src/performance.md.
//!
//! `cargo run --release -p stonewise-lab -- machine`

use crate::Outcome;
use crate::figures::{median, processor_seconds};
use crate::table::Table;
use crate::words::Words;
use pulp::{Arch, Simd, WithSimd};
use std::hint::black_box;

/// Repetitions, whose median counts.
const ROUNDS: usize = 5;
/// Entries of the table that is copied and searched: far more bytes than a cache holds.
const ENTRIES: usize = 1 << 26;
/// Parts of the table that are copied into one target.
const PARTS: usize = 4;
/// Look-ups, and rounds of arithmetic.
const STEPS: usize = 1 << 22;
/// Numbers that are computed side by side, so that no operation waits for the one before.
const NUMBERS: usize = 48;

pub fn run(_: &Words) -> Outcome {
    let table = Table::begin(["one core, all busy", "a second"]);
    let row = |what: &str, scale: f64, unit: &str, rate: f64| {
        table.row([what.to_owned(), format!("{:.1} {unit}", rate / scale)]);
    };

    // A full period of a linear congruential generator visits every entry once (Knuth 1997, 3.2.1.2).
    let next: Vec<u32> = (0..ENTRIES as u64)
        .map(|i| ((i * 1_664_525 + 1_013_904_223) % ENTRIES as u64) as u32)
        .collect();
    let copy = |_| {
        let mut to = vec![0u32; ENTRIES / PARTS];
        for part in next.chunks_exact(to.len()).cycle().take(4 * PARTS) {
            to.copy_from_slice(part);
            black_box(&mut to);
        }
    };
    let bytes = (2 * 4 * size_of::<u32>() * ENTRIES) as f64;
    row("bytes copied: read and written", 1e9, "GB", rate(bytes, copy));
    // Threads follow different parts of the path.
    let follow = |thread: usize| {
        let at = (0..STEPS).fold(thread * 1_000_003 % ENTRIES, |at, _| next[at] as usize);
        black_box(at);
    };
    row(
        "look-ups, one after the other",
        1e6,
        "million",
        rate(STEPS as f64, follow),
    );
    let operations = (STEPS * NUMBERS) as f64;
    let multiply = |_| {
        black_box(Arch::new().dispatch(MultiplyAdd));
    };
    row(
        "multiplications and additions, f64",
        1e9,
        "billion",
        rate(2.0 * operations, multiply),
    );
    let divide = |_| {
        black_box(Arch::new().dispatch(Divide));
    };
    row("divisions, f64", 1e9, "billion", rate(operations, divide));
    Ok(())
}

/// Median rate of some units of work, done by every thread at once, per processor second.
fn rate(units: f64, work: impl Fn(usize) + Sync) -> f64 {
    let rates = (0..ROUNDS).map(|_| {
        let before = processor_seconds();
        let threads = rayon::broadcast(|thread| work(thread.index())).len();
        units * threads as f64 / (processor_seconds() - before)
    });
    median(rates)
}

struct MultiplyAdd;

impl WithSimd for MultiplyAdd {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let (factor, term) = black_box((0.999, 0.001));
        let mut numbers = [0.5; NUMBERS];
        for _ in 0..STEPS {
            numbers.iter_mut().for_each(|x| *x = *x * factor + term);
        }
        numbers.iter().sum()
    }
}

struct Divide;

impl WithSimd for Divide {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let dividend = black_box(1.1);
        let mut numbers = [0.5; NUMBERS];
        for _ in 0..STEPS {
            numbers.iter_mut().for_each(|x| *x = dividend / *x);
        }
        numbers.iter().sum()
    }
}
