//! The command line, as typed.

use clap::{Args as ClapArgs, Parser, Subcommand};
use std::path::PathBuf;

/// Measures how a masonry dam moves, stone by stone, from point clouds and posed photos.
#[derive(Debug, Parser)]
#[command(name = "stonewise", version, max_term_width = 110)]
pub struct Args {
    /// Say nothing but errors.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Threads to use; all cores when absent. Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Do everything: from clouds and photos to results and a report; resumes after an interruption.
    #[command(after_help = "Example:\n  stonewise run survey/stonewise.toml --out results/")]
    Run(ProjectArgs),
    /// Write a project file from the surveys found in a folder.
    #[command(after_help = "Example:\n  stonewise init survey/        # writes survey/stonewise.toml")]
    Init(InitArgs),
    /// Bring the masks of every photo into one label image.
    #[command(after_help = "Example:\n  stonewise segment survey/stonewise.toml --out results/")]
    Segment(ProjectArgs),
    /// Carry the labels of the photos into the point clouds.
    #[command(after_help = "Example:\n  stonewise label survey/stonewise.toml --out results/")]
    Label(ProjectArgs),
    /// Find the same stones in two epochs.
    #[command(after_help = "Example:\n  stonewise match survey/stonewise.toml --out results/")]
    Match(ProjectArgs),
    /// Measure the motion of every matched stone.
    #[command(after_help = "Example:\n  stonewise register survey/stonewise.toml --out results/")]
    Register(ProjectArgs),
}

/// A project and a folder for its results.
#[derive(Debug, ClapArgs)]
pub struct ProjectArgs {
    /// The project file.
    pub project: PathBuf,
    /// Folder of the results; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `init`.
#[derive(Debug, ClapArgs)]
pub struct InitArgs {
    /// Folder with one folder per epoch, in time order by name.
    pub dir: PathBuf,
}
