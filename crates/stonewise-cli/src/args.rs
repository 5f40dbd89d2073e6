//! The command line, as typed.

use clap::{Args as ClapArgs, CommandFactory, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use std::fmt::Write;
use std::path::PathBuf;
use stonewise::Until;
use stonewise::experiment::{CalibratedSurvey, Dimension};

/// Measures how a masonry dam moves, stone by stone, from point clouds and photos.
#[derive(Debug, Parser)]
#[command(name = "stonewise", version, max_term_width = 80)]
pub struct Args {
    /// Print errors only.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Number of threads (default: all cores). Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// Write into a folder that holds other files (never over inputs), and run a survey in spite of errors that
    /// the check found.
    #[arg(long, global = true)]
    pub force: bool,
    /// With --version: also print commit, system, build, processor class and weights.
    #[arg(long, requires = "version")]
    pub verbose: bool,
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// Headings of the list of commands, each with its commands.
const GROUPS: [(&str, &[&str]); 4] = [
    ("Measure", &["init", "check", "run", "studio", "report", "demo"]),
    (
        "Understand and correct",
        &["info", "explain", "edits", "verify", "datum"],
    ),
    ("Plan and judge", &["design", "evaluate"]),
    ("More", &["compare", "detector", "test", "self"]),
];

/// The command line with its help, in which the commands stand in groups.
pub fn command() -> clap::Command {
    let command = Args::command();
    let mut list = String::new();
    for (heading, names) in GROUPS {
        let _ = writeln!(list, "\n{heading}:");
        for name in names {
            let about = command.find_subcommand(name).and_then(clap::Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(list, "  {name:<9} {about}");
        }
    }
    command.help_template(format!(
        "{{about}}\n\n{{usage-heading}} {{usage}}\n{list}\nOptions:\n{{options}}\n\n\
         `stonewise COMMAND --help` explains a command, with examples."
    ))
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a project file from the surveys found in a folder
    #[command(after_help = "Example:\n  stonewise init survey/        # writes survey/stonewise.toml")]
    Init(InitArgs),
    /// Look for mistakes in a survey, in seconds
    #[command(
        after_help = "Looks at units, coordinate systems, overlap, photos, cameras and disk space. The \
        table goes to stdout; a page with pictures is written into the temporary folder, \
        or where --page says. Exit code 3 if anything is doubtful or wrong, 1 if an input \
        cannot be read.\n\n\
        Example:\n  stonewise check survey/stonewise.toml"
    )]
    Check(CheckArgs),
    /// Measure: from clouds and photos to results and a report
    #[command(after_help = "An interrupted run resumes: give the same command again.\n\n\
        Examples:\n  stonewise run survey/stonewise.toml\n  \
        stonewise run dam_2024.laz dam_2025.laz --out results/\n  \
        stonewise run survey/stonewise.toml --exit-on alarm\n\n\
        Exit codes: 0 done, 1 failed, 2 wrong arguments or project file, 3 inputs left out \
        or results in doubt, 4 verdict at or above the --exit-on level. For a run on several \
        machines (--plan) see docs/src/units.md.")]
    Run(RunArgs),
    /// Work on a page in the browser: look, run, correct, read the report
    #[command(
        after_help = "Examples:\n  stonewise studio survey/\n  stonewise studio results/ --view\n\n\
        The address goes to stdout; only this machine can reach it. See docs/src/edits.md."
    )]
    Studio(StudioArgs),
    /// Write the report of a finished run again, or print it as PDF
    #[command(
        after_help = "Examples:\n  stonewise report results/\n  stonewise report results/ --pdf report.pdf --no-appendix"
    )]
    Report(ReportArgs),
    /// Simulate a small wall with known motion, and measure it
    #[command(after_help = "Examples:\n  stonewise demo\n  stonewise demo --seed 8 --out elsewhere/")]
    Demo(DemoArgs),
    /// Describe clouds, photos, camera files, masks or projects
    #[command(
        after_help = "With --unpack-photos: unpacks the photos that scanners store in E57 files, with \
        their cameras. The lines `images` and `cameras` for the project file go to stdout. \
        Panoramas are cut into photos. Exit code 3 if images are left out.\n\n\
        Examples:\n  stonewise info epoch1/cloud_tls.laz epoch1/cameras.xml\n  \
        stonewise info --unpack-photos epoch1/scan.e57 --out epoch1/photos/"
    )]
    Info(InfoArgs),
    /// Explain the code of a message, and say what to do
    #[command(
        after_help = "Examples:\n  stonewise explain not-converged\n  stonewise explain        lists the codes"
    )]
    Explain(ExplainArgs),
    /// Correct stones by hand, with edits from QGIS or COCO files
    #[command(subcommand)]
    Edits(EditsCommand),
    /// Verify that results are those of their run
    #[command(
        after_help = "Compares files with their digests and tables with each other, and, with the \
        project, inputs and all results with the same run again. The findings go to \
        stdout. Exit codes: 0 all holds, 1 something differs, 3 something could not be \
        compared.\n\n\
        Examples:\n  stonewise verify results/\n  stonewise verify results/ survey/stonewise.toml"
    )]
    Verify(VerifyArgs),
    /// Take stones as fixed: motions of finished results against them
    #[command(
        after_help = "The rigid motion of these stones is estimated by least squares and taken off all stones \
        (S-transformation), without a new run. Errors of the stones count as independent but for \
        what all share of the registration.\n\n\
        Examples:\n  stonewise datum results/ --fixed 12,13,14,57 --out against_pier.csv\n  \
        stonewise datum results/ --fixed pier --out against_pier.csv"
    )]
    Datum(DatumArgs),
    /// Predict what the next survey will see; plan the first one
    #[command(
        after_help = "Says what the first survey shows of the wall: standard deviations of every stone, the \
        smallest bulge that is found, what one more station gains. Before any survey it \
        says the same from a plan, which has [wall] and [[stations]]. A project of one epoch \
        is enough. The figures go to stdout as JSON.\n\n\
        Examples:\n  stonewise design survey/stonewise.toml --out design/\n  \
        stonewise design plan.toml --out design/"
    )]
    Design(DesignArgs),
    /// Score results against a table of the true motions
    #[command(after_help = "Example:\n  stonewise evaluate results/ --truth truth/stones.csv")]
    Evaluate(EvaluateArgs),
    /// Compare clouds without stones: m3c2, c2c, c2m
    #[command(subcommand)]
    Compare(CompareCommand),
    /// Find stones in photos; learn from a wall: segment, train, adapt
    #[command(subcommand)]
    Detector(DetectorCommand),
    /// Test the method: simulate, split, certify, tune, experiment
    #[command(subcommand)]
    Test(TestCommand),
    /// About this program: schema, completions, man, doctor
    #[command(subcommand, name = "self")]
    Itself(SelfCommand),
}

