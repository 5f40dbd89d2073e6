//! Cuts two clouds into tiles on disk, as the first step of a run does; `bench/speed.py` takes the time.
//!
//! `cargo run --release -p stonewise --example tile_speed -- FIRST.laz SECOND.laz DIR`

use std::path::{Path, PathBuf};
use stonewise::{OutputFolder, Owner, Project, tile_clouds};
use stonewise_core::change::M3c2Params;
use stonewise_core::progress::Silent;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [first, second, out] = arguments.as_slice() else {
        return Err("usage: tile_speed FIRST.laz SECOND.laz DIR".into());
    };
    let clouds = [first.clone(), second.clone()];
    let project = Project::of_clouds(first, second, M3c2Params::default());
    let owner = Owner::inputs("clouds", &clouds);
    let folder = OutputFolder::of_inputs(Path::new(out), &owner, &clouds, &["work"], false)?;
    let points = tile_clouds(&project, &folder, &Silent)?;
    if points == 0 {
        return Err("the clouds hold no points".into());
    }
    Ok(())
}
