//! The command line, as typed.

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use stonewise::experiment::{Dimension, Influence};

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
    /// Write into a folder that holds other things (files of the same names are replaced; inputs never are),
    /// and run a survey that cannot be right.
    #[arg(long, global = true)]
    pub force: bool,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Do everything: from clouds and photos to results and a report; resumes after an interruption.
    #[command(
        after_help = "Example:\n  stonewise run survey/stonewise.toml --out results/\n  \
        stonewise run survey/stonewise.toml --out results/ --exit-on alarm\n\n\
        Exit codes: 0 done, 1 failed, 2 wrong arguments or project file, 3 inputs left out or results in doubt, 4 as --exit-on asks."
    )]
    Run(RunArgs),
    /// Make a small survey with known motion, and measure it.
    #[command(after_help = "Example:\n  stonewise demo --out demo")]
    Demo(DemoArgs),
    /// Look at a survey in seconds, and say what will go wrong: units, frames, overlap, photos, cameras,
    /// disk.
    #[command(after_help = "Example:\n  stonewise check survey/stonewise.toml\n\n\
        The table goes to stdout, a page with pictures beside the project file. Exit code 3 where something is doubtful.")]
    Check(CheckArgs),
    /// Write a project file from the surveys found in a folder.
    #[command(after_help = "Example:\n  stonewise init survey/        # writes survey/stonewise.toml")]
    Init(InitArgs),
    /// Make two disjoint halves of one epoch, to test the method against a known motion.
    #[command(after_help = "Example:\n  stonewise split survey/stonewise.toml --seed 1 --out halves/")]
    Split(SplitArgs),
    /// Find the stones of photos; for a project, bring masks or found stones into one label image a photo.
    #[command(after_help = "Examples:\n  stonewise segment photos/ --out stones/\n  \
        stonewise segment photos/ --out stones/ --model training/model.safetensors --reference masks.json\n  \
        stonewise segment survey/stonewise.toml --out results/")]
    Segment(SegmentArgs),
    /// Train the stone detector: on a few labelled photos of a wall, or on rendered photos of masonry in general.
    #[command(
        after_help = "Examples:\n  stonewise train --rendered --from none --minutes 60 --out training/\n\n\
        A training goes on where it stopped when the same command is given again."
    )]
    Train(TrainArgs),
    /// Carry the labels of the photos into the point clouds.
    #[command(after_help = "Example:\n  stonewise label survey/stonewise.toml --out results/")]
    Label(ProjectArgs),
    /// Find the same stones in two epochs.
    #[command(after_help = "Example:\n  stonewise match survey/stonewise.toml --out results/")]
    Match(ProjectArgs),
    /// Measure the motion of every matched stone.
    #[command(after_help = "Example:\n  stonewise register survey/stonewise.toml --out results/")]
    Register(ProjectArgs),
    /// Compare clouds along their normals (Lague et al. 2013).
    #[command(
        after_help = "Examples:\n  stonewise m3c2 survey/stonewise.toml --out results/\n  \
        stonewise m3c2 before.laz after.laz --out results/ --params m3c2_params.txt"
    )]
    M3c2(CompareArgs),
    /// Distance from each point of the second cloud to the nearest of the first.
    #[command(after_help = "Example:\n  stonewise c2c before.laz after.laz --out results/")]
    C2c(CompareArgs),
    /// Distance from each point of a cloud to a mesh.
    #[command(after_help = "Example:\n  stonewise c2m mesh.ply cloud.laz --out results/")]
    C2m(CompareArgs),
    /// Score results against truth.
    #[command(after_help = "Example:\n  stonewise evaluate results/ --truth truth/stones.csv")]
    Evaluate(EvaluateArgs),
    /// Write the report of a finished run again, from its result files alone.
    #[command(after_help = "Example:\n  stonewise report results/")]
    Report(ReportArgs),
    /// Make a simulated survey with truth.
    #[command(after_help = "Examples:\n  stonewise simulate --seed 7 --out survey/\n  \
        stonewise simulate dam --size 40x20 --out survey/")]
    Simulate(SimulateArgs),
    /// Choose parameters: try every combination of a grid against a known motion.
    #[command(
        after_help = "Examples:\n  stonewise tune survey/stonewise.toml --out tuned/ --part 5x5\n  \
        stonewise tune survey/stonewise.toml --out tuned/ --grid matching.max_ratio=0.3..0.6..0.1 \
        --grid registration.estimator=gicp --grid registration.gicp.buffer_m=0,0.3,0.6"
    )]
    Tune(TuneArgs),
    /// The paper's experiment, or how the results depend on masks, noise, spacing and the rest.
    #[command(subcommand)]
    Experiment(ExperimentCommand),
    /// Say what is in a cloud, a camera file, a mask file or a project.
    #[command(after_help = "Example:\n  stonewise info epoch1/cloud_tls.laz epoch1/cameras.xml")]
    Info(InfoArgs),
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