/// Comparisons of clouds without stones.
#[derive(Debug, Subcommand)]
pub enum CompareCommand {
    /// Distances along the normals of the first cloud (Lague et al. 2013)
    #[command(
        after_help = "Examples:\n  stonewise compare m3c2 survey/stonewise.toml --out results/\n  \
        stonewise compare m3c2 before.laz after.laz --params m3c2_params.txt\n  \
        stonewise compare m3c2 before.laz after.laz --recipes"
    )]
    M3c2(CompareArgs),
    /// Distance from each point of the second cloud to the nearest of the first
    #[command(after_help = "Example:\n  stonewise compare c2c before.laz after.laz")]
    C2c(CompareArgs),
    /// Distance from each point of a cloud to a mesh
    #[command(after_help = "Example:\n  stonewise compare c2m mesh.ply cloud.laz")]
    C2m(CompareArgs),
}

/// What to do with the detector.
#[derive(Debug, Subcommand)]
pub enum DetectorCommand {
    /// Find the stones in photos, or write the label images of a project
    #[command(
        after_help = "Examples:\n  stonewise detector segment photos/ --out stones/\n  \
        stonewise detector segment photos/ --model training/model.safetensors --reference masks.json\n  \
        stonewise detector segment survey/stonewise.toml --out results/"
    )]
    Segment(SegmentArgs),
    /// Train on a few labelled photos of a wall, or on rendered photos
    #[command(
        after_help = "Example:\n  stonewise detector train --rendered --from none --minutes 60 --out training/\n\n\
        Give the same command again to continue an interrupted training."
    )]
    Train(TrainArgs),
    /// Train on the stones of a project that photos and cloud confirm
    #[command(
        after_help = "Parts of the wall are kept apart. Unless the masks of the trained detector agree \
        significantly better there from photo to photo, nothing changes.\n\n\
        Example:\n  stonewise detector adapt survey/stonewise.toml --minutes 20"
    )]
    Adapt(AdaptArgs),
}

