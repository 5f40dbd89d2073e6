//! What every step needs: where to work, whom to tell, how to resume.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::step::{Keeps, Key, StepDir, StepStore};
use crate::project::Project;
use crate::warnings::{Warning, Warnings};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use stonewise_core::progress::Progress;

/// Where a step notes its warnings.
const WARNINGS: &str = "warnings.json";

/// Wall time and memory of one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepTime {
    /// Name of the step.
    pub step: String,
    /// Wall time, seconds; small where earlier results were taken.
    pub seconds: f64,
    /// Whether the results of an earlier run were taken.
    pub resumed: bool,
    /// Highest memory of the process so far, bytes; `None` where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
}

/// One run of a project in a folder.
pub struct Context<'a> {
    /// The project.
    pub project: &'a Project,
    /// Where results go.
    pub out: PathBuf,
    /// Where steps keep their files.
    pub store: Arc<StepStore>,
    /// Whom to tell, and who may stop the run.
    pub progress: &'a dyn Progress,
    /// What went wrong without stopping the run.
    pub warnings: Warnings,
    times: Mutex<Vec<StepTime>>,
}

impl<'a> Context<'a> {
    /// Makes the folders of a run that keeps its steps beside its results.
    pub fn new(project: &'a Project, out: &Path, progress: &'a dyn Progress) -> Result<Self> {
        let store = StepStore::new(&out.join("work"), Keeps::Newest)?;
        Self::with_store(project, out, Arc::new(store), progress)
    }

    /// The same with the steps in a store that other runs may share.
    pub fn with_store(
        project: &'a Project,
        out: &Path,
        store: Arc<StepStore>,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        fs::create_dir_all(out).map_err(Error::io("making the result folder", out))?;
        Ok(Self {
            project,
            out: out.to_path_buf(),
            store,
            progress,
            warnings: Warnings::default(),
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
        self.progress.check()?;
        let started = Instant::now();
        let (dir, resumed) = self.store.step(name, key, |dir| {
            let warnings = Warnings::default();
            make(dir, &warnings)?;
            write_json(&dir.file(WARNINGS), &warnings.sorted())
        })?;
        let warnings: Vec<Warning> = read_json(&dir.file(WARNINGS))?;
        warnings.into_iter().for_each(|w| self.warnings.push(w));
        self.record(name, started, resumed);
        Ok(dir)
    }

    /// Does a piece of work that keeps nothing between runs, and notes its time.
    pub fn timed<T>(&self, name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        self.progress.check()?;
        let started = Instant::now();
        let result = work()?;
        self.record(name, started, false);
        Ok(result)
    }

    /// Digest of an input file or folder, read once.
    pub fn digest(&self, path: &Path) -> Result<String> {
        self.store.digest(path)
    }

    /// Times of all steps so far, in order.
    pub fn times(&self) -> Vec<StepTime> {
        self.times.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn record(&self, step: &str, started: Instant, resumed: bool) {
        let time = StepTime {
            step: step.to_owned(),
            seconds: started.elapsed().as_secs_f64(),
            resumed,
            peak_memory_bytes: peak_memory_bytes(),
        };
        self.times
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(time);
    }
}

/// Highest resident memory of this process, where Linux tells it.
fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    line.split_whitespace()
        .nth(1)?
        .parse::<u64>()
        .ok()
        .map(|kib| kib * 1024)
}
