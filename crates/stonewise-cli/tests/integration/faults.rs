//! System calls that fail during a run, once or from some place on: the run fails with a message or its results are
//! right, nothing is half-written under its final name, and the same command afterwards gives the same bytes
//! and leaves nothing behind.
//!
//! A long campaign: `STONEWISE_FAULTS=1000 cargo test -p stonewise-cli --test integration faults -- --ignored --nocapture`;
//! `STONEWISE_SEED` gives other faults, `STONEWISE_PROGRAM` names another program. It needs `strace` (Debian's
//! package of that name).

use crate::support::{Dice, contents, copy_tree, program, results, run, simulated};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Kinds of system calls; `?`: not every processor has all of a kind.
const CALLS: [(&str, &str); 14] = [
    ("openat", "openat"),
    ("read", "?read,?pread64,?copy_file_range"),
    ("write", "write"),
    ("pwrite64", "pwrite64"),
    ("fsync", "fsync"),
    ("rename", "?rename,?renameat,?renameat2"),
    ("mkdir", "?mkdir,?mkdirat"),
    ("unlink", "?unlink,?unlinkat,?rmdir"),
    ("link", "?link,?linkat"),
    ("list", "getdents64"),
    ("stat", "?statx,?fstat,?newfstatat"),
    ("lock", "flock"),
    ("thread", "?clone,?clone3"),
    ("mmap", "mmap"),
];
const ERRORS: [&str; 5] = ["ENOSPC", "EIO", "EMFILE", "EACCES", "ENOMEM"];
/// Of mmap only this, which is what the system says where memory is short.
const OF_MEMORY: &str = "ENOMEM";
/// Seconds after which a run hangs.
const LIMIT_S: &str = "240";

/// The least that goes through every step; points are few, so that a run is short.
const SURVEY: &str = r#"
name = "Faulty wall"
[scene]
seed = 3
[scene.wall]
width_m = 0.9
height_m = 0.6
seed = 3
[scene.tls]
spacing_m = 0.012
[photos]
columns = 2
rows = 1
width = 400
height = 300
focal_px = 825.0
distance_m = 5.0
"#;

/// What lies in the folder when the run with the fault begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Before {
    Nothing,
    /// Results of the same run.
    Same,
    /// Results of a run with another parameter.
    Other,
}

#[derive(Debug)]
struct Fault {
    /// Index of the kind in [`CALLS`].
    kind: usize,
    error: &'static str,
    /// Which call of its thread fails.
    place: usize,
    /// All later ones fail, too.
    stays: bool,
    before: Before,
}

/// A run and what it left.
struct Outcome {
    /// The exit code; `None` after a signal.
    code: Option<i32>,
    log: String,
    /// The calls that failed, as strace shows them.
    failed: Vec<String>,
}

struct Bench {
    _dir: TempDir,
    survey: PathBuf,
    sound: BTreeMap<PathBuf, Vec<u8>>,
    /// Results of the other parameter.
    other: BTreeMap<PathBuf, Vec<u8>>,
    same_folder: PathBuf,
    other_folder: PathBuf,
    /// Most calls of one name of a kind in one thread, by what lies in the folder before.
    counts: BTreeMap<(Before, usize), usize>,
}

fn strace() -> bool {
    let works = |args: &[&str]| {
        let output = Command::new("strace").args(args).output();
        output.is_ok_and(|o| String::from_utf8_lossy(&o.stderr).contains("(INJECTED)"))
    };
    works(&[
        "-f",
        "-e",
        "inject=chdir:error=EIO:when=1",
        "env",
        "-C",
        "/",
        "true",
    ])
}

