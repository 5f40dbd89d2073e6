//! Mutated inputs of every reader: an answer or an error that names the file, never a panic, within limits of
//! time and memory.
//!
//! The test is short and the same every time. For any number of inputs, from any seed:
//! `STONEWISE_MUTATIONS=1000000 STONEWISE_SEED=7 cargo test -p stonewise --test mutations -- --ignored
//! --nocapture`. Most of an input's time is spent on files, so a folder for temporary files that lies in
//! memory (`TMPDIR=/dev/shm`) makes it faster, and so does a single thread (`RAYON_NUM_THREADS=1`).
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a campaign stops at what it did not expect, and says how it goes"
)]

mod limits;
mod mutate;
mod random;
mod repair;
mod seeds;
mod targets;

use limits::{Memory, processor_time};
use random::Random;
use std::fs;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use targets::{Target, targets};

/// Processor time for one input, all threads.
const MOST_TIME: Duration = Duration::from_secs(2);
/// Memory that one input may take beyond what is there, bytes.
const MOST_MEMORY: u64 = 512 << 20;
/// Inputs between two looks at the memory, each of which costs as much as a small input. Where a batch took
/// too much, its inputs are read once more, one by one.
const BATCH: u64 = 64;
/// Time after which a campaign says how far it is.
const REPORT_EVERY: Duration = Duration::from_secs(60);

#[test]
fn mutated_inputs_do_no_harm() {
    in_a_pool(|| campaign(60, 1));
}

/// Inputs that took 1.5 GB before each change was cut: lines of `A[` or `{"a":`, repeated twice by a factor of
/// 200.
#[test]
fn inputs_of_repeated_lines_take_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    for (name, input) in [("coco", 249), ("regions", 4960)] {
        let targets = targets();
        let found = (0..).zip(&targets).find(|(_, t)| t.name == name);
        let (number, target) = found.unwrap();
        let bench = Bench::new(folder.path(), 20_261_201, number, target);
        let memory = Memory::now();
        let trial = bench.read(input);
        assert!(
            memory.highest() < MOST_MEMORY,
            "{name}: {} bytes",
            memory.highest()
        );
        assert_eq!(judge(&trial, &bench.home), Ok(false), "{name}");
    }
}

#[test]
#[ignore = "runs as long as it is told; see the top of the file"]
fn campaign_of_any_length() {
    let number = |name: &str, usual: u64| {
        let given = std::env::var(name).ok();
        given.map_or(usual, |text| text.parse().expect("a whole number"))
    };
    let inputs = number("STONEWISE_MUTATIONS", 100_000);
    let (each, seed) = (
        inputs.div_ceil(targets().len() as u64),
        number("STONEWISE_SEED", 2),
    );
    in_a_pool(|| campaign(each, seed));
}

/// Runs where readers that use several threads need not wait for another one to begin.
fn in_a_pool(work: impl FnOnce() + Send) {
    rayon::ThreadPoolBuilder::new().build().unwrap().install(work);
}

/// What a target has seen.
#[derive(Default)]
struct Tally {
    accepted: u64,
    refused: u64,
    /// Wall time.
    whole: Duration,
    longest: Duration,
    largest: u64,
    harm: Vec<String>,
}

/// Reads this many mutated inputs of every target; what does harm is kept in the system's folder for
/// temporary files.
fn campaign(inputs_each: u64, seed: u64) {
    // Decoders of others panic behind a wall of ours; that is not worth a line each.
    std::panic::set_hook(Box::new(|_| {}));
    let folder = tempfile::tempdir().unwrap();
    let targets = targets();
    let benches: Vec<Bench<'_>> = (0..)
        .zip(&targets)
        .map(|(n, t)| Bench::new(folder.path(), seed, n, t))
        .collect();
    let mut tallies: Vec<Tally> = targets.iter().map(|_| Tally::default()).collect();
    let mut reported = Instant::now();
    // Batch by batch through all targets, so that a campaign that is stopped has tried them all alike.
    for start in (0..inputs_each).step_by(BATCH as usize) {
        let batch = start..(start + BATCH).min(inputs_each);
        for (bench, tally) in benches.iter().zip(&mut tallies) {
            bench.try_batch(batch.clone(), tally);
        }
        if reported.elapsed() > REPORT_EVERY {
            reported = Instant::now();
            report(&targets, &tallies);
        }
    }
    report(&targets, &tallies);
    let _ = std::panic::take_hook();
    let harm: Vec<&str> = tallies.iter().flat_map(|t| &t.harm).map(String::as_str).collect();
    assert!(harm.is_empty(), "{}", harm.join("\n"));
    let (accepted, refused) = (
        tallies.iter().map(|t| t.accepted),
        tallies.iter().map(|t| t.refused),
    );
    assert!(
        accepted.sum::<u64>() > 0 && refused.sum::<u64>() > 0,
        "all is accepted, or nothing"
    );
}

