//! The life of a survey, driven by one seed: runs, kills, other parameters, edits by hand, another epoch, a
//! full disk, a short memory, damaged files, clocks that jump, two runs at once. After every deed the results on
//! disk are whole and those of one state of the project, or marked as unfinished, with the finished ones aside.
//!
//! `STONEWISE_LIFE=1000 cargo test -p stonewise-cli --test integration life -- --ignored --nocapture`; `STONEWISE_SEED` gives
//! another life, `STONEWISE_PROGRAM` names another program. The disk is filled where the test may mount one.

use crate::support::stones::{SIGNED, inner, place, rows};
use crate::support::{Dice, contents, copy_of, damage, program, results, run, tiny_survey};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

type Files = BTreeMap<PathBuf, Vec<u8>>;
type Deed = (&'static str, fn(&mut Life));

/// What the project says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct State {
    /// Index in [`PARAMETERS`].
    parameters: usize,
    is_edited: bool,
    has_third_epoch: bool,
}

/// Parameters of a late and of an early step.
const PARAMETERS: [&str; 3] = ["", "[m3c2]\ncore_spacing_m = 0.1\n", "[ingest]\nsize_m = 0.5\n"];
const DEEDS: [Deed; 10] = [
    ("run", Life::run_to_the_end),
    ("kill", Life::kill),
    ("kill and kill again", |life| {
        life.kill();
        life.kill();
    }),
    ("another state", Life::change),
    ("another state during a run", Life::change_and_kill),
    ("damage", Life::damage),
    ("full disk", Life::fill_the_disk),
    ("short memory", Life::run_in_short_memory),
    ("files of the future", Life::touch),
    ("two at once", Life::run_two),
];
/// Size of the disk.
const DISK_KIB: u64 = 256 << 10;

struct Life {
    dir: TempDir,
    /// Whether there is a disk that can be filled.
    has_disk: bool,
    base: String,
    state: State,
    dice: Dice,
    /// Results of every state, made aside when they are needed first.
    sound: BTreeMap<State, Files>,
    /// The state whose run finished last in the folder.
    finished: Option<State>,
    /// States whose runs began since.
    begun: BTreeSet<State>,
    /// Time of a run from the beginning.
    whole: Duration,
    counts: BTreeMap<String, usize>,
}

impl Drop for Life {
    fn drop(&mut self) {
        if self.has_disk {
            let _ = Command::new("umount").arg(self.disk()).status();
        }
    }
}

impl Life {
    fn new(seed: u64) -> Self {
        let dir = copy_of(tiny_survey());
        let base = fs::read_to_string(dir.path().join("stonewise.toml")).unwrap();
        let disk = dir.path().join("disk");
        fs::create_dir(&disk).unwrap();
        let mut mount = Command::new("mount");
        mount.args([
            "-t",
            "tmpfs",
            "-o",
            &format!("size={DISK_KIB}k"),
            "stonewise-life",
        ]);
        let has_disk = mount.arg(&disk).status().is_ok_and(|status| status.success());
        let mut life = Self {
            dir,
            has_disk,
            base,
            state: State::default(),
            dice: Dice(seed),
            sound: BTreeMap::new(),
            finished: None,
            begun: BTreeSet::new(),
            whole: Duration::ZERO,
            counts: BTreeMap::new(),
        };
        let begun = SystemTime::now();
        life.make_sound();
        life.whole = begun.elapsed().unwrap();
        let stones = rows(&life.aside(life.state).join("stones.csv"));
        let at = place(&stones[&inner(&stones)[0]]);
        let edits =
            format!("{{\"format\": 1, \"edits\": [{{\"do\": \"delete\", \"at\": [{at:?}], {SIGNED}}}]}}\n");
        fs::write(life.dir.path().join("edits.json"), edits).unwrap();
        life
    }

    fn disk(&self) -> PathBuf {
        self.dir.path().join("disk")
    }

    fn out(&self) -> PathBuf {
        self.disk().join("results")
    }

    /// Where the results of a state are made once, undisturbed.
    fn aside(&self, state: State) -> PathBuf {
        self.dir.path().join(format!("aside {state:?}"))
    }

