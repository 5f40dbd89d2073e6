//! How far a run has come, so that pages can show it: in memory, and in a file that other programs read while it works.

use crate::files::{is_there, read_json, write_json};
use crate::results::names::WORK_DIR;
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use stonewise_core::progress::Progress;

/// In the folder of the steps, while a run works.
const FILE: &str = "progress.json";
/// Time between two writings of the file at least; a step that begins or ends is written at once.
const PAUSE: Duration = Duration::from_millis(500);

/// What became of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepState {
    /// It comes later.
    Waiting,
    /// It is at work.
    Working,
    /// It has ended.
    Done,
    /// An earlier run did it.
    Earlier,
}

/// A step of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepShown {
    /// What it does, in words.
    pub name: String,
    /// What became of it.
    pub state: StepState,
    /// How long it has worked, seconds.
    pub seconds: f64,
}

/// What the step at work is at.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PartShown {
    /// What it does, in words.
    pub what: String,
    /// Which unit, such as a photo.
    pub detail: String,
    /// Units that are done.
    pub done: u64,
    /// All units; 0 where that is not known.
    pub total: u64,
}

/// The steps of a run, as it reports them.
#[derive(Clone, Debug, Default)]
pub struct Steps {
    steps: Vec<StepShown>,
    part: PartShown,
    /// The step at work, and since when.
    at: Option<(usize, Instant)>,
}

impl Steps {
    /// Takes what [`Progress::agenda`] reports.
    pub fn agenda(&mut self, steps: &[String]) {
        let step = |name: &String| StepShown {
            name: name.clone(),
            state: StepState::Waiting,
            seconds: 0.0,
        };
        self.at = None;
        self.steps = steps.iter().map(step).collect();
    }

    /// Takes what [`Progress::enter`] reports.
    pub fn enter(&mut self, step: usize) {
        if self.at.is_some_and(|(at, _)| at == step) {
            return;
        }
        self.leave();
        if let Some(shown) = self.steps.get_mut(step) {
            shown.state = StepState::Working;
            self.at = Some((step, Instant::now()));
        }
    }

    /// The step at work has ended, or goes on later.
    pub fn leave(&mut self) {
        self.part = PartShown::default();
        if let Some((step, since)) = self.at.take()
            && let Some(step) = self.steps.get_mut(step)
        {
            step.state = StepState::Done;
            step.seconds += since.elapsed().as_secs_f64();
        }
    }

    /// Takes what [`Progress::take_over`] reports.
    pub fn take_over(&mut self, step: usize) {
        if let Some(shown) = self.steps.get_mut(step)
            && shown.state == StepState::Waiting
        {
            shown.state = StepState::Earlier;
        }
    }

    /// Takes what [`Progress::begin`] reports.
    pub fn begin(&mut self, what: &str, total: u64) {
        self.part = PartShown {
            what: what.to_owned(),
            total,
            ..PartShown::default()
        };
    }

    /// Takes what [`Progress::advance`] reports.
    pub fn advance(&mut self, units: u64) {
        self.part.done += units;
    }

    /// Takes what [`Progress::detail`] reports.
    pub fn detail(&mut self, unit: &str) {
        unit.clone_into(&mut self.part.detail);
    }

    /// The steps in order, up to now, and what the one at work is at.
    pub fn shown(&self) -> (Vec<StepShown>, PartShown) {
        let mut steps = self.steps.clone();
        if let Some((step, since)) = self.at
            && let Some(step) = steps.get_mut(step)
        {
            step.seconds += since.elapsed().as_secs_f64();
        }
        (steps, self.part.clone())
    }
}

/// What the file holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Told {
    /// The steps in order.
    pub steps: Vec<StepShown>,
    /// What the step at work is at.
    pub part: PartShown,
}

