//! The command line, as typed.

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use std::path::PathBuf;
use stonewise::experiment::Dimension;

/// Measures how a masonry dam moves, stone by stone, from point clouds and posed photos.
#[derive(Debug, Parser)]
#[command(name = "stonewise", version, max_term_width = 110)]
pub struct Args {
    /// Print errors only.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Number of threads (default: all cores). Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// Write into a folder that already holds other files (files of the same name are replaced, inputs
    /// never), and run a survey even where the check found an error.
    #[arg(long, global = true)]
    pub force: bool,
    /// With --version: also print commit, system, build, processor class and weights.
    #[arg(long, requires = "version")]
    pub verbose: bool,
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the whole chain, from clouds and photos, or clouds alone, to results and a report. Resumes after an interruption.
    #[command(
        after_help = "Examples:\n  stonewise run survey/stonewise.toml --out results/\n  \
        stonewise run dam_2024.laz dam_2025.laz --out results/\n  \
        stonewise run survey/stonewise.toml --out results/ --exit-on alarm\n\n\
        Exit codes: 0 done, 1 failed, 2 wrong arguments or project file, 3 inputs left out or results in doubt, 4 verdict at or above the --exit-on level."
    )]
    Run(RunArgs),
    /// Split a run into units of work that other programs do on other machines; prints them as JSON.
    #[command(
        after_help = "Examples:\n  stonewise plan survey/stonewise.toml --out results/ > plan.json\n  \
        stonewise plan survey/stonewise.toml --out results/ --ids --rank 0\n\n\
        See docs/src/units.md for Slurm, Snakemake and Ray."
    )]
    Plan(PlanArgs),
    /// Do one unit of the plan in a results folder.
    #[command(after_help = "Example:\n  stonewise unit ingest-1 --out results/")]
    Unit(UnitArgs),
    /// Simulate a small survey with known motion, and measure it.
    #[command(after_help = "Examples:\n  stonewise demo\n  stonewise demo --seed 8 --out elsewhere/")]
    Demo(DemoArgs),
    /// Check a survey in seconds for problems with units, coordinate systems, overlap, photos, cameras and
    /// disk space.
    #[command(after_help = "Example:\n  stonewise check survey/stonewise.toml\n\n\
        The table goes to stdout; a page with pictures is written into the temporary folder, or where --page says. Exit code 3 if anything is doubtful or wrong, 1 if an input cannot be read.")]
    Check(CheckArgs),
    /// Correct stones by hand: read edits back from QGIS or from an editor of COCO files, or check a file of
    /// edits.
    #[command(subcommand)]
    Edits(EditsCommand),
    /// Write a project file from the surveys found in a folder.
    #[command(after_help = "Example:\n  stonewise init survey/        # writes survey/stonewise.toml")]
    Init(InitArgs),
    /// Open a page to work in: look at a survey, run it, correct its stones, read its report.
    #[command(
        after_help = "Examples:\n  stonewise studio survey/\n  stonewise studio results/ --view\n\n\
        The address goes to stdout; only this machine can reach it. See docs/src/studio.md."
    )]
    Studio(StudioArgs),
    /// Print the JSON schema of the project file, with which editors complete and explain its keys.
    #[command(after_help = "Example:\n  stonewise schema > survey/stonewise.schema.json")]
    Schema,
    /// Split one epoch into two disjoint halves, to test the method against a known motion.
    #[command(after_help = "Example:\n  stonewise split survey/stonewise.toml --seed 1 --out halves/")]
    Split(SplitArgs),
    /// Find the stones in photos. For a project, write one label image per photo, from its masks or from the
    /// detector.
    #[command(after_help = "Examples:\n  stonewise segment photos/ --out stones/\n  \
        stonewise segment photos/ --out stones/ --model training/model.safetensors --reference masks.json\n  \
        stonewise segment survey/stonewise.toml --out results/")]
    Segment(SegmentArgs),
    /// Train the stone detector: on a few labelled photos of a wall, or on rendered photos of masonry in
    /// general.
    #[command(
        after_help = "Examples:\n  stonewise train --rendered --from none --minutes 60 --out training/\n\n\
        Give the same command again to continue an interrupted training."
    )]
    Train(TrainArgs),
    /// Train the detector of a project on the stones of its own survey that several photos and the cloud confirm.
    ///
    /// Parts of the wall are kept apart. Unless the masks of the trained detector agree significantly better there from
    /// photo to photo, nothing changes.
    #[command(after_help = "Example:\n  stonewise adapt survey/stonewise.toml --minutes 20")]
    Adapt(AdaptArgs),
    /// Transfer the labels of the photos to the point clouds.
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
        stonewise m3c2 before.laz after.laz --out results/ --params m3c2_params.txt\n  \
        stonewise m3c2 before.laz after.laz --out results/ --recipes"
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
    /// Write the report of a finished run again, from its result files only.
    #[command(
        after_help = "Examples:\n  stonewise report results/\n  stonewise report results/ --pdf report.pdf --no-appendix"
    )]
    Report(ReportArgs),
    /// Verify that results are those of their run: files against their digests, tables against each other, and,
    /// with the project, inputs and all results against the same run again.
    #[command(after_help = "Examples:\n  stonewise verify results/\n  \
        stonewise verify results/ survey/stonewise.toml\n\n\
        The findings go to stdout. Exit codes: 0 all holds, 1 something differs, 3 something could not be compared.")]
    Verify(VerifyArgs),
    /// Say what the first survey shows of the wall, and predict what the next one will see: standard deviations of every
    /// stone, the smallest bulge that is found, what one more station gains. Before any survey: the same from a plan.
    #[command(
        after_help = "Examples:\n  stonewise design survey/stonewise.toml --out design/\n  \
        stonewise design plan.toml --out design/\n\n\
        A project of one epoch is enough. A plan has [wall] and [[stations]]. The figures go to stdout as JSON."
    )]
    Design(DesignArgs),
    /// Certify this program on this machine: on simulated walls, and, with a project, on motions put into its own
    /// scans.
    #[command(after_help = "Examples:\n  stonewise certify --out certificate/\n  \
        stonewise certify survey/stonewise.toml --seed 7 --out certificate/\n\n\
        The figures go to stdout. Exit code 3 if one is outside what is allowed.")]
    Certify(CertifyArgs),
    /// Simulate a survey with known truth.
    #[command(after_help = "Examples:\n  stonewise simulate --seed 7 --out survey/\n  \
        stonewise simulate dam --size 40x20 --out survey/")]
    Simulate(SimulateArgs),
    /// Choose parameters: try every combination of a grid against a known motion.
    #[command(
        after_help = "Examples:\n  stonewise tune survey/stonewise.toml --out tuned/ --part 5x5\n  \
        stonewise tune survey/stonewise.toml --out tuned/ --grid match.max_ratio=0.3..0.6..0.1 \
        --grid registration.estimator=gicp --grid registration.gicp.buffer_m=0,0.3,0.6"
    )]
    Tune(TuneArgs),
    /// Repeat the paper's experiment.
    #[command(subcommand)]
    Experiment(ExperimentCommand),
    /// Describe the content of a cloud, photos, a camera file, a mask file or a project.
    #[command(after_help = "Example:\n  stonewise info epoch1/cloud_tls.laz epoch1/cameras.xml")]
    Info(InfoArgs),
    /// Unpack the photos that scanners store in E57 files, with their cameras, for use in a project.
    #[command(
        after_help = "Example:\n  stonewise photos epoch1/scan.e57 --out epoch1/photos/\n\n\
        The summary goes to stdout, with the lines `images` and `cameras` for the project file. Panoramas are cut into photos. Exit code 3 if images are left out."
    )]
    Photos(PhotosArgs),
    /// Explain the code of a message: what was seen, what it means, what to do.
    #[command(
        after_help = "Examples:\n  stonewise explain not-converged\n  stonewise explain        lists the codes"
    )]
    Explain(ExplainArgs),
    /// Say what this machine offers and which parts of stonewise it can run.
    #[command(after_help = "Example:\n  stonewise doctor")]
    Doctor,
    /// Print the completions of a shell.
    #[command(
        after_help = "Examples:\n  stonewise completions bash > ~/.local/share/bash-completion/completions/stonewise\n  \
        stonewise completions zsh > ~/.zfunc/_stonewise\n  \
        stonewise completions fish > ~/.config/fish/completions/stonewise.fish"
    )]
    Completions(CompletionsArgs),
    /// Write the man pages, one for each command.
    #[command(after_help = "Example:\n  stonewise man --out ~/.local/share/man/man1")]
    Man(ManArgs),
}