    /// Writes the project file of the present state.
    fn write_project(&self) {
        let mut text = self.base.clone();
        if self.state.has_third_epoch {
            let second = self.base.rfind("[[epochs]]").unwrap();
            let end = self.base[second + 2..]
                .find("\n[")
                .map_or(self.base.len(), |at| second + 2 + at);
            let third = self.base[second..end]
                .lines()
                .map(|line| match line.split_once('=') {
                    Some((key, _)) if key.trim() == "name" => "name = \"third\"".to_owned(),
                    Some((key, _)) if key.trim() == "date" => "date = 2035-01-01".to_owned(),
                    _ => line.to_owned(),
                });
            let third: Vec<String> = third.collect();
            text.insert_str(end, &format!("\n\n{}\n", third.join("\n")));
        }
        text.push_str(&format!("\n{}", PARAMETERS[self.state.parameters]));
        if self.state.is_edited {
            text.push_str("\n[edits]\nfile = \"edits.json\"\n");
        }
        fs::write(self.dir.path().join("stonewise.toml"), text).unwrap();
    }

    fn make_sound(&mut self) {
        self.write_project();
        if !self.sound.contains_key(&self.state) {
            let out = self.aside(self.state);
            let (code, log) = run(self.dir.path(), &out, &[]);
            assert!(matches!(code, 0 | 3), "{:?}: {log}", self.state);
            self.sound.insert(self.state, results(&out));
            fs::remove_dir_all(out.join("work")).unwrap();
        }
    }

    fn command(&mut self) -> Command {
        self.begun.insert(self.state);
        let mut command = Command::new(program());
        command
            .arg("run")
            .arg(self.dir.path().join("stonewise.toml"))
            .arg("--out")
            .arg(self.out());
        command.stderr(Stdio::piped());
        command
    }

    fn end(&mut self, what: &str, output: &Output) {
        let log = String::from_utf8_lossy(&output.stderr);
        assert!(!log.contains("panicked"), "{what}: {log}");
        let end = output
            .status
            .code()
            .map_or("a signal".to_owned(), |code| format!("exit code {code}"));
        *self.counts.entry(format!("{what}: {end}")).or_default() += 1;
        match output.status.code() {
            Some(0 | 3) => self.has_finished(),
            Some(_) => {
                let error = log
                    .lines()
                    .find(|line| line.starts_with("error"))
                    .unwrap_or_default();
                assert!(error.contains('/') || error.contains("ulimit"), "{what}: {log}");
            }
            None => {}
        }
    }

    fn has_finished(&mut self) {
        assert!(
            results(&self.out()) == self.sound[&self.state],
            "other results of {:?}",
            self.state
        );
        for (file, _) in contents(&self.out(), &[]) {
            let name = file.to_string_lossy();
            let is_left = name.contains(".partial") || name.contains("-journal");
            assert!(
                !is_left && !file.starts_with("previous") && name != "UNFINISHED.txt",
                "{name} stays"
            );
        }
        self.finished = Some(self.state);
        self.begun.clear();
    }

    /// Whether the results on disk are whole, or marked as unfinished with the finished ones aside.
    fn look(&mut self) {
        let out = self.out();
        let now = results(&out);
        if !out.join("UNFINISHED.txt").exists() {
            if now.is_empty() && self.finished.is_none() {
                return;
            }
            let states = self.begun.iter().chain(&self.finished);
            let state = states.copied().find(|state| self.sound[state] == now);
            assert!(
                state.is_some(),
                "results of no state, and not marked as unfinished"
            );
            if state != self.finished {
                // It was killed after it had finished.
                self.finished = state;
                self.begun.clear();
            }
            return;
        }
        let states = || {
            self.begun
                .iter()
                .chain(&self.finished)
                .map(|state| &self.sound[state])
        };
        for (file, bytes) in &now {
            let is_whole = states().any(|files| files.get(file) == Some(bytes));
            assert!(is_whole, "{} is half-written", file.display());
        }
        let aside = results(&out.join("previous"));
        for (file, bytes) in self.finished.iter().flat_map(|state| &self.sound[state]) {
            let is_kept = [&aside, &now].iter().any(|files| files.get(file) == Some(bytes));
            assert!(is_kept, "{} of the last finished run is lost", file.display());
        }
        for file in aside.keys() {
            let finished = self.finished.map(|state| &self.sound[&state]);
            assert!(
                finished.is_some_and(|files| files.contains_key(file)),
                "{} is not of the last finished run",
                file.display()
            );
        }
    }