fn report(targets: &[Target], tallies: &[Tally]) {
    for (target, tally) in targets.iter().zip(tallies) {
        let inputs = tally.accepted + tally.refused;
        eprintln!(
            "{:12} {:8} accepted {:8} refused {:3} do harm  {:6.0} us each  longest {:5} ms  largest {:4} MiB",
            target.name,
            tally.accepted,
            tally.refused,
            tally.harm.len(),
            tally.whole.as_secs_f64() * 1e6 / inputs.max(1) as f64,
            tally.longest.as_millis(),
            tally.largest >> 20
        );
    }
    let inputs: u64 = tallies.iter().map(|t| t.accepted + t.refused).sum();
    eprintln!("{inputs} inputs");
}

/// A target with the folder that its inputs lie in.
struct Bench<'a> {
    home: PathBuf,
    seed: u64,
    number: u64,
    target: &'a Target,
}

/// What became of an input.
struct Trial {
    name: String,
    bytes: Vec<u8>,
    read: std::thread::Result<Result<(), String>>,
    time: Duration,
}

impl<'a> Bench<'a> {
    fn new(folder: &Path, seed: u64, number: u64, target: &'a Target) -> Self {
        let home = folder.join(target.name);
        fs::create_dir(&home).unwrap();
        target.prepare(&home);
        Self {
            home,
            seed,
            number,
            target,
        }
    }

    fn try_batch(&self, batch: Range<u64>, tally: &mut Tally) {
        let begun = Instant::now();
        let memory = Memory::now();
        for input in batch.clone() {
            let mut trial = self.read(input);
            if trial.time > MOST_TIME {
                // Was it the input, or other programs?
                trial.time = self.processor_time(input).unwrap_or(trial.time);
            }
            tally.longest = tally.longest.max(trial.time);
            match judge(&trial, &self.home) {
                Ok(true) => tally.accepted += 1,
                Ok(false) => tally.refused += 1,
                Err(what) => tally.harm.push(self.keep(input, &trial, &what)),
            }
        }
        let most = memory.highest();
        tally.largest = tally.largest.max(most);
        if most > MOST_MEMORY {
            self.find_large(batch, tally);
        }
        tally.whole += begun.elapsed();
    }

    fn read(&self, input: u64) -> Trial {
        let (name, bytes) = self.target.input(&mut Random::new(self.seed, self.number, input));
        let path = self.home.join(&name);
        fs::write(&path, &bytes).unwrap();
        let start = Instant::now();
        let read = catch_unwind(AssertUnwindSafe(|| (self.target.read)(&path)));
        let time = start.elapsed();
        Trial {
            name,
            bytes,
            read,
            time,
        }
    }

    fn processor_time(&self, input: u64) -> Option<Duration> {
        let start = processor_time()?;
        self.read(input);
        Some(processor_time()? - start)
    }

    /// Those inputs of a batch that take too much memory.
    fn find_large(&self, batch: Range<u64>, tally: &mut Tally) {
        for input in batch {
            let memory = Memory::now();
            let trial = self.read(input);
            let most = memory.highest();
            if most > MOST_MEMORY {
                let what = format!("took {} MiB", most >> 20);
                tally.harm.push(self.keep(input, &trial, &what));
            }
        }
    }

    /// Keeps an input that does harm; the line that says so.
    fn keep(&self, input: u64, trial: &Trial, what: &str) -> String {
        let (target, name) = (self.target.name, &trial.name);
        let kept = std::env::temp_dir().join(format!("stonewise-{target}-{input}-{name}"));
        let _ = fs::write(&kept, &trial.bytes);
        let line = format!(
            "{target} {}/{input}: {what} (kept as {})",
            self.seed,
            kept.display()
        );
        eprintln!("{line}");
        line
    }
}

/// Whether the input was accepted; else what harm it did.
fn judge(trial: &Trial, home: &Path) -> Result<bool, String> {
    if trial.time > MOST_TIME {
        return Err(format!("took {:?}", trial.time));
    }
    match &trial.read {
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(|t| (*t).to_owned()));
            Err(format!("panic: {}", text.unwrap_or_default()))
        }
        Ok(Ok(())) => Ok(true),
        Ok(Err(message)) if !message.contains(&home.display().to_string()) => {
            Err(format!("an error that names no file: {message}"))
        }
        Ok(Err(_)) => Ok(false),
    }
}
