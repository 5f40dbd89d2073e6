//! The work in the background: a run, and the look at a survey. Pages are told when something changes.

use schemars::JsonSchema;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use stonewise::{PartShown, StepShown, Steps};
use stonewise_core::progress::Progress;

/// Most lines of a run's log that are kept.
const LINES: usize = 200;

/// What works in the background.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Job {
    /// A run of the project.
    #[default]
    Run,
    /// A training of the detector.
    Teach,
}

/// What a run is at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// None was started here.
    #[default]
    Idle,
    /// It works.
    Running,
    /// It was asked to stop, and will at the next moment at which nothing is lost.
    Stopping,
    /// It was stopped; the next run goes on from there.
    Stopped,
    /// It has finished.
    Done,
    /// It could not go on.
    Failed,
}

impl Phase {
    /// Whether a thread is at work.
    pub fn is_at_work(self) -> bool {
        matches!(self, Self::Running | Self::Stopping)
    }
}

/// A run, or a training, as pages show it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct RunShown {
    /// Which of them.
    pub job: Job,
    /// What it is at.
    pub phase: Phase,
    /// Seconds since it began, until it ended.
    pub seconds: f64,
    /// Its steps in order.
    pub steps: Vec<StepShown>,
    /// What the step at work is at.
    pub part: PartShown,
    /// The last lines of its log.
    pub lines: VecDeque<String>,
    /// Why the results as a whole are in doubt, one sentence each.
    pub doubts: Vec<String>,
    /// What was left out, such as edits without effect, one sentence each.
    pub skipped: Vec<String>,
    /// The verdict in a sentence, once there is one.
    pub sentence: Option<String>,
    /// Why it failed.
    pub error: Option<String>,
}

/// A run and who watches it.
#[derive(Default)]
pub struct Run {
    inner: Mutex<Inner>,
    changed: Condvar,
    cancelled: AtomicBool,
}

#[derive(Default)]
struct Inner {
    shown: RunShown,
    /// Counts changes, those of other things that pages show included.
    version: u64,
    began: Option<Instant>,
    steps: Steps,
}

impl Run {
    /// A run or a training begins; `false` where one is at work.
    pub fn begin(&self, job: Job) -> bool {
        let mut inner = self.inner();
        if inner.shown.phase.is_at_work() {
            return false;
        }
        self.cancelled.store(false, Ordering::Relaxed);
        inner.shown = RunShown {
            job,
            phase: Phase::Running,
            ..RunShown::default()
        };
        (inner.began, inner.steps) = (Some(Instant::now()), Steps::default());
        self.tell(inner);
        true
    }

    /// The run has ended like this; `outcome` sets what came out.
    pub fn end(&self, phase: Phase, outcome: impl FnOnce(&mut RunShown)) {
        let mut inner = self.inner();
        inner.steps.leave();
        inner.shown.seconds = inner.began.take().map_or(0.0, |b| b.elapsed().as_secs_f64());
        inner.shown.phase = phase;
        outcome(&mut inner.shown);
        self.tell(inner);
    }

    /// Asks the run to stop.
    pub fn stop(&self) {
        let mut inner = self.inner();
        if inner.shown.phase == Phase::Running {
            self.cancelled.store(true, Ordering::Relaxed);
            inner.shown.phase = Phase::Stopping;
            self.tell(inner);
        }
    }

    /// Something else that pages show has changed.
    pub fn touch(&self) {
        let inner = self.inner();
        self.tell(inner);
    }

    /// The run as it is, and the number of its version.
    pub fn shown(&self) -> (RunShown, u64) {
        let inner = self.inner();
        let mut shown = inner.shown.clone();
        if let Some(began) = inner.began {
            shown.seconds = began.elapsed().as_secs_f64();
        }
        (shown.steps, shown.part) = inner.steps.shown();
        (shown, inner.version)
    }

    /// What the run is at.
    pub fn phase(&self) -> Phase {
        self.inner().shown.phase
    }

    /// Waits until there is a later version than this one, or so long.
    pub fn wait(&self, version: u64, at_most: Duration) {
        let inner = self.inner();
        let waited = self
            .changed
            .wait_timeout_while(inner, at_most, |inner| inner.version == version);
        drop(waited);
    }

    /// Takes over a change of the run's steps.
    fn step(&self, change: impl FnOnce(&mut Steps)) {
        let mut inner = self.inner();
        change(&mut inner.steps);
        self.tell(inner);
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, mut inner: MutexGuard<'_, Inner>) {
        inner.version += 1;
        drop(inner);
        self.changed.notify_all();
    }
}

impl Progress for Run {
    fn begin(&self, what: &str, total: u64) {
        self.step(|steps| steps.begin(what, total));
    }

    fn advance(&self, units: u64) {
        self.step(|steps| steps.advance(units));
    }

    fn agenda(&self, names: &[String]) {
        self.step(|steps| steps.agenda(names));
    }

    fn enter(&self, step: usize) {
        self.step(|steps| steps.enter(step));
    }

    fn take_over(&self, step: usize) {
        self.step(|steps| steps.take_over(step));
    }

    fn detail(&self, unit: &str) {
        self.step(|steps| steps.detail(unit));
    }

    fn note(&self, line: &str) {
        let mut inner = self.inner();
        inner.shown.lines.push_back(line.to_owned());
        while inner.shown.lines.len() > LINES {
            inner.shown.lines.pop_front();
        }
        self.tell(inner);
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise::StepState;

    #[test]
    fn steps_follow_what_a_run_says_of_itself() {
        let run = Run::default();
        assert!(run.begin(Job::Run) && !run.begin(Job::Teach));
        run.agenda(&["clouds", "stones", "motions"].map(str::to_owned));
        run.take_over(0);
        run.enter(1);
        Progress::begin(&run, "photos", 3);
        run.advance(2);
        run.enter(2);
        let states = |run: &Run| run.shown().0.steps.iter().map(|s| s.state).collect::<Vec<_>>();
        assert_eq!(
            states(&run),
            [StepState::Earlier, StepState::Done, StepState::Working]
        );
        assert_eq!(run.shown().0.part, PartShown::default());
        run.stop();
        assert!(run.is_cancelled());
        run.end(Phase::Stopped, |_| {});
        assert_eq!(run.phase(), Phase::Stopped);
        // The next run starts afresh.
        assert!(run.begin(Job::Teach) && !run.is_cancelled());
    }

    #[test]
    fn a_watcher_wakes_at_the_next_change() {
        let run = Run::default();
        let (_, version) = run.shown();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(20));
                run.touch();
            });
            let began = Instant::now();
            run.wait(version, Duration::from_secs(20));
            assert!(began.elapsed() < Duration::from_secs(10));
        });
        assert_eq!(run.shown().1, version + 1);
    }
}