/// Arguments of `explain`.
#[derive(Debug, ClapArgs)]
pub struct ExplainArgs {
    /// The code in the brackets of a message; without one, all codes are listed.
    pub code: Option<String>,
}

/// Arguments of `completions`.
#[derive(Debug, ClapArgs)]
pub struct CompletionsArgs {
    /// The shell.
    pub shell: Shell,
}

/// Arguments of `studio`.
#[derive(Debug, ClapArgs)]
pub struct StudioArgs {
    /// A folder of surveys, a project file, or a folder of results.
    #[arg(default_value = ".", value_name = "FOLDER|PROJECT|RESULTS")]
    pub place: PathBuf,
    /// Port of the address (default: any that is free).
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub port: u16,
    /// Do not start a browser.
    #[arg(long)]
    pub no_browser: bool,
    /// Only for looking: nothing can be changed, nothing can be run.
    #[arg(long)]
    pub view: bool,
}

/// Arguments of `man`.
#[derive(Debug, ClapArgs)]
pub struct ManArgs {
    /// Folder of the man pages; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// A project and a folder for its results.
#[derive(Debug, ClapArgs)]
pub struct ProjectArgs {
    /// The project file.
    pub project: PathBuf,
    /// Folder of the results; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `run`.
#[derive(Debug, ClapArgs)]
pub struct RunArgs {
    /// The project file; or scans without photos, one for each epoch in order of time, for which a project file
    /// is written into the folder of the results.
    #[arg(required = true, value_name = "PROJECT|SCANS")]
    pub inputs: Vec<PathBuf>,
    /// Folder of the results; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Exit with code 4 if the verdict is this state or worse, and with 3 if the results allow no verdict.
    #[arg(long, value_enum, value_name = "STATE")]
    pub exit_on: Option<ExitOn>,
}

/// Arguments of `plan`.
#[derive(Debug, ClapArgs)]
pub struct PlanArgs {
    /// The project and the folder of its results.
    #[command(flatten)]
    pub project: ProjectArgs,
    /// Print only the names of the units that are not done, one a line.
    #[arg(long)]
    pub ids: bool,
    /// Only units of this rank: they need units of lower ranks only.
    #[arg(long, value_name = "N", requires = "ids")]
    pub rank: Option<usize>,
}

/// Arguments of `unit`.
#[derive(Debug, ClapArgs)]
pub struct UnitArgs {
    /// The unit's name in the plan.
    #[arg(value_name = "ID")]
    pub unit: String,
    /// Folder of the results, in which the plan was made.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
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
    /// Folder the results will go to; the free space on its disk is checked.
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub out: PathBuf,
    /// The page with pictures (default: a file of its own in the temporary folder, named at the end).
    #[arg(long, value_name = "FILE")]
    pub page: Option<PathBuf>,
}

/// What to do with edits.
#[derive(Debug, Subcommand)]
pub enum EditsCommand {
    /// Write a file of edits: what a person changed in the layer stones_facade of stones.gpkg, or the
    /// polygons of a COCO file whose categories are merge, split, delete, add and ignore.
    #[command(
        after_help = "Examples:\n  stonewise edits import results/stones.gpkg --who \"A. Keller\" --why \"seen on site\" --out edits.json\n  \
        stonewise edits import drawn.json --epoch 2025-04 --who \"A. Keller\" --why \"hidden joint\" --out edits.json\n\n\
        Then name the file in the project: [edits] file = \"edits.json\"."
    )]
    Import(EditsImportArgs),
    /// Check a file of edits and list them; the list goes to stdout.
    #[command(after_help = "Example:\n  stonewise edits check edits.json")]
    Check(EditsCheckArgs),
}

