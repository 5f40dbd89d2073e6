//! Cuts two clouds into tiles on disk, as the first step of a run does; `lab/speed.py` takes the time.
//!
//! `cargo run --release -p stonewise-lab -- tiles FIRST.laz SECOND.laz DIR`

use crate::Outcome;
use crate::words::Words;
use std::path::{Path, PathBuf};
use stonewise::{OutputFolder, Owner, Project, tile_clouds};
use stonewise_core::change::M3c2Params;
use stonewise_core::progress::Silent;

pub fn run(words: &Words) -> Outcome {
    let [first, second, out] = words.as_slice() else {
        return Err("usage: tiles FIRST.laz SECOND.laz DIR".into());
    };
    let [first, second] = [first, second].map(PathBuf::from);
    let clouds = [first.clone(), second.clone()];
    let project = Project::of_clouds(&first, &second, M3c2Params::default());
    let owner = Owner::inputs("clouds", &clouds);
    let folder = OutputFolder::of_inputs(Path::new(out), &owner, &clouds, &["work"], false)?;
    let points = tile_clouds(&project, &folder, &Silent)?;
    if points == 0 {
        return Err("the clouds hold no points".into());
    }
    Ok(())
}