/// Tests of the method.
#[derive(Debug, Subcommand)]
pub enum TestCommand {
    /// Simulate a survey with known truth
    #[command(
        after_help = "Examples:\n  stonewise test simulate --seed 7 --out survey/\n  \
        stonewise test simulate dam --size 40x20 --out survey/"
    )]
    Simulate(SimulateArgs),
    /// Split one survey into two halves, to put a known motion into one of them
    #[command(after_help = "Example:\n  stonewise test split survey/stonewise.toml --seed 1 --out halves/")]
    Split(SplitArgs),
    /// Certify this program on this machine, on simulated walls and your own scans
    #[command(after_help = "Examples:\n  stonewise test certify --out certificate/\n  \
        stonewise test certify survey/stonewise.toml --seed 7 --out certificate/\n  \
        stonewise test certify --calibration --sensor scanner\n  \
        stonewise test certify plan.toml --calibration\n\n\
        The figures go to stdout. Exit code 3 if one is outside what is allowed.")]
    Certify(CertifyArgs),
    /// Choose parameters: try every combination of a grid against a known motion
    #[command(
        after_help = "Examples:\n  stonewise test tune survey/stonewise.toml --out tuned/ --part 5x5\n  \
        stonewise test tune survey/stonewise.toml --grid match.max_ratio=0.3..0.6..0.1 \
        --grid registration.estimator=gicp --grid registration.gicp.buffer_m=0,0.3,0.6"
    )]
    Tune(TuneArgs),
    /// Repeat the paper's experiment
    #[command(subcommand)]
    Experiment(ExperimentCommand),
}

/// What belongs to the program itself.
#[derive(Debug, Subcommand)]
pub enum SelfCommand {
    /// Print the JSON schema of the project file
    #[command(
        after_help = "Editors complete and explain the keys of a project file with it.\n\n\
        Example:\n  stonewise self schema > survey/stonewise.schema.json"
    )]
    Schema,
    /// Print the completions of a shell
    #[command(
        after_help = "Examples:\n  stonewise self completions bash > ~/.local/share/bash-completion/completions/stonewise\n  \
        stonewise self completions zsh > ~/.zfunc/_stonewise\n  \
        stonewise self completions fish > ~/.config/fish/completions/stonewise.fish"
    )]
    Completions(CompletionsArgs),
    /// Write the man pages, one for each command
    #[command(after_help = "Example:\n  stonewise self man --out ~/.local/share/man/man1")]
    Man(ManArgs),
    /// Say what this machine offers and which parts of stonewise it can run
    #[command(after_help = "Example:\n  stonewise self doctor")]
    Doctor,
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
    #[arg(long, value_name = "DIR", default_value = "man")]
    pub out: PathBuf,
}

/// Arguments of `run`.
#[derive(Debug, ClapArgs)]
pub struct RunArgs {
    /// The project file; or scans without photos, one for each survey in order of time, for which a project file
    /// is written into the folder of the results.
    #[arg(required = true, value_name = "PROJECT|SCANS")]
    pub inputs: Vec<PathBuf>,
    /// Folder of the results; created if missing.
    #[arg(long, value_name = "DIR", default_value = "results")]
    pub out: PathBuf,
    /// Stop after this step: `segment` finds stones in the photos, `label` in the clouds, `match` the same stones in
    /// all surveys, `register` measures them.
    #[arg(long, value_enum, value_name = "STEP", hide_possible_values = true)]
    pub until: Option<Step>,
    /// Exit with code 4 if the verdict is this state, `attention` or `alarm`, or worse, and with 3 if the results
    /// allow no verdict.
    #[arg(long, value_enum, value_name = "STATE", hide_possible_values = true)]
    pub exit_on: Option<ExitOn>,
    /// Only print the units of work that other programs do on other machines, as JSON.
    #[arg(long, conflicts_with_all = ["until", "exit_on"])]
    pub plan: bool,
    /// With --plan: print only the names of the units that are not done, one a line.
    #[arg(long, hide = true, requires = "plan")]
    pub ids: bool,
    /// With --ids: only units of this rank; they need units of lower ranks only.
    #[arg(long, hide = true, value_name = "N", requires = "ids")]
    pub rank: Option<usize>,
    /// Do one unit of the plan in the folder of the results: the input is its name.
    #[arg(long, hide = true, conflicts_with_all = ["until", "exit_on", "plan"])]
    pub unit: bool,
}

/// Steps after which a run can stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Step {
    /// Stones in the photos.
    Segment,
    /// Stones in the clouds.
    Label,
    /// The same stones in all epochs.
    Match,
    /// Their motions.
    Register,
}