/// Arguments of `edits import`.
#[derive(Debug, ClapArgs)]
pub struct EditsImportArgs {
    /// The edited stones.gpkg, or a COCO file (.json).
    pub source: PathBuf,
    /// The file of edits.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Put the new edits after those that the file has.
    #[arg(long)]
    pub append: bool,
    /// Folder of the results from which stones.gpkg was taken (default: the folder it lies in).
    #[arg(long, value_name = "DIR")]
    pub results: Option<PathBuf>,
    /// Epoch of the photos of a COCO file (default: the first).
    #[arg(long, value_name = "NAME")]
    pub epoch: Option<String>,
    /// Who decided; an attribute of that name in the file comes before it.
    #[arg(long)]
    pub who: String,
    /// Why; an attribute of that name in the file comes before it.
    #[arg(long)]
    pub why: String,
    /// When, YYYY-MM-DD (default: today); an attribute of that name in the file comes before it.
    #[arg(long, value_name = "DATE")]
    pub when: Option<String>,
}

/// Arguments of `edits check`.
#[derive(Debug, ClapArgs)]
pub struct EditsCheckArgs {
    /// The file of edits.
    pub file: PathBuf,
}

/// Arguments of `demo`.
#[derive(Debug, ClapArgs)]
pub struct DemoArgs {
    /// Folder of the survey and the results; created if missing.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    pub out: PathBuf,
    /// Seed of the simulated wall.
    #[arg(long, default_value_t = 7)]
    pub seed: u64,
}