impl Bench {
    fn new() -> Self {
        let (dir, survey) = simulated(SURVEY);
        let (same_folder, other_folder) = (dir.path().join("same"), dir.path().join("other"));
        let project = survey.join("stonewise.toml");
        let text = fs::read_to_string(&project).unwrap();
        fs::write(&project, format!("{text}\n[ingest]\nsize_m = 0.5\n")).unwrap();
        sound_run(&survey, &other_folder);
        fs::write(&project, text).unwrap();
        sound_run(&survey, &same_folder);
        Self {
            survey,
            sound: results(&same_folder),
            other: results(&other_folder),
            same_folder,
            other_folder,
            counts: BTreeMap::new(),
            _dir: dir,
        }
    }

    /// A folder as it is before a run, and one for temporary files.
    fn folder(&self, before: Before) -> (TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("results");
        match before {
            Before::Nothing => {}
            Before::Same => copy_tree(&self.same_folder, &out),
            Before::Other => copy_tree(&self.other_folder, &out),
        }
        fs::create_dir(dir.path().join("tmp")).unwrap();
        (dir, out)
    }

    /// Runs under strace with its arguments `how`; a thread for every line of the log.
    fn traced(&self, dir: &Path, how: &[String]) -> (Option<i32>, String, String) {
        let trace = dir.join("trace");
        let mut command = Command::new("timeout");
        command
            .args([LIMIT_S, "strace", "-f", "-y", "-qq", "--seccomp-bpf", "-o"])
            .arg(&trace);
        command.args(how).arg(program()).args(["--threads", "1", "run"]);
        command
            .arg(self.survey.join("stonewise.toml"))
            .arg("--out")
            .arg(dir.join("results"));
        let output = command.env("TMPDIR", dir.join("tmp")).output().unwrap();
        let log = String::from_utf8_lossy(&output.stderr).into_owned();
        let trace = String::from_utf8_lossy(&fs::read(&trace).unwrap_or_default()).into_owned();
        (output.status.code(), log, trace)
    }

    fn count(&mut self, before: Before) {
        let (dir, _) = self.folder(before);
        let all = CALLS.map(|(_, calls)| calls).join(",");
        let (code, log, trace) = self.traced(dir.path(), &["-e".to_owned(), format!("trace={all}")]);
        assert_eq!(code, Some(0), "{log}");
        // strace counts the calls of every thread and name apart.
        let mut counts: BTreeMap<(usize, &str, &str), usize> = BTreeMap::new();
        for line in trace.lines().filter(|line| !line.contains("resumed>")) {
            let Some((thread, call)) = line.split_once(' ') else {
                continue;
            };
            let call = call.trim_start().split('(').next().unwrap_or_default();
            let names = |calls: &str| calls.split(',').any(|name| name.trim_start_matches('?') == call);
            if let Some(kind) = CALLS.iter().position(|(_, calls)| names(calls)) {
                *counts.entry((kind, thread, call)).or_default() += 1;
            }
        }
        for ((kind, ..), count) in counts {
            let most = self.counts.entry((before, kind)).or_default();
            *most = count.max(*most);
        }
    }

    /// Most calls of one name of a kind in one thread; 0 where there are none.
    fn most(&mut self, before: Before, kind: usize) -> usize {
        if !self.counts.keys().any(|(counted, _)| *counted == before) {
            self.count(before);
        }
        self.counts.get(&(before, kind)).copied().unwrap_or_default()
    }

    fn fault(&mut self, dice: &mut Dice) -> Fault {
        let before = [Before::Nothing, Before::Same, Before::Other][dice.below(3)];
        let kind = dice.below(CALLS.len());
        Fault {
            kind,
            error: error_of(kind, dice.below(ERRORS.len())),
            place: 1 + dice.below(self.most(before, kind).max(1)),
            stays: dice.below(2) == 0,
            before,
        }
    }