/// What the run that works in a folder of results, or was interrupted there, reported last, and how long ago; `None`
/// where none reported anything.
///
/// # Errors
/// The file is damaged.
pub fn told(results: &Path) -> Result<Option<(Told, Duration)>> {
    let path = file_of(results);
    if !is_there(&path)? {
        return Ok(None);
    }
    let told = read_json(&path)?;
    let written = path.metadata().and_then(|m| m.modified());
    let ago = written.ok().and_then(|t| t.elapsed().ok());
    Ok(Some((told, ago.unwrap_or_default())))
}

/// Passes on what a run reports, and writes it for those who watch from another program.
pub(crate) struct Watched<'a> {
    to: &'a dyn Progress,
    file: PathBuf,
    inner: Mutex<(Steps, Option<Instant>)>,
}

impl<'a> Watched<'a> {
    /// For a run in this folder of results.
    pub fn new(to: &'a dyn Progress, results: &Path) -> Self {
        Self {
            to,
            file: file_of(results),
            inner: Mutex::default(),
        }
    }

    /// The run has finished: there is nothing to watch.
    ///
    /// # Errors
    /// The file cannot be removed.
    pub fn finish(&self) -> Result<()> {
        match is_there(&self.file)? {
            true => fs::remove_file(&self.file).map_err(Error::io("removing", &self.file)),
            false => Ok(()),
        }
    }

    fn tell(&self, change: impl FnOnce(&mut Steps), at_once: bool) {
        let mut inner = self.inner();
        let (steps, written) = &mut *inner;
        change(steps);
        if !at_once && written.is_some_and(|w| w.elapsed() < PAUSE) {
            return;
        }
        *written = Some(Instant::now());
        let (steps, part) = steps.shown();
        // A file that cannot be written does not hinder the run.
        let _ = write_json(&self.file, &Told { steps, part });
    }

    fn inner(&self) -> MutexGuard<'_, (Steps, Option<Instant>)> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Watched<'_> {
    fn begin(&self, what: &str, total: u64) {
        self.tell(|steps| steps.begin(what, total), false);
        self.to.begin(what, total);
    }

    fn advance(&self, units: u64) {
        self.tell(|steps| steps.advance(units), false);
        self.to.advance(units);
    }

    fn agenda(&self, names: &[String]) {
        self.tell(|steps| steps.agenda(names), true);
        self.to.agenda(names);
    }

    fn enter(&self, step: usize) {
        self.tell(|steps| steps.enter(step), true);
        self.to.enter(step);
    }

    fn take_over(&self, step: usize) {
        self.tell(|steps| steps.take_over(step), true);
        self.to.take_over(step);
    }

    fn detail(&self, unit: &str) {
        self.tell(|steps| steps.detail(unit), false);
        self.to.detail(unit);
    }

    fn note(&self, line: &str) {
        self.to.note(line);
    }

    fn is_cancelled(&self) -> bool {
        self.to.is_cancelled()
    }
}

fn file_of(results: &Path) -> PathBuf {
    results.join(WORK_DIR).join(FILE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::progress::Silent;

    #[test]
    fn another_program_reads_what_a_run_tells() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join(WORK_DIR)).unwrap();
        assert_eq!(told(dir.path()).unwrap(), None);
        let run = Watched::new(&Silent, dir.path());
        run.agenda(&["clouds", "stones", "motions"].map(str::to_owned));
        run.take_over(0);
        run.enter(1);
        let read = || told(dir.path()).unwrap().unwrap().0;
        let states = || read().steps.iter().map(|s| s.state).collect::<Vec<_>>();
        assert_eq!(
            states(),
            [StepState::Earlier, StepState::Working, StepState::Waiting]
        );
        // What changes often is not written each time, but after a pause.
        run.begin("photos", 3);
        (0..1000).for_each(|_| run.advance(1));
        std::thread::sleep(PAUSE);
        run.advance(1);
        assert_eq!((read().part.what.as_str(), read().part.done), ("photos", 1001));
        run.enter(2);
        assert_eq!(
            states(),
            [StepState::Earlier, StepState::Done, StepState::Working]
        );
        assert_eq!(read().part, PartShown::default());
        run.finish().unwrap();
        assert_eq!(told(dir.path()).unwrap(), None);
    }
}
