//! What every step needs: where to work, whom to tell, how to resume.

use crate::error::Result;
use crate::files::{create_results_folder, read_json, write_json};
use crate::output::OutputFolder;
use crate::pipeline::agenda::Agenda;
use crate::pipeline::clock::Clock;
use crate::project::Project;
use crate::results::names::WORK_DIR;
use crate::results::records::StepTime;
use crate::storage::step::{Key, Origin, StepDir};
use crate::storage::store::{Keeps, StepStore};
use crate::warnings::{Warning, Warnings};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use stonewise_core::progress::Progress;
use stonewise_segment::Weights;

/// Step under which notes on the project file are recorded.
pub const PROJECT_STEP: &str = "project";

/// Where a step notes its warnings.
const WARNINGS: &str = "warnings.json";

/// The step on the agenda whose work is done.
#[derive(Default)]
struct Line {
    /// Its place; `None` where it is not listed.
    place: Option<usize>,
    /// Whether the caller was told that it begins.
    is_entered: bool,
}

/// One run of a project in a folder.
pub struct Context<'a> {
    /// The project.
    pub project: &'a Project,
    /// Where results go.
    pub out: PathBuf,
    /// Where steps keep their files.
    pub store: Arc<StepStore>,
    /// The folder that results go to, claimed for this run; `None` within an experiment, which claims its
    /// own.
    pub output: Option<&'a OutputFolder>,
    /// Whom to tell, and who may stop the run.
    pub progress: &'a dyn Progress,
    /// What went wrong without stopping the run.
    pub warnings: Warnings,
    /// Whether the work goes on in spite of findings against the survey; `None`: it is not looked at.
    pub forced: Option<bool>,
    /// The steps that the caller was told of; empty where the run is part of something larger.
    pub agenda: Agenda,
    line: Mutex<Line>,
    /// How long other processes took for the steps that they did, by the name of the step.
    pub unit_times: BTreeMap<String, StepTime>,
    times: Mutex<Vec<StepTime>>,
}

impl<'a> Context<'a> {
    /// Makes the folders of a run that keeps its steps beside its results.
    pub fn new(project: &'a Project, output: &'a OutputFolder, progress: &'a dyn Progress) -> Result<Self> {
        let store = StepStore::new(&output.path().join(WORK_DIR), Keeps::Newest)?;
        let mut context = Self::with_store(project, output.path(), Arc::new(store), progress)?;
        context.output = Some(output);
        Ok(context)
    }

    /// The context of a process that does one unit of a plan.
    pub fn of_unit(
        project: &'a Project,
        output: &'a OutputFolder,
        digests: BTreeMap<PathBuf, String>,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let store = StepStore::of_unit(&output.path().join(WORK_DIR), digests)?;
        let mut context = Self::with_store(project, output.path(), Arc::new(store), progress)?;
        context.output = Some(output);
        Ok(context)
    }

    /// The context of a run whose steps lie in a store that other runs may share.
    pub fn with_store(
        project: &'a Project,
        out: &Path,
        store: Arc<StepStore>,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        create_results_folder(out)?;
        let warnings = Warnings::default();
        for note in &project.notes {
            warnings.notice(PROJECT_STEP, project.path.to_string_lossy(), note.clone());
        }
        Ok(Self {
            project,
            out: out.to_path_buf(),
            store,
            output: None,
            progress,
            warnings,
            forced: None,
            agenda: Agenda::default(),
            line: Mutex::default(),
            unit_times: BTreeMap::new(),
            times: Mutex::default(),
        })
    }

    /// Does a step, or takes the files and warnings that the same step left earlier.
    pub fn step(
        &self,
        name: &str,
        key: Key,
        make: impl FnOnce(&StepDir, &Warnings) -> Result<()>,
    ) -> Result<StepDir> {
        self.step_in(name, name, key, &[], make)
    }

    /// Does a step as [`Self::step`] does, for one that shares a folder with others, or that makes files outside
    /// its folder, too.
    pub fn step_in(
        &self,
        folder: &str,
        name: &str,
        key: Key,
        published: &[PathBuf],
        make: impl FnOnce(&StepDir, &Warnings) -> Result<()>,
    ) -> Result<StepDir> {
        self.progress.check()?;
        let started = Clock::start();
        let (dir, origin) = self.store.step(folder, key, published, |dir| {
            self.enter();
            let warnings = Warnings::default();
            make(dir, &warnings)?;
            write_json(&dir.file(WARNINGS), &warnings.sorted())
        })?;
        if let Origin::MadeAgain(why) = &origin {
            self.progress.note(&format!("step {name} was done again: {why}"));
        }
        let warnings: Vec<Warning> = read_json(&dir.file(WARNINGS))?;
        warnings.into_iter().for_each(|w| self.warnings.push(w));
        self.record(name, started, origin == Origin::Found);
        Ok(dir)
    }

    /// Does a piece of work that keeps nothing between runs, and notes its time.
    pub fn timed<T>(&self, name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        self.progress.check()?;
        self.enter();
        let started = Clock::start();
        let result = work()?;
        self.record(name, started, false);
        Ok(result)
    }

    /// Digest of an input file or folder, read once.
    pub fn digest(&self, path: &Path) -> Result<String> {
        self.store.digest(path)
    }

    /// Digest of the weights of a detector.
    pub fn weights_digest(&self, weights: &Weights) -> Result<String> {
        self.store.weights_digest(weights)
    }

    /// Times of all steps so far, in order.
    pub fn times(&self) -> Vec<StepTime> {
        self.times.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Does the work of a step on the agenda, by its name. If all of it was done earlier, the caller is told so.
    pub fn in_line<T>(&self, name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let Some(place) = self.agenda.place(name) else {
            return work();
        };
        let own = Line {
            place: Some(place),
            is_entered: false,
        };
        let outer = std::mem::replace(&mut *self.line(), own);
        let result = work();
        let own = std::mem::replace(&mut *self.line(), outer);
        if result.is_ok() && !own.is_entered {
            self.progress.take_over(place);
        }
        result
    }

    /// Tells the caller that the present step works.
    fn enter(&self) {
        let mut line = self.line();
        if let Some(place) = line.place {
            line.is_entered = true;
            self.progress.enter(place);
        }
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn record(&self, step: &str, started: Clock, resumed: bool) {
        let by_unit = self.unit_times.get(step).filter(|_| resumed);
        let time = by_unit
            .cloned()
            .unwrap_or_else(|| started.step_time(step, resumed));
        self.times
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(time);
    }
}