    /// What is wrong after a run with the fault; how it ended.
    fn try_out(&self, fault: &Fault) -> (Outcome, Vec<String>) {
        let (dir, out) = self.folder(fault.before);
        let (name, calls) = CALLS[fault.kind];
        let on = if fault.stays { "+" } else { "" };
        let how = [
            "-e".to_owned(),
            format!("trace={calls}"),
            "-e".to_owned(),
            format!("inject={calls}:error={}:when={}{on}", fault.error, fault.place),
        ];
        let (code, log, trace) = self.traced(dir.path(), &how);
        let failed = trace.lines().filter(|line| line.contains("(INJECTED)"));
        let outcome = Outcome {
            code,
            log,
            failed: failed
                .map(|line| line.split_once(' ').map_or(line, |l| l.1).to_owned())
                .collect(),
        };
        let mut wrong = Vec::new();
        let finished = matches!(code, Some(0 | 3));
        // Rust's own start of a thread panics where it gets no memory for the stack of signals.
        if outcome.log.contains("panicked") && !outcome.log.contains("sys/pal/unix/stack_overflow.rs") {
            wrong.push("panics".to_owned());
        }
        if code == Some(124) {
            wrong.push("hangs".to_owned());
        }
        if !finished && !matches!(name, "mmap" | "thread") && !outcome.message().contains('/') {
            wrong.push("the message names no file".to_owned());
        }
        if finished {
            self.is_whole(&out, &mut wrong);
        } else {
            self.is_never_half(&out, fault.before, &mut wrong);
        }
        let (code, log) = run(&self.survey, &out, &[]);
        if code != 0 {
            wrong.push(format!("the next run ends with {code}: {log}"));
        }
        self.is_whole(&out, &mut wrong);
        let left = contents(dir.path(), &[]).into_iter().filter(|(file, _)| {
            let name = file.to_string_lossy();
            name.contains(".partial") || name.contains("-journal") || file.starts_with("tmp")
        });
        wrong.extend(left.map(|(file, _)| format!("{} stays behind", file.display())));
        (outcome, wrong)
    }

    /// A run that says it finished leaves the right results, all of them in the list of digests.
    fn is_whole(&self, out: &Path, wrong: &mut Vec<String>) {
        wrong.extend(difference("results", &results(out), &self.sound));
        for aside in ["previous", "UNFINISHED.txt"] {
            if out.join(aside).exists() {
                wrong.push(format!("{aside} stays after a finished run"));
            }
        }
        let list = fs::read_to_string(out.join("data/digests.b3")).unwrap_or_default();
        for (file, bytes) in contents(out, &["work", "data/digests.b3"]) {
            let line = format!("{}  {}", blake3::hash(&bytes).to_hex(), file.display());
            if !list.lines().any(|l| l == line) && !file.to_string_lossy().contains(".partial") {
                wrong.push(format!("{} is not in the list of digests", file.display()));
            }
        }
    }

    /// A run that failed leaves whole files under their names, and says that they are not finished; results of
    /// the run before are still there.
    fn is_never_half(&self, out: &Path, before: Before, wrong: &mut Vec<String>) {
        let now = results(out);
        let earlier = match before {
            Before::Nothing => &BTreeMap::new(),
            Before::Same => &self.sound,
            Before::Other => &self.other,
        };
        let aside = results(&out.join("previous"));
        if !out.join("UNFINISHED.txt").exists() {
            // It had not begun, or had finished.
            if now != *earlier && now != self.sound {
                wrong.push("unfinished results are not marked".to_owned());
            }
            return;
        }
        for (file, bytes) in &now {
            if ![&self.sound, earlier]
                .iter()
                .any(|all| all.get(file) == Some(bytes))
            {
                wrong.push(format!("{} is half-written", file.display()));
            }
        }
        for (file, bytes) in earlier {
            if ![&aside, &now].iter().any(|all| all.get(file) == Some(bytes)) {
                wrong.push(format!("{} of the run before is lost", file.display()));
            }
        }
    }
}

impl Outcome {
    /// The line that says why it failed.
    fn message(&self) -> &str {
        let lines = || self.log.lines().filter(|line| !line.trim().is_empty());
        lines()
            .find(|line| line.starts_with("error"))
            .or_else(|| lines().next_back())
            .unwrap_or_default()
    }
}

