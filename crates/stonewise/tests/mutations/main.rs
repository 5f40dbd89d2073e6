//! Mutated inputs of every reader: an answer or an error that names the file, never a panic, within limits of
//! time and memory.
//!
//! The test is short and the same every time. For any number of inputs, from any seed:
//! `STONEWISE_MUTATIONS=1000000 STONEWISE_SEED=7 cargo test -p stonewise --test mutations -- --ignored
//! --nocapture`
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

use limits::Spent;
use random::Random;
use std::fmt::Write as _;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Duration;
use targets::{Target, targets};

/// Processor time for one input, all threads.
const MOST_TIME: Duration = Duration::from_secs(2);
/// Memory that one input may take beyond what is there, bytes.
const MOST_MEMORY: u64 = 512 << 20;

#[test]
fn mutated_inputs_do_no_harm() {
    campaign(60, 1);
}

#[test]
#[ignore = "runs as long as it is told; see the top of the file"]
fn campaign_of_any_length() {
    let number = |name: &str, usual: u64| {
        let given = std::env::var(name).ok();
        given.map_or(usual, |text| text.parse().expect("a whole number"))
    };
    let inputs = number("STONEWISE_MUTATIONS", 100_000);
    campaign(
        inputs.div_ceil(targets().len() as u64),
        number("STONEWISE_SEED", 2),
    );
}

/// What a target has seen.
#[derive(Default)]
struct Tally {
    accepted: u64,
    refused: u64,
    longest: Duration,
    largest: u64,
}

/// Reads this many mutated inputs of every target; what does harm is kept in the system's folder for
/// temporary files.
fn campaign(inputs_each: u64, seed: u64) {
    // Decoders of others panic behind a wall of ours; that is not worth a line each.
    std::panic::set_hook(Box::new(|_| {}));
    let folder = tempfile::tempdir().unwrap();
    let (mut harm, mut total) = (String::new(), Tally::default());
    for (number, target) in (0..).zip(targets()) {
        let home = folder.path().join(target.name);
        fs::create_dir(&home).unwrap();
        target.prepare(&home);
        let mut tally = Tally::default();
        for input in 0..inputs_each {
            let mut random = Random::new(seed, number, input);
            if let Err(what) = try_one(&target, &home, &mut random, &mut tally) {
                let _ = writeln!(harm, "{} {seed}/{input}: {what}", target.name);
            }
        }
        eprintln!(
            "{:12} {:8} accepted {:8} refused  longest {:5} ms  largest {:4} MiB",
            target.name,
            tally.accepted,
            tally.refused,
            tally.longest.as_millis(),
            tally.largest >> 20
        );
        total.accepted += tally.accepted;
        total.refused += tally.refused;
    }
    let _ = std::panic::take_hook();
    assert!(harm.is_empty(), "{harm}");
    assert!(
        total.accepted > 0 && total.refused > 0,
        "all is accepted, or nothing"
    );
}

fn try_one(target: &Target, home: &Path, random: &mut Random, tally: &mut Tally) -> Result<(), String> {
    let (name, bytes) = target.input(random);
    let path = home.join(&name);
    fs::write(&path, &bytes).unwrap();
    let start = Spent::now();
    let read = catch_unwind(AssertUnwindSafe(|| (target.read)(&path)));
    let spent = Spent::since(&start);
    let verdict = judge(read, &spent, home);
    match &verdict {
        Ok(true) => tally.accepted += 1,
        _ => tally.refused += 1,
    }
    tally.longest = tally.longest.max(spent.time);
    tally.largest = tally.largest.max(spent.memory);
    verdict.map(|_| ()).map_err(|what| {
        let kept = std::env::temp_dir().join(format!("stonewise-{}-{}", target.name, name));
        let _ = fs::write(&kept, &bytes);
        format!("{what} ({} bytes kept as {})", bytes.len(), kept.display())
    })
}

/// Whether the input was accepted; else what harm it did.
fn judge(read: std::thread::Result<Result<(), String>>, spent: &Spent, home: &Path) -> Result<bool, String> {
    if spent.time > MOST_TIME {
        return Err(format!("took {:?}", spent.time));
    }
    if spent.memory > MOST_MEMORY {
        return Err(format!("took {} MiB", spent.memory >> 20));
    }
    match read {
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
