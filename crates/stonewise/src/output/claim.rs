//! An output folder in the hands of one command.

use super::digests::Digests;
use super::inputs::refuse_overwriting;
use super::lock::FolderLock;
use super::marker::{self, Found, Owner};
use super::partials::sweep;
use super::previous;
use super::result_names::{is_made_anew, is_result, result_folders};
use crate::error::{Error, Result};
use crate::files::resolved;
use crate::project::Project;
use crate::results::names::stones_in;
use std::fs;
use std::path::{Path, PathBuf};

/// A folder that this command alone writes into, until it is dropped.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    forced: bool,
    _lock: FolderLock,
}

impl OutputFolder {
    /// Claims a folder for the results of a project, made if need be.
    ///
    /// # Errors
    /// Results would replace an input (also with `force`); the folder holds something else and `force` is not
    /// given; another run works in it; it cannot be made.
    pub fn of_project(path: &Path, project: &Project, force: bool) -> Result<Self> {
        let folders = result_folders(project);
        refuse_overwriting(path, &project.inputs(), &folders, &is_result)?;
        let claimed = Self::claim(path, &Owner::project(&project.path, &project.name), force)?;
        claimed.sweep(project);
        Ok(claimed)
    }

    /// Removes temporary files that killed commands left among the results of a project. Only where no other
    /// command works in the folder.
    pub(crate) fn sweep(&self, project: &Project) {
        let folders = result_folders(project);
        sweep(&self.path, &|below| folders.iter().any(|f| below.starts_with(f)));
    }

    /// Claims a folder for anything else. `inputs`: what must not be replaced; `written`: names of files and
    /// folders that the command writes in it.
    ///
    /// # Errors
    /// As [`Self::of_project`].
    pub fn of_inputs(
        path: &Path,
        owner: &Owner,
        inputs: &[PathBuf],
        written: &[&str],
        force: bool,
    ) -> Result<Self> {
        let written: Vec<PathBuf> = written.iter().map(PathBuf::from).collect();
        refuse_overwriting(path, inputs, &written, &|_| false)?;
        let claimed = Self::claim(path, owner, force)?;
        sweep(path, &|_| true);
        Ok(claimed)
    }

    /// Takes the folder of a finished run, to write some of its results again.
    ///
    /// # Errors
    /// Another run works in it; the last run in it has not finished.
    pub fn of_results(path: &Path) -> Result<Self> {
        stones_in(path)?;
        Ok(Self {
            path: path.to_path_buf(),
            forced: false,
            _lock: FolderLock::take(path)?,
        })
    }

    /// Takes the folder of a plan to do one of its units, beside others who do.
    ///
    /// # Errors
    /// A run, or the making of a plan, is under way; files cannot be locked there.
    pub(crate) fn of_unit(path: &Path) -> Result<Self> {
        Ok(Self {
            path: path.to_path_buf(),
            forced: false,
            _lock: FolderLock::take_for_units(path)?,
        })
    }

    /// Keeps the folder for a plan whose units other processes do.
    ///
    /// # Errors
    /// A run has begun in between.
    pub(crate) fn admit_units(self) -> Result<Self> {
        let path = self.path.clone();
        drop(self);
        Self::of_unit(&path)
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the work goes on in spite of findings against it (`--force`).
    pub fn is_forced(&self) -> bool {
        self.forced
    }

    /// Moves results of an earlier run aside, see [`super::PREVIOUS_DIR`], and marks the folder as
    /// unfinished.
    pub(crate) fn begin_results(&self, project: &Project) -> Result<()> {
        previous::set_aside(&self.path, project)
    }

    /// Brings a result of the last run back that this one may take over; `file`: relative to the folder.
    pub(crate) fn bring_back(&self, file: &Path) -> Result<()> {
        previous::bring_back(&self.path, file)
    }

    /// Notes the digests of all results and says that they are finished; `all`: nothing of an earlier run is
    /// needed any more.
    pub(crate) fn finish_results(&self, project: &Project, all: bool) -> Result<()> {
        let results = previous::results_in(&self.path, project)?;
        Digests::of(&self.path, &results)?.write(&self.path)?;
        previous::finish(&self.path, &results, all)
    }

    /// Notes the digests of results that a command has made anew from others: the report, the layers, scores
    /// against a truth. Results whose digests were never noted stay so.
    ///
    /// # Errors
    /// The digests cannot be read or written.
    pub fn note_made_anew(&self) -> Result<()> {
        let Some(mut digests) = Digests::read(&self.path)? else {
            return Ok(());
        };
        let present = previous::named_results_in(&self.path)?;
        let anew: Vec<PathBuf> = present.into_iter().filter(|file| is_made_anew(file)).collect();
        digests.replace(Digests::of(&self.path, &anew)?);
        digests.write(&self.path)
    }

    fn claim(path: &Path, owner: &Owner, force: bool) -> Result<Self> {
        check(path, owner, force)?;
        fs::create_dir_all(path).map_err(Error::io("creating the results folder", path))?;
        let lock = FolderLock::take(path)?;
        // Another command may have come first in between.
        let found = check(path, owner, force)?;
        if !matches!(found, Found::Ours) || !resolved(path).join("work/marker.json").exists() {
            marker::write(path, owner)?;
        }
        Ok(Self {
            path: path.to_path_buf(),
            forced: force,
            _lock: lock,
        })
    }
}

/// Whether the folder may be used.
fn check(path: &Path, owner: &Owner, force: bool) -> Result<Found> {
    if path.exists() && !path.is_dir() {
        return Err(Error::Output {
            path: path.to_path_buf(),
            message: "a file of this name is there: give a folder as --out".to_owned(),
        });
    }
    let found = marker::look(path, owner)?;
    match &found {
        Found::Other(whose) if !force => Err(Error::Output {
            path: path.to_path_buf(),
            message: match whose {
                Some(what) => format!(
                    "the folder holds the results of something else ({what}): give another --out, or --force to \
                     write over these results"
                ),
                None => "the folder is not empty, and stonewise did not make it: give another --out, or --force to write \
                         the results into it"
                    .to_owned(),
            },
        }),
        _ => Ok(found),
    }
}
