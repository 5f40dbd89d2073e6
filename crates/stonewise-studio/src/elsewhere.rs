//! A run that this program did not start: how far it has come, from what it leaves in the results' folder.

use schemars::JsonSchema;
use serde::Serialize;
use std::fs;
use std::path::Path;
use std::time::SystemTime;
use stonewise::results::names::WORK_DIR;
use stonewise::{PartShown, StepShown, UNFINISHED_FILE, told};

/// Names the file that a finished step leaves in its folder.
const DONE_FILE: &str = "done";

/// Results that are not finished: a run in a terminal works on them, or was interrupted.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Unfinished {
    /// The step that finished last, as its folder is named.
    pub last_step: Option<String>,
    /// How long ago something was told or finished, seconds.
    pub seconds: u64,
    /// Number of steps whose files are there.
    pub finished: usize,
    /// The steps in order, as the run told them; none where it tells nothing, as units of a plan.
    pub steps: Vec<StepShown>,
    /// What the step at work is at.
    pub part: PartShown,
}

/// How far the run has come that has not finished in this folder; `None` where none has begun.
pub fn unfinished(results: &Path) -> Option<Unfinished> {
    if !results.join(UNFINISHED_FILE).exists() {
        return None;
    }
    let mut done: Vec<(SystemTime, String)> = Vec::new();
    for step in entries(&results.join(WORK_DIR)) {
        let name = step.file_name().to_string_lossy().into_owned();
        let keys = entries(&step.path()).map(|key| key.path().join(DONE_FILE));
        let last = keys
            .filter_map(|file| file.metadata().ok()?.modified().ok())
            .max();
        done.extend(last.map(|time| (time, name)));
    }
    let last = done.iter().max();
    let (told, ago) = told(results).ok().flatten().unzip();
    let finished = last.and_then(|(time, _)| time.elapsed().ok());
    let (steps, part) = told.map(|t| (t.steps, t.part)).unwrap_or_default();
    Some(Unfinished {
        last_step: last.map(|(_, name)| name.clone()),
        seconds: ago.into_iter().chain(finished).min().map_or(0, |t| t.as_secs()),
        finished: done.len(),
        steps,
        part,
    })
}

fn entries(folder: &Path) -> impl Iterator<Item = fs::DirEntry> + use<> {
    fs::read_dir(folder).into_iter().flatten().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_finished_step_is_named() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(unfinished(dir.path()), None);
        fs::write(dir.path().join(UNFINISHED_FILE), "").unwrap();
        assert_eq!(unfinished(dir.path()).unwrap().finished, 0);
        let folder = |step: &str| dir.path().join(WORK_DIR).join(step).join("0123");
        for (step, age) in [("ingest-1", 60), ("label-1", 20), ("ingest-2", 40)] {
            fs::create_dir_all(folder(step)).unwrap();
            let done = fs::File::create(folder(step).join(DONE_FILE)).unwrap();
            done.set_modified(SystemTime::now() - std::time::Duration::from_secs(age))
                .unwrap();
        }
        fs::create_dir_all(folder("match-2")).unwrap();
        let found = unfinished(dir.path()).unwrap();
        assert_eq!((found.last_step.as_deref(), found.finished), (Some("label-1"), 3));
        assert!((19..=30).contains(&found.seconds), "{found:?}");
        let told = r#"{"steps": [{"name": "clouds", "state": "working", "seconds": 2.5}],
            "part": {"what": "points", "detail": "", "done": 3, "total": 8}}"#;
        fs::write(dir.path().join(WORK_DIR).join("progress.json"), told).unwrap();
        let found = unfinished(dir.path()).unwrap();
        assert_eq!((found.steps.len(), found.part.done), (1, 3));
        assert!(found.seconds < 10, "{found:?}");
    }
}