/// Arguments of `run`.
#[derive(Debug, ClapArgs)]
pub struct RunArgs {
    /// The project and the folder of its results.
    #[command(flatten)]
    pub project: ProjectArgs,
    /// End with exit code 4 where the verdict is this or worse; with 3 where the results cannot tell.
    #[arg(long, value_enum, value_name = "STATE")]
    pub exit_on: Option<ExitOn>,
}

/// Verdicts that can end a run with an exit code of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExitOn {
    /// Attention or alarm.
    Attention,
    /// Alarm.
    Alarm,
}

/// Arguments of `check`.
#[derive(Debug, ClapArgs)]
pub struct CheckArgs {
    /// The project file.
    pub project: PathBuf,
    /// Where the results are to go: its disk's free space is looked at.
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub out: PathBuf,
    /// The page with pictures; PROJECT.check.html beside the project file when absent.
    #[arg(long, value_name = "FILE")]
    pub page: Option<PathBuf>,
}

/// Arguments of `demo`.
#[derive(Debug, ClapArgs)]
pub struct DemoArgs {
    /// Folder of the survey and the results; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Another seed makes another wall.
    #[arg(long, default_value_t = 7)]
    pub seed: u64,
}

/// Arguments of `init`.
#[derive(Debug, ClapArgs)]
pub struct InitArgs {
    /// Folder with one folder per epoch, in time order by name.
    pub dir: PathBuf,
}

/// Arguments of `split`.
#[derive(Debug, ClapArgs)]
pub struct SplitArgs {
    /// The project file.
    pub project: PathBuf,
    /// Which points and photos go to which half.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Name of the epoch to split; the first when absent.
    #[arg(long, value_name = "NAME")]
    pub epoch: Option<String>,
    /// Folder of the new project; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `m3c2`, `c2c` and `c2m`.
#[derive(Debug, ClapArgs)]
pub struct CompareArgs {
    /// A project file, or the reference (cloud, or PLY mesh for c2m) and the compared cloud.
    #[arg(num_args = 1..=2, required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// Folder of the results; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// CloudCompare's M3C2 parameter file (m3c2 of two clouds only).
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Farther points get no distance, metres (c2c and c2m).
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    pub max_distance: f64,
}

/// Arguments of `segment`.
#[derive(Debug, ClapArgs)]
pub struct SegmentArgs {
    /// A folder of photos, one photo, or a project file (which has its own parameters).
    pub input: PathBuf,
    /// Folder of the results; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The detector: `built-in`, or a file that `train` wrote.
    #[arg(long, value_name = "FILE", default_value = "built-in")]
    pub model: PathBuf,
    /// Sizes at which photos are looked at, 1 = as they are.
    #[arg(long, value_name = "S,...", value_delimiter = ',')]
    pub scales: Option<Vec<f64>>,
    /// Leave out stones with a lower score, 0 to 1.
    #[arg(long, value_name = "P")]
    pub min_score: Option<f64>,
    /// Masks to measure the result on: COCO json or a folder of label PNGs.
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Regions in which the reference is complete; everywhere when absent.
    #[arg(long, value_name = "FILE", requires = "reference")]
    pub valid: Option<PathBuf>,
}

/// Arguments of `train`.
#[derive(Debug, ClapArgs)]
pub struct TrainArgs {
    /// Train on photos that are rendered during the training.
    #[arg(long, conflicts_with = "data", required_unless_present = "data")]
    pub rendered: bool,
    /// Masks to train on: COCO json or a folder of label PNGs.
    #[arg(long, value_name = "FILE", requires = "images")]
    pub data: Option<PathBuf>,
    /// Folder of the photos that the masks name.
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// Regions in which the masks are complete; everywhere when absent. Elsewhere a place without a mask may be a stone.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub valid: Option<PathBuf>,
    /// Weights to start from: `built-in`, a file that `train` wrote, or `none`.
    #[arg(long, value_name = "WEIGHTS", default_value = "built-in")]
    pub from: PathBuf,
    /// Folder of the checkpoint, the curves and the trained detector (model.safetensors); created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Stop after so many minutes; the same command goes on.
    #[arg(long, value_name = "M")]
    pub minutes: Option<f64>,
    /// How long the training lasts in all, minutes; --minutes when absent, else 30. The learning rate falls towards its end.
    #[arg(long, value_name = "M")]
    pub total_minutes: Option<f64>,
    /// Parameters (TOML, every key optional).
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

/// Arguments of `evaluate`.
#[derive(Debug, ClapArgs)]
pub struct EvaluateArgs {
    /// Folder of a finished run.
    pub results: PathBuf,
    /// Truth table: one row a stone, with stone_id, cx, cy, cz, dx, dy, dz.
    #[arg(long, value_name = "FILE")]
    pub truth: PathBuf,
}

/// Arguments of `report`.
#[derive(Debug, ClapArgs)]
pub struct ReportArgs {
    /// Folder of a finished run.
    pub results: PathBuf,
}

/// Which experiment.
#[derive(Debug, Subcommand)]
pub enum ExperimentCommand {
    /// One epoch split into halves, the second moved; Table 1, Table 2 and figures 5 to 9 of the paper from the data given.
    #[command(
        after_help = "Examples:\n  stonewise experiment paper --size 10x5 --out paper/       # simulates a section first\n  \
        stonewise experiment paper TLS=survey/stonewise.toml UAV=survey/stonewise_uav.toml --out paper/"
    )]
    Paper(PaperArgs),
    /// Curves of error and of stones measured against mask quality, noise, spacing, motion, pose error and overlap.
    #[command(
        after_help = "Examples:\n  stonewise experiment sensitivity --out curves/\n  \
        stonewise experiment sensitivity --influence masks --influence pose --seeds 3 --out curves/"
    )]
    Sensitivity(SensitivityArgs),
}

