//! Runs that are killed at any moment, damaged between runs, or started twice: the results stay the same
//! bytes. Every step of a run is killed equally often, whatever its share of the time.
//!
//! Not part of the usual tests: `STONEWISE_KILLS=300 cargo test -p stonewise-cli --test integration kill -- --ignored
//! --nocapture`; `STONEWISE_SEED` gives other moments. A release build is three times as fast: build it, and
//! name it by `STONEWISE_PROGRAM=$PWD/target/release/stonewise`.

use crate::support::{Dice, contents, damage, program, results, run, tiny_survey};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Kills where the environment does not say how many.
const KILLS: usize = 20;

fn start(out: &Path) -> Child {
    Command::new(program())
        .arg("run")
        .arg(tiny_survey().join("stonewise.toml"))
        .arg("--out")
        .arg(out)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// A step as a run announces it: `[2.4 s] 3/6 match the stones`.
struct Step {
    number: usize,
    begun: Duration,
    name: String,
}

impl Step {
    fn parse(line: &str) -> Option<Self> {
        let (seconds, step) = line.strip_prefix('[')?.split_once(" s] ")?;
        let (number, rest) = step.split_once('/')?;
        Some(Self {
            number: number.parse().ok()?,
            begun: Duration::from_secs_f64(seconds.parse().ok()?),
            name: rest.split_once(' ')?.1.split(',').next()?.to_owned(),
        })
    }
}

/// Name and duration of every step of a run; the last one lasts until `end`.
fn steps(log: &str, end: Duration) -> Vec<(String, Duration)> {
    let mut all: Vec<Step> = Vec::new();
    for step in log.lines().filter_map(Step::parse) {
        if all.last().is_none_or(|last| last.number < step.number) {
            all.push(step);
        }
    }
    let ends: Vec<Duration> = all[1..].iter().map(|s| s.begun).chain([end]).collect();
    let durations = all.into_iter().zip(ends);
    durations
        .map(|(step, end)| (step.name, end.saturating_sub(step.begun)))
        .collect()
}

/// Starts a run and kills it `wait` after it announces the step of this number; the step that it was at, or
/// `None` where it ended before.
fn kill_in(out: &Path, number: usize, wait: Duration) -> Option<usize> {
    let mut child = start(out);
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let reached = |line: std::io::Result<String>| Step::parse(&line.unwrap()).map(|s| s.number);
    let mut at = lines.by_ref().filter_map(reached).find(|&step| step >= number);
    std::thread::sleep(wait);
    let at_work = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    at = lines.filter_map(reached).last().or(at);
    at.filter(|_| at_work)
}

#[test]
#[ignore = "takes minutes; see the top of the file"]
fn killed_runs_end_in_the_same_bytes() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse().unwrap());
    let kills = number("STONEWISE_KILLS").unwrap_or(KILLS);
    let seed = number("STONEWISE_SEED").unwrap_or(7) as u64;
    let reference = tempfile::tempdir().unwrap();
    let begun = Instant::now();
    let (code, log) = run(tiny_survey(), reference.path(), &[]);
    assert_eq!(code, 0, "{log}");
    let steps = steps(&log, begun.elapsed());
    let sound = results(reference.path());
    let mut dice = Dice(seed);
    let (mut killed, mut rounds, mut damaged) = (0, 0, 0);
    let mut killed_in = vec![0; steps.len()];
    let mut out = tempfile::tempdir().unwrap();
    while killed < kills {
        // Twice in a row, three times out of four; half of the rounds begin in the folder of a finished run.
        for _ in 0..1 + u32::from(!dice.next().is_multiple_of(4)) {
            let step = dice.below(steps.len());
            if let Some(at) = kill_in(out.path(), step + 1, steps[step].1.mul_f64(dice.share())) {
                killed += 1;
                killed_in[at - 1] += 1;
            }
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
    for ((name, _), kills) in steps.iter().zip(killed_in) {
        println!("{kills:4} {name}");
    }
}

#[test]
#[ignore = "takes minutes; see the top of the file"]
fn of_two_runs_at_once_one_works_and_one_is_refused() {
    let reference = tempfile::tempdir().unwrap();
    assert_eq!(run(tiny_survey(), reference.path(), &[]).0, 0);
    let sound = results(reference.path());
    let mut dice = Dice(11);
    let mut refused = 0;
    for _ in 0..10 {
        let out = tempfile::tempdir().unwrap();
        let first = start(out.path());
        std::thread::sleep(Duration::from_secs_f64(0.5 * dice.share()));
        let second = start(out.path());
        let ends = [first, second].map(|run| run.wait_with_output().unwrap());
        assert!(ends.iter().any(|end| end.status.code() == Some(0)), "{ends:?}");
        for end in ends.iter().filter(|end| end.status.code() != Some(0)) {
            assert_eq!(end.status.code(), Some(1), "{end:?}");
            let log = String::from_utf8_lossy(&end.stderr);
            assert!(log.contains("another run works in this folder"), "{log}");
            refused += 1;
        }
        assert!(results(out.path()) == sound, "two runs made other results");
    }
    println!("10 pairs of runs, {refused} refused: the same bytes every time");
    assert!(refused > 0, "no two runs worked at once");
}