/// Arguments of `init`.
#[derive(Debug, ClapArgs)]
pub struct InitArgs {
    /// Folder with one subfolder per epoch, or with one scan per epoch.
    pub dir: PathBuf,
}

/// Arguments of `split`.
#[derive(Debug, ClapArgs)]
pub struct SplitArgs {
    /// The project file.
    pub project: PathBuf,
    /// Seed of the random split into halves.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Name of the epoch to split (default: the first).
    #[arg(long, value_name = "NAME")]
    pub epoch: Option<String>,
    /// Folder of the new project; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `m3c2`, `c2c` and `c2m`.
#[derive(Debug, ClapArgs)]
pub struct CompareArgs {
    /// A project file, or the reference (cloud, or PLY mesh for c2m) and the compared cloud.
    #[arg(num_args = 1..=2, required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// Folder of the results; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// M3C2 parameter file saved by CloudCompare (only for m3c2 of two clouds).
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Also write files with which CloudCompare and PDAL repeat M3C2 (only for m3c2).
    #[arg(long)]
    pub recipes: bool,
    /// Largest distance, metres; points farther away get none (c2c and c2m).
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    pub max_distance: f64,
}

/// Arguments of `segment`.
#[derive(Debug, ClapArgs)]
pub struct SegmentArgs {
    /// A folder of photos, one photo, or a project file (its own parameters apply; of the options below,
    /// only --out can be used with it).
    pub input: PathBuf,
    /// Folder of the results; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The detector: `built-in` (default), or a file that `train` wrote.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Scales at which photos are processed; 1 is the original size.
    #[arg(long, value_name = "S,...", value_delimiter = ',')]
    pub scales: Option<Vec<f64>>,
    /// Lowest score of a stone to keep, 0 to 1.
    #[arg(long, value_name = "P")]
    pub min_score: Option<f64>,
    /// Outline the stones in given boxes instead of searching for stones: COCO json with a bbox for each stone.
    #[arg(long, value_name = "FILE")]
    pub boxes: Option<PathBuf>,
    /// Reference masks to score the result against: COCO json or a folder of label PNGs.
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Regions in which the reference is complete (default: everywhere).
    #[arg(long, value_name = "FILE", requires = "reference")]
    pub valid: Option<PathBuf>,
}

/// Arguments of `train`.
#[derive(Debug, ClapArgs)]
pub struct TrainArgs {
    /// Train on synthetic photos, rendered during the training.
    #[arg(long, conflicts_with = "data", required_unless_present = "data")]
    pub rendered: bool,
    /// Masks to train on: COCO json or a folder of label PNGs.
    #[arg(long, value_name = "FILE", requires = "images")]
    pub data: Option<PathBuf>,
    /// Folder of the photos that the masks name.
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// Regions in which the masks are complete (default: everywhere). Outside them, unmasked pixels are
    /// ignored.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub valid: Option<PathBuf>,
    /// Weights to start from: `built-in`, a file that `train` wrote, or `none`.
    #[arg(long, value_name = "WEIGHTS", default_value = "built-in")]
    pub from: PathBuf,
    /// Folder of the checkpoint, the curves and the trained detector (model.safetensors); created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Stop after this many minutes; the same command continues.
    #[arg(long, value_name = "M")]
    pub minutes: Option<f64>,
    /// Length of the whole training, minutes (default: --minutes, or else 30). The learning rate falls
    /// towards its end.
    #[arg(long, value_name = "M")]
    pub total_minutes: Option<f64>,
    /// Parameters (TOML, every key optional).
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

/// Arguments of `adapt`.
#[derive(Debug, ClapArgs)]
pub struct AdaptArgs {
    /// The project file, or its folder.
    pub project: PathBuf,
    /// Length of the training, minutes; the same command continues an interrupted one.
    #[arg(long, value_name = "M", default_value = "20", value_parser = parse_minutes)]
    pub minutes: f64,
    /// Folder of the trained detector (model.safetensors); created if missing [default: `adapted` beside the project
    /// file].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of `evaluate`.
#[derive(Debug, ClapArgs)]
pub struct EvaluateArgs {
    /// Folder of a finished run.
    pub results: PathBuf,
    /// Truth table: one row per stone, with stone_id, cx, cy, cz, dx, dy, dz.
    #[arg(long, value_name = "FILE")]
    pub truth: PathBuf,
}

/// Arguments of `report`.
#[derive(Debug, ClapArgs)]
pub struct ReportArgs {
    /// Folder of a finished run.
    pub results: PathBuf,
    /// Print the report to this file, too; needs Chromium, Chrome or Edge.
    #[arg(long, value_name = "FILE")]
    pub pdf: Option<PathBuf>,
    /// Leave parameters, digests and decisions about masks out of the PDF.
    #[arg(long, requires = "pdf")]
    pub no_appendix: bool,
    /// Print the part of the yearly safety report on measurements instead; of more than two epochs.
    #[arg(long, requires = "pdf", conflicts_with = "no_appendix")]
    pub yearly: bool,
}

/// Arguments of `verify`.
#[derive(Debug, ClapArgs)]
pub struct VerifyArgs {
    /// Folder of a finished run.
    pub results: PathBuf,
    /// The project file: it is run again into a temporary folder, and all results are compared.
    pub project: Option<PathBuf>,
    /// Print the findings as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `design`.
#[derive(Debug, ClapArgs)]
pub struct DesignArgs {
    /// A project file, whose first epoch counts, or the plan of a survey: a file with the tables [wall] and [[stations]].
    pub project: PathBuf,
    /// Folder of design.json, design.html, design.csv, design.parquet and the runs; created if missing.
    #[arg(long, value_name = "DIR", default_value = "design")]
    pub out: PathBuf,
    /// Seed of the errors of the repetition's stations, and of a planned wall.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Arguments of `certify`.
#[derive(Debug, ClapArgs)]
pub struct CertifyArgs {
    /// A project, whose first epoch is split into halves (default: simulated walls only).
    pub project: Option<PathBuf>,
    /// Folder of certificate.json, certificate.html and the runs; created if missing.
    #[arg(long, value_name = "DIR", default_value = "certificate")]
    pub out: PathBuf,
    /// Seed of the simulated walls and of the halves.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of simulated walls; every second one stands still.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub walls: u64,
}

/// Which experiment.
#[derive(Debug, Subcommand)]
pub enum ExperimentCommand {
    /// Split one epoch into halves, move the second, and reproduce Table 1, Table 2 and figures 5 to 9 of the
    /// paper.
    #[command(
        after_help = "Examples:\n  stonewise experiment paper --size 10x5 --out paper/       # simulates a section first\n  \
        stonewise experiment paper TLS=survey/stonewise.toml UAV=survey/stonewise_uav.toml --out paper/"
    )]
    Paper(PaperArgs),
}

/// Arguments of `experiment paper`.
#[derive(Debug, ClapArgs)]
pub struct PaperArgs {
    /// Projects, one per scanner, as NAME=FILE or FILE (default: a simulated section).
    #[arg(value_name = "SURVEY")]
    pub surveys: Vec<String>,
    /// Folder of the page, the tables and the steps; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Name of the epoch to split (default: the first).
    #[arg(long, value_name = "NAME")]
    pub epoch: Option<String>,
    /// Seed of the random split into halves and of the simulated section.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Width and height of the simulated section, metres.
    #[arg(long, value_name = "WxH", default_value = "10x5", value_parser = parse_size)]
    pub size: [f64; 2],
    /// Run the paper's estimator, which is slow, only in a part of the wall: x0,y0,z0,x1,y1,z1 (metres, world
    /// frame), or WIDTHxHEIGHT in the middle of the wall, such as 3x3. Its rows count only the stones in that
    /// part.
    #[arg(long, value_name = "PART")]
    pub paper_part: Option<String>,
}

/// Ready-made surveys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// A small section with the default parameters.
    Section,
    /// A curved gravity dam of any size: several stations, lidar and photos from a drone.
    Dam,
}

/// Arguments of `simulate`.
#[derive(Debug, ClapArgs)]
pub struct SimulateArgs {
    /// What to simulate if no parameter file is given.
    #[arg(value_enum, default_value_t = Preset::Section)]
    pub preset: Preset,
    /// Width and height of a dam, metres; up to 200x27.7.
    #[arg(long, value_name = "WxH", default_value = "10x5", value_parser = parse_size)]
    pub size: [f64; 2],
    /// Folder of the survey; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Parameters of the simulation (TOML, every key optional); those used are written to simulation.toml in
    /// the folder.
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Seed of the wall; overrides the parameter file.
    #[arg(long)]
    pub seed: Option<u64>,
}

/// Arguments of `tune`.
#[derive(Debug, ClapArgs)]
pub struct TuneArgs {
    /// The project file. If no epoch has a known motion, the first epoch is split into halves and the second
    /// is moved.
    pub project: PathBuf,
    /// Folder of the table, the plot and the steps; created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// A parameter and its values, key=a,b,c or key=from..to..step; may be repeated. Default: ratio
    /// threshold, area ratio and buffer, as in the paper (with the adjustment, border_noises instead of the
    /// buffer).
    #[arg(long, value_name = "KEY=VALUES")]
    pub grid: Vec<Dimension>,
    /// Use only a part of the wall: x0,y0,z0,x1,y1,z1 (metres, world frame), or WIDTHxHEIGHT in the middle of
    /// the wall, such as 5x5.
    #[arg(long, allow_hyphen_values = true)]
    pub part: Option<String>,
    /// Seed of the random split into halves.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Arguments of `photos`.
#[derive(Debug, ClapArgs)]
pub struct PhotosArgs {
    /// E57 files, whose photos share one folder and one camera file.
    #[arg(required = true, value_name = "SCAN")]
    pub scans: Vec<PathBuf>,
    /// Folder for the photos (in images/) and their cameras (in colmap/); created if missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Arguments of `info`.
#[derive(Debug, ClapArgs)]
pub struct InfoArgs {
    /// Files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// Print a JSON list instead, an object for each path
    #[arg(long)]
    pub json: bool,
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

/// Reads a number of minutes, 0 or more.
fn parse_minutes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(minutes) if minutes >= 0.0 && minutes.is_finite() => Ok(minutes),
        _ => Err("write a number of minutes, 0 or more".to_owned()),
    }
}
