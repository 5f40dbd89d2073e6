//! Runs that are killed at any moment, damaged between runs, or started twice: the results stay the same
//! bytes.
//!
//! Not part of the usual tests: `STONEWISE_KILLS=300 cargo test -p stonewise-cli --test kill -- --ignored
//! --nocapture`. A release build is three times as fast: build it, and name it by
//! `STONEWISE_PROGRAM=$PWD/target/release/stonewise`.
#![allow(clippy::unwrap_used)] // a test that cannot go on must stop

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use support::{Dice, contents, program, run, tiny_survey};

/// Kills where the environment does not say how many.
const KILLS: usize = 20;

/// Result files with their bytes; not those that hold times, and not what lies aside or is stonewise's own.
fn results(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let but = ["work", "previous", "UNFINISHED.txt", "run.json", "report"];
    let all = contents(out, &but).into_iter();
    all.filter(|(name, _)| !name.to_string_lossy().ends_with(".partial"))
        .collect()
}

fn start(out: &Path) -> Child {
    Command::new(program())
        .arg("run")
        .arg(tiny_survey().join("stonewise.toml"))
        .arg("--out")
        .arg(out)
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Starts a run and kills it after a while; whether it was still at work.
fn kill_after(out: &Path, wait: Duration) -> bool {
    let mut child = start(out);
    std::thread::sleep(wait);
    let at_work = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    at_work
}

/// Flips a bit of, cuts, or removes a random file of a random step. The stamp of a step stays: a folder
/// without one is not stonewise's, and a run refuses to empty it.
fn damage(out: &Path, dice: &mut Dice) {
    let files = contents(&out.join("work"), &["lock", "marker.json"]);
    if files.is_empty() {
        return;
    }
    let (name, mut bytes) = files[dice.next() as usize % files.len()].clone();
    let path = out.join("work").join(name);
    match dice.next() % 3 {
        0 if !bytes.is_empty() => {
            let at = dice.next() as usize % bytes.len();
            bytes[at] ^= 1 << (dice.next() % 8);
            fs::write(path, bytes).unwrap();
        }
        1 => fs::write(path, &bytes[..bytes.len() / 2]).unwrap(),
        _ if path.ends_with("step.json") => {}
        _ => fs::remove_file(path).unwrap(),
    }
}

#[test]
#[ignore = "takes minutes; see the top of the file"]
fn killed_runs_end_in_the_same_bytes() {
    let kills: usize = std::env::var("STONEWISE_KILLS").map_or(KILLS, |n| n.parse().unwrap());
    let reference = tempfile::tempdir().unwrap();
    let begun = Instant::now();
    let (code, log) = run(tiny_survey(), reference.path(), &[]);
    assert_eq!(code, 0, "{log}");
    let whole = begun.elapsed();
    let sound = results(reference.path());
    let mut dice = Dice(7);
    let (mut killed, mut rounds, mut damaged) = (0, 0, 0);
    let mut out = tempfile::tempdir().unwrap();
    while killed < kills {
        // Twice in a row, three times out of four; half of the rounds begin in the folder of a finished run.
        for _ in 0..1 + u32::from(!dice.next().is_multiple_of(4)) {
            killed += usize::from(kill_after(out.path(), whole.mul_f64(1.05 * dice.share())));
            for (name, bytes) in results(out.path()) {
                assert!(
                    sound.get(&name) == Some(&bytes),
                    "{} is half-written",
                    name.display()
                );
            }
        }
        println!("{killed} kills, {rounds} reruns, {damaged} damaged files");
        if dice.next().is_multiple_of(3) {
            damage(out.path(), &mut dice);
            damaged += 1;
        }
        let (code, log) = run(tiny_survey(), out.path(), &[]);
        assert_eq!(code, 0, "{log}");
        assert!(results(out.path()) == sound, "other results after {killed} kills");
        let left = contents(out.path(), &[]);
        assert!(
            left.iter()
                .all(|(n, _)| !n.to_string_lossy().ends_with(".partial")),
            "temporary files stay"
        );
        rounds += 1;
        if dice.next().is_multiple_of(2) {
            out = tempfile::tempdir().unwrap();
        }
    }
    println!("{killed} kills, {rounds} reruns, {damaged} damaged files: the same bytes every time");
}

#[test]
#[ignore = "takes minutes; see the top of the file"]
fn of_two_runs_at_once_one_works_and_one_is_refused() {
    let reference = tempfile::tempdir().unwrap();
    assert_eq!(run(tiny_survey(), reference.path(), &[]).0, 0);
    let sound = results(reference.path());
    let mut dice = Dice(11);
    for _ in 0..10 {
        let out = tempfile::tempdir().unwrap();
        let mut first = start(out.path());
        std::thread::sleep(Duration::from_secs_f64(0.5 * dice.share()));
        let mut second = start(out.path());
        let codes = [first.wait().unwrap().code(), second.wait().unwrap().code()];
        assert!(codes.contains(&Some(0)), "{codes:?}");
        assert!(codes.iter().all(|c| [Some(0), Some(1)].contains(c)), "{codes:?}");
        assert!(results(out.path()) == sound, "two runs made other results");
    }
}
