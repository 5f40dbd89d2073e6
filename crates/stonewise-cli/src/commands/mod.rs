//! One file per subcommand: parse, call the library, print.

mod adapt;
mod certify;
mod check;
mod compare;
mod completions;
mod datum;
mod design;
mod doctor;
mod edits;
mod evaluate;
mod experiment;
mod explain;
mod info;
mod init;
mod outcome;
mod parameters;
mod part;
mod photos;
mod report;
mod run;
mod schema;
mod segment;
mod simulate;
mod split;
mod studio;
mod train;
mod tune;
mod units;
mod verify;
mod version;

use crate::args::{Args, Command, DetectorCommand, SelfCommand, TestCommand};
use crate::printer::Printer;
use anyhow::{Context, Result};
pub use outcome::Outcome;
pub use run::measure;
pub use simulate::simulate_survey;
use std::error::Error;
use std::num::NonZero;
use stonewise::require_start;
pub use version::version_details;

/// Runs the command that the arguments name.
pub fn dispatch(args: Args, printer: &Printer) -> Result<Outcome> {
    let force = args.force;
    if !force {
        require_start(threads(args.threads))?;
    }
    start_threads(args.threads)?;

    match args.command {
        Command::Init(args) => init::init(&args),
        Command::Check(args) => check::check(&args, force, printer),
        Command::Run(args) if args.plan => units::plan(&args, force, printer),
        Command::Run(args) if args.unit => units::unit(&args, printer),
        Command::Run(args) => run::run(&args, force, printer),
        Command::Studio(args) => studio::studio(&args, printer),
        Command::Report(args) => report::report(&args, force, printer),
        Command::Demo(args) => simulate::demo(&args, force, printer),
        Command::Info(args) if args.unpack_photos => photos::photos(&args, force, printer),
        Command::Info(args) => info::info(&args),
        Command::Explain(args) => explain::explain(&args),
        Command::Edits(which) => edits::edits(&which, printer),
        Command::Verify(args) => verify::verify(&args, printer),
        Command::Datum(args) => datum::datum(&args, force, printer),
        Command::Design(args) => design::design(&args, force, printer),
        Command::Evaluate(args) => evaluate::evaluate(&args, printer),
        Command::Compare(which) => compare::compare(&which, force, printer),
        Command::Detector(DetectorCommand::Segment(args)) => segment::segment(args, force, printer),
        Command::Detector(DetectorCommand::Train(args)) => train::train(&args, force, printer),
        Command::Detector(DetectorCommand::Adapt(args)) => adapt::adapt(&args, force, printer),
        Command::Test(TestCommand::Simulate(args)) => simulate::simulate(&args, force, printer),
        Command::Test(TestCommand::Split(args)) => split::split(&args, force, printer),
        Command::Test(TestCommand::Certify(args)) => certify::certify(&args, force, printer),
        Command::Test(TestCommand::Tune(args)) => tune::tune(&args, force, printer),
        Command::Test(TestCommand::Experiment(which)) => experiment::experiment(&which, force, printer),
        Command::Itself(SelfCommand::Schema) => schema::schema(),
        Command::Itself(SelfCommand::Completions(args)) => completions::completions(&args),
        Command::Itself(SelfCommand::Man(args)) => completions::man(&args, force),
        Command::Itself(SelfCommand::Doctor) => doctor::doctor(),
    }
}

/// How many threads compute: those that the arguments name, else the number that rayon takes, of
/// `RAYON_NUM_THREADS` or of the processor's cores.
fn threads(given: Option<usize>) -> usize {
    let from_environment = || std::env::var("RAYON_NUM_THREADS").ok()?.parse().ok();
    given
        .filter(|&n| n > 0)
        .or_else(|| from_environment().filter(|&n| n > 0))
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, NonZero::get))
}

/// Starts the threads that compute. Those that a library starts at its first use would panic where the system
/// refuses them.
fn start_threads(given: Option<usize>) -> Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(given.unwrap_or(0));
    match pool.build_global() {
        // The Python module runs many commands, with the threads of the first one.
        Err(error) if given.is_none() && error.source().is_none() => Ok(()),
        outcome => outcome.context("the threads cannot be started (fewer: --threads)"),
    }
}