/// Arguments of `experiment sensitivity`.
#[derive(Debug, ClapArgs)]
pub struct SensitivityArgs {
    /// Folder of the page, the curves and the steps; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// What to vary: masks, noise, spacing, motion, pose or overlap; may be given several times. Absent: all.
    #[arg(long, value_name = "WHAT")]
    pub influence: Vec<Influence>,
    /// Width and height of the simulated walls, metres.
    #[arg(long, value_name = "WxH", default_value = "3x2", value_parser = parse_size)]
    pub size: [f64; 2],
    /// Number of walls.
    #[arg(long, default_value_t = 1)]
    pub seeds: u64,
    /// Measure with the paper's matching and estimator too.
    #[arg(long)]
    pub with_paper: bool,
}

/// Arguments of `experiment paper`.
#[derive(Debug, ClapArgs)]
pub struct PaperArgs {
    /// Projects, one for each scanner, as NAME=FILE or FILE; a simulated section where absent.
    #[arg(value_name = "SURVEY")]
    pub surveys: Vec<String>,
    /// Folder of the page, the tables and the steps; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Name of the epoch to split; the first when absent.
    #[arg(long, value_name = "NAME")]
    pub epoch: Option<String>,
    /// Which points and photos go to which half, and which section is simulated.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Width and height of the simulated section, metres.
    #[arg(long, value_name = "WxH", default_value = "10x5", value_parser = parse_size)]
    pub size: [f64; 2],
    /// Measure with the paper's estimator, which takes seconds a stone, only in a part: x0,y0,z0,x1,y1,z1 (metres, world
    /// frame), or WIDTHxHEIGHT in the middle of the wall, such as 3x3. Its rows count the stones of that part alone.
    #[arg(long, value_name = "PART")]
    pub paper_part: Option<String>,
}

/// Ready-made surveys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// A small section, as `simulation.toml` has it.
    Section,
    /// A curved gravity dam of any size: several stations, lidar and photos from a drone.
    Dam,
}

/// Arguments of `simulate`.
#[derive(Debug, ClapArgs)]
pub struct SimulateArgs {
    /// What to make where no parameters are given.
    #[arg(value_enum, default_value_t = Preset::Section)]
    pub preset: Preset,
    /// Width and height of a dam, metres; up to 200x27.7.
    #[arg(long, value_name = "WxH", default_value = "10x5", value_parser = parse_size)]
    pub size: [f64; 2],
    /// Folder of the survey; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Parameters of the simulation (TOML, every key optional); the defaults are written to simulation.toml in the folder.
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Another seed makes another wall; overrides the file.
    #[arg(long)]
    pub seed: Option<u64>,
}

/// Arguments of `tune`.
#[derive(Debug, ClapArgs)]
pub struct TuneArgs {
    /// The project file. Where no epoch has a known motion, the first epoch is split into halves that get one.
    pub project: PathBuf,
    /// Folder of the table, the plot and the steps; made if need be.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// A parameter and its values, key=a,b,c or key=from..to..step; may be given several times. Absent: ratio
    /// threshold, area ratio and buffer, as in the paper (for the adjustment the border instead of the buffer).
    #[arg(long, value_name = "KEY=VALUES")]
    pub grid: Vec<Dimension>,
    /// Use only a part: x0,y0,z0,x1,y1,z1 (metres, world frame), or WIDTHxHEIGHT in the middle of the wall, such as 5x5.
    #[arg(long, allow_hyphen_values = true)]
    pub part: Option<String>,
    /// Which points and photos go to which half.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Arguments of `info`.
#[derive(Debug, ClapArgs)]
pub struct InfoArgs {
    /// Files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
}

/// Reads `WIDTHxHEIGHT`, metres.
fn parse_size(text: &str) -> Result<[f64; 2], String> {
    let numbers: Vec<f64> = text
        .split('x')
        .map(|n| n.trim().parse().unwrap_or(f64::NAN))
        .collect();
    match numbers[..] {
        [width, height] if width >= 1.0 && height >= 1.0 && width <= 1e4 && height <= 1e3 => {
            Ok([width, height])
        }
        _ => Err("write WIDTHxHEIGHT in metres, at least 1 each, such as 40x20".to_owned()),
    }
}