    fn run_to_the_end(&mut self) {
        let output = self.command().output().unwrap();
        self.end("run", &output);
        assert!(
            matches!(output.status.code(), Some(0 | 3)),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }

    fn kill(&mut self) {
        let mut child = self.command().spawn().unwrap();
        std::thread::sleep(self.whole.mul_f64(1.2 * self.dice.share().powi(2)));
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        self.end("kill", &output);
    }

    fn change(&mut self) {
        match self.dice.below(3) {
            0 => self.state.parameters = self.dice.below(PARAMETERS.len()),
            1 => self.state.is_edited = !self.state.is_edited,
            _ => self.state.has_third_epoch = !self.state.has_third_epoch,
        }
        self.make_sound();
    }

    fn change_and_kill(&mut self) {
        self.kill();
        self.look();
        self.change();
        self.kill();
    }

    fn damage(&mut self) {
        if self.out().join("work").exists() {
            damage(&self.out(), &mut self.dice);
        }
    }

    fn fill_the_disk(&mut self) {
        if !self.has_disk {
            return;
        }
        let ballast = self.disk().join("ballast");
        let mut df = Command::new("df");
        let df = df
            .args(["--output=avail", "--block-size=1"])
            .arg(self.disk())
            .output()
            .unwrap();
        let free: u64 = String::from_utf8_lossy(&df.stdout)
            .lines()
            .nth(1)
            .unwrap()
            .trim()
            .parse()
            .unwrap();
        let left = (12_000_000.0 * self.dice.share().powi(2)) as u64;
        let size = free.saturating_sub(left).max(1).to_string();
        let filled = Command::new("fallocate")
            .args(["-l", &size])
            .arg(&ballast)
            .status();
        let output = self.command().output().unwrap();
        fs::remove_file(&ballast).unwrap();
        assert!(filled.unwrap().success());
        self.end("full disk", &output);
    }

    fn run_in_short_memory(&mut self) {
        let kib = 150_000 + self.dice.below(600_000);
        let inner = self.command();
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -v \"$0\"; exec \"$@\"", &kib.to_string()]);
        command.arg(inner.get_program()).args(inner.get_args());
        let output = command.output().unwrap();
        self.end("short memory", &output);
    }

    /// The clock jumps back: every file is younger than now.
    fn touch(&mut self) {
        if !self.out().exists() {
            return;
        }
        let future = SystemTime::now() + Duration::from_secs(3_000_000);
        for (file, _) in contents(&self.out(), &[]) {
            let file = File::options().write(true).open(self.out().join(file)).unwrap();
            file.set_modified(future).unwrap();
        }
    }

    fn run_two(&mut self) {
        let mut first = self.command().spawn().unwrap();
        std::thread::sleep(self.whole.mul_f64(0.3 * self.dice.share()));
        let second = self.command().output().unwrap();
        if self.dice.below(2) == 0 {
            first.kill().unwrap();
        }
        let first = first.wait_with_output().unwrap();
        // One of them may have finished before the other was killed.
        for output in [first, second] {
            let is_refused =
                String::from_utf8_lossy(&output.stderr).contains("another run works in this folder");
            match output.status.code() {
                Some(1) if is_refused => {
                    *self.counts.entry("two at once: refused".to_owned()).or_default() += 1
                }
                _ => self.end("two at once", &output),
            }
        }
    }
}

#[test]
#[ignore = "takes minutes to hours; see the top of the file"]
fn results_are_always_those_of_one_state_or_marked_as_unfinished() {
    let number = |name: &str| {
        std::env::var(name)
            .ok()
            .map(|text| text.parse::<usize>().unwrap())
    };
    let seed = number("STONEWISE_SEED").unwrap_or(7);
    let mut life = Life::new(seed as u64);
    println!(
        "a run takes {:.1} s, the disk can be filled: {}",
        life.whole.as_secs_f64(),
        life.has_disk
    );
    for deed in 0..number("STONEWISE_LIFE").unwrap_or(50) {
        let (name, act) = DEEDS[life.dice.below(DEEDS.len())];
        println!("{deed} of seed {seed}: {name}, {:?}", life.state);
        *life.counts.entry(format!("DEED {name}")).or_default() += 1;
        act(&mut life);
        life.look();
    }
    life.run_to_the_end();
    for (what, count) in &life.counts {
        println!("{count:5} {what}");
    }
}
