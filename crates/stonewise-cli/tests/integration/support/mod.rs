//! A small simulated survey and runs of the command on it.

pub mod stones;

use assert_cmd::Command;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A wall of a few dozen stones, small enough to be run many times.
pub const SURVEY: &str = r#"
name = "Test wall"
[scene]
seed = 3
[scene.wall]
width_m = 1.6
height_m = 1.0
seed = 3
[scene.tls]
spacing_m = 0.008
[photos]
columns = 2
rows = 1
width = 800
height = 600
focal_px = 1100.0
distance_m = 5.0
"#;

/// The least that goes through every step: for runs by the hundred.
const TINY: &str = r#"
name = "Tiny wall"
[scene]
seed = 3
[scene.wall]
width_m = 1.2
height_m = 0.8
seed = 3
[scene.tls]
spacing_m = 0.012
[photos]
columns = 2
rows = 1
width = 600
height = 450
focal_px = 825.0
distance_m = 5.0
"#;

/// A wall whose photos and points are fine enough to find its edges in both.
pub const SHARP: &str = r#"
name = "Sharp wall"
[scene]
seed = 5
[scene.wall]
width_m = 1.6
height_m = 1.0
seed = 5
[scene.tls]
spacing_m = 0.004
[photos]
columns = 2
rows = 1
width = 800
height = 600
focal_px = 1700.0
distance_m = 5.0
"#;

/// Numbers that look random and are the same every time.
pub struct Dice(pub u64);

impl Dice {
    pub fn next(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    /// From 0, less than `limit`.
    pub fn below(&mut self, limit: usize) -> usize {
        self.next() as usize % limit
    }

    /// 0 to 1.
    pub fn share(&mut self) -> f64 {
        (self.next() % 1_000_000) as f64 / 1e6
    }
}

/// The program under test: this build, or the one that `STONEWISE_PROGRAM` names.
pub fn program() -> PathBuf {
    std::env::var_os("STONEWISE_PROGRAM")
        .map_or_else(|| env!("CARGO_BIN_EXE_stonewise").into(), PathBuf::from)
}

pub fn stonewise() -> Command {
    Command::new(program())
}

/// The survey, made once for all tests of a program.
pub fn survey() -> &'static Path {
    static DIR: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    &DIR.get_or_init(|| simulated(SURVEY)).1
}

/// The smallest survey, made once for all tests of a program.
pub fn tiny_survey() -> &'static Path {
    static DIR: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    &DIR.get_or_init(|| simulated(TINY)).1
}

/// Results of the smallest survey, made once for all tests of a program; a copy of them goes on as they would.
pub fn tiny_results() -> &'static Path {
    static DIR: OnceLock<TempDir> = OnceLock::new();
    DIR.get_or_init(|| finished(tiny_survey())).path()
}

/// Results of the survey, made by two threads, once for all tests of a program.
pub fn survey_results() -> &'static Path {
    static DIR: OnceLock<TempDir> = OnceLock::new();
    DIR.get_or_init(|| finished(survey())).path()
}

fn finished(survey: &Path) -> TempDir {
    let out = tempfile::tempdir().unwrap();
    let (code, log) = run(survey, out.path(), &["--threads", "2"]);
    assert_eq!(code, 0, "{log}");
    out
}

/// A survey made with these parameters, and the folder that holds it.
pub fn simulated(params: &str) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("params.toml");
    fs::write(&file, params).unwrap();
    let survey = dir.path().join("survey");
    stonewise()
        .args(["test", "simulate", "--quiet", "--params"])
        .arg(&file)
        .arg("--out")
        .arg(&survey)
        .assert()
        .success();
    (dir, survey)
}

/// A copy of a survey or of results that a test may spoil.
pub fn copy_of(survey: &Path) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    copy_tree(survey, dir.path());
    dir
}

pub fn copy_tree(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_tree(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Runs a command; exit code and stderr.
pub fn outcome(command: &mut Command) -> (i32, String) {
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!text.contains("panicked"), "{text}");
    (output.status.code().unwrap(), text)
}

/// Runs `run` on a survey; exit code and stderr.
pub fn run(survey: &Path, out: &Path, extra: &[&str]) -> (i32, String) {
    let mut command = stonewise();
    command
        .arg("run")
        .arg(survey.join("stonewise.toml"))
        .arg("--out")
        .arg(out);
    outcome(command.args(extra))
}

/// Every file below a folder with its bytes, ascending by name; `but`: names at its top that are left out.
pub fn contents(folder: &Path, but: &[&str]) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut open: Vec<PathBuf> = [folder.to_path_buf()]
        .into_iter()
        .filter(|dir| dir.exists())
        .collect();
    while let Some(dir) = open.pop() {
        for path in fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()) {
            let below = path.strip_prefix(folder).unwrap().to_path_buf();
            if but.iter().any(|b| below == Path::new(b)) {
                continue;
            }
            if path.is_dir() {
                open.push(path);
            } else {
                files.push((below, fs::read(&path).unwrap()));
            }
        }
    }
    files.sort();
    files
}

/// Result files with their bytes; not those that hold times, and not what lies aside or is stonewise's own.
pub fn results(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let but = [
        "work",
        "previous",
        "UNFINISHED.txt",
        "run.json",
        "data/digests.b3",
        "report.html",
    ];
    let all = contents(out, &but).into_iter();
    all.filter(|(name, _)| !name.to_string_lossy().ends_with(".partial"))
        .collect()
}

/// Flips a bit of, cuts, or removes a random file of a random step.
pub fn damage(out: &Path, dice: &mut Dice) {
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
        _ => fs::remove_file(path).unwrap(),
    }
}