fn sound_run(survey: &Path, out: &Path) {
    let (code, log) = run(survey, out, &[]);
    assert_eq!(code, 0, "{log}");
}

fn difference(what: &str, a: &BTreeMap<PathBuf, Vec<u8>>, b: &BTreeMap<PathBuf, Vec<u8>>) -> Option<String> {
    let differs = |file: &&PathBuf| a.get(*file) != b.get(*file);
    let files: Vec<_> = a
        .keys()
        .chain(b.keys())
        .filter(differs)
        .map(|f| f.display().to_string())
        .collect();
    (!files.is_empty()).then(|| format!("other {what}: {}", files.join(", ")))
}

fn error_of(kind: usize, number: usize) -> &'static str {
    match CALLS[kind].0 {
        "mmap" => OF_MEMORY,
        _ => ERRORS[number],
    }
}

/// Tries faults; fails with a list of what was wrong.
fn campaign(bench: &Bench, faults: &[Fault]) {
    let mut ends: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    let mut defects = Vec::new();
    for (number, fault) in faults.iter().enumerate() {
        let (outcome, wrong) = bench.try_out(fault);
        let end = match (outcome.failed.len(), outcome.code) {
            (0, _) => "no call failed",
            (_, Some(0 | 3)) => "right results",
            (_, Some(127)) => "not loaded",
            (_, Some(_)) => "message",
            (_, None) => "signal",
        };
        *ends.entry((CALLS[fault.kind].0, end)).or_default() += 1;
        let site = outcome.failed.last().map_or("-", String::as_str);
        println!("{number} {fault:?}: {end}: {site}: {}", outcome.message());
        for defect in wrong {
            println!("  DEFECT {defect}");
            defects.push(format!("{fault:?}: {defect}"));
        }
    }
    for ((call, end), count) in ends {
        println!("{count:5} {call}: {end}");
    }
    assert!(defects.is_empty(), "{}", defects.join("\n"));
}

#[test]
#[ignore = "takes minutes to hours; see the top of the file"]
fn any_system_call_may_fail_anywhere() {
    if !strace() {
        println!("skipped: no strace that lets system calls fail");
        return;
    }
    let number = |name: &str| {
        std::env::var(name)
            .ok()
            .map(|text| text.parse::<usize>().unwrap())
    };
    let mut dice = Dice(number("STONEWISE_SEED").unwrap_or(7) as u64);
    let mut bench = Bench::new();
    let count = number("STONEWISE_FAULTS").unwrap_or(100);
    let faults: Vec<Fault> = (0..count).map(|_| bench.fault(&mut dice)).collect();
    println!("most calls of a thread: {:?}", bench.counts);
    campaign(&bench, &faults);
}

/// Of most kinds one call near the end, where results of another run are replaced; and what once went wrong.
#[test]
fn the_last_system_calls_of_a_run_may_fail() {
    if !strace() {
        println!("skipped: no strace that lets system calls fail");
        return;
    }
    let mut bench = Bench::new();
    let mut dice = Dice(5);
    let kind = |name: &str| CALLS.iter().position(|call| call.0 == name).unwrap();
    // A full disk once left SQLite's journal behind.
    let journal = Fault {
        kind: kind("pwrite64"),
        error: "ENOSPC",
        place: 1,
        stays: true,
        before: Before::Nothing,
    };
    let mut faults = vec![journal];
    for name in ["openat", "write", "fsync", "rename", "unlink", "list", "stat"] {
        let (kind, before) = (kind(name), Before::Other);
        faults.push(Fault {
            kind,
            error: "EIO",
            place: bench.most(before, kind).saturating_sub(dice.below(6)).max(1),
            stays: false,
            before,
        });
    }
    campaign(&bench, &faults);
}