impl Step {
    /// How far a run goes to do it.
    pub fn until(self) -> Until {
        match self {
            Self::Segment => Until::Segmented,
            Self::Label => Until::Labelled,
            Self::Match => Until::Matched,
            Self::Register => Until::Registered,
        }
    }
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
    /// The project file, or scans as for `run`.
    #[arg(required = true, value_name = "PROJECT|SCANS")]
    pub inputs: Vec<PathBuf>,
    /// Folder the results will go to; the free space on its disk is checked.
    #[arg(long, value_name = "DIR", default_value = "results")]
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
    #[arg(long, value_name = "FILE", default_value = "edits.json")]
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
    /// Who decided; an attribute of that name in the file takes precedence.
    #[arg(long)]
    pub who: String,
    /// Why; an attribute of that name in the file takes precedence.
    #[arg(long)]
    pub why: String,
    /// When, YYYY-MM-DD (default: today); an attribute of that name in the file takes precedence.
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
    /// Folder with one subfolder for each survey, or with one scan for each.
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
    #[arg(long, value_name = "DIR", default_value = "halves")]
    pub out: PathBuf,
}

/// Arguments of `m3c2`, `c2c` and `c2m`.
#[derive(Debug, ClapArgs)]
pub struct CompareArgs {
    /// A project file, or the reference (cloud, or PLY mesh for c2m) and the compared cloud.
    #[arg(num_args = 1..=2, required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// Folder of the results; created if missing.
    #[arg(long, value_name = "DIR", default_value = "compared")]
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
    /// Folder of the results; created if missing [default: stones; of a project: results].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
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
    #[arg(long, value_name = "DIR", default_value = "training")]
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
    /// Print the part of the yearly safety report on measurements instead; needs three epochs or more.
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

/// Arguments of `datum`.
#[derive(Debug, ClapArgs)]
pub struct DatumArgs {
    /// Folder of a finished run.
    pub results: PathBuf,
    /// Stones that count as fixed: numbers with commas between them, or the name of a zone of [[thresholds.zones]].
    #[arg(long, value_name = "STONES|ZONE")]
    pub fixed: String,
    /// CSV file to write, with the columns of stones.csv.
    #[arg(long, value_name = "CSV")]
    pub out: PathBuf,
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
    /// A project, whose first epoch is split into halves (default: simulated walls only); with --calibration the plan of
    /// a survey, as for `design`.
    #[arg(value_name = "PROJECT|PLAN")]
    pub project: Option<PathBuf>,
    /// Folder of certificate.json and .html, or calibration.json and .html, and of the runs; created if missing.
    #[arg(long, value_name = "DIR", default_value = "certificate")]
    pub out: PathBuf,
    /// Seed of the simulated walls and of the halves.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of simulated walls, of which every second one stands still; with --calibration 50 for each sensor.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 6,
        default_value_if("calibration", "true", "50"),
        value_parser = clap::value_parser!(u64).range(1..=1000)
    )]
    pub walls: u64,
    /// Draw the motions of the walls from the prior of the method, and test how the truth ranks in what the program
    /// states.
    #[arg(long)]
    pub calibration: bool,
    /// Only this sensor, instead of all three; may be repeated.
    #[arg(
        long,
        value_name = "NAME",
        requires = "calibration",
        conflicts_with = "project",
        value_parser = CalibratedSurvey::NAMES
    )]
    pub sensor: Vec<String>,
}

/// Which experiment.
#[derive(Debug, Subcommand)]
pub enum ExperimentCommand {
    /// Split one epoch into halves, move the second, and reproduce Table 1, Table 2 and figures 5 to 9 of the
    /// paper.
    #[command(
        after_help = "Examples:\n  stonewise test experiment paper --size 10x5 --out paper/  # simulates a section first\n  \
        stonewise test experiment paper TLS=survey/stonewise.toml UAV=survey/stonewise_uav.toml --out paper/"
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
    #[arg(long, value_name = "DIR", default_value = "paper")]
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
    /// What to simulate if no parameter file is given: a small `section`, or a curved `dam` of any size with several
    /// stations, lidar and photos from a drone.
    #[arg(value_enum, default_value_t = Preset::Section, hide_possible_values = true)]
    pub preset: Preset,
    /// Width and height of a dam, metres; up to 200x27.7.
    #[arg(long, value_name = "WxH", default_value = "10x5", value_parser = parse_size)]
    pub size: [f64; 2],
    /// Folder of the survey; created if missing.
    #[arg(long, value_name = "DIR", default_value = "survey")]
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
    #[arg(long, value_name = "DIR", default_value = "tuned")]
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

/// Arguments of `info`.
#[derive(Debug, ClapArgs)]
pub struct InfoArgs {
    /// Files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// Print a JSON list instead, an object for each path.
    #[arg(long)]
    pub json: bool,
    /// Unpack the photos of these E57 files, which share one folder and one camera file.
    #[arg(long, conflicts_with = "json")]
    pub unpack_photos: bool,
    /// Folder for the photos (in images/) and their cameras (in colmap/); created if missing.
    #[arg(
        long,
        value_name = "DIR",
        requires = "unpack_photos",
        default_value = "photos"
    )]
    pub out: PathBuf,
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
