//! One file per subcommand: parse, call the library, print.

mod adapt;
mod certify;
mod check;
mod compare;
mod completions;
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

use crate::args::{Args, Command};
use crate::printer::Printer;
use anyhow::{Context, Result};
pub use outcome::Outcome;
pub use run::measure;
pub use simulate::simulate_survey;
use std::error::Error;
use std::num::NonZero;
use stonewise::{Until, require_start};
pub use version::version_details;

/// Runs the command that the arguments name.
pub fn dispatch(args: Args, printer: &Printer) -> Result<Outcome> {
    let force = args.force;
    if !force {
        require_start(threads(args.threads))?;
    }
    start_threads(args.threads)?;

    match args.command {
        Command::Run(args) => run::run_all(&args, force, printer),
        Command::Plan(args) => units::plan(&args, force, printer),
        Command::Unit(args) => units::unit(&args, printer),
        Command::Segment(args) => segment::segment(args, force, printer),
        Command::Train(args) => train::train(&args, force, printer),
        Command::Adapt(args) => adapt::adapt(&args, force, printer),
        Command::Label(args) => run::run(&args, Until::Labelled, force, printer),
        Command::Match(args) => run::run(&args, Until::Matched, force, printer),
        Command::Register(args) => run::run(&args, Until::Registered, force, printer),
        Command::M3c2(args) => compare::m3c2(&args, force, printer),
        Command::C2c(args) => compare::c2c(&args, force, printer),
        Command::C2m(args) => compare::c2m(&args, force, printer),
        Command::Evaluate(args) => evaluate::evaluate(&args, printer),
        Command::Report(args) => report::report(&args, force, printer),
        Command::Verify(args) => verify::verify(&args, printer),
        Command::Design(args) => design::design(&args, force, printer),
        Command::Certify(args) => certify::certify(&args, force, printer),
        Command::Demo(args) => simulate::demo(&args, force, printer),
        Command::Simulate(args) => simulate::simulate(&args, force, printer),
        Command::Split(args) => split::split(&args, force, printer),
        Command::Tune(args) => tune::tune(&args, force, printer),
        Command::Experiment(which) => experiment::experiment(&which, force, printer),
        Command::Check(args) => check::check(&args, force, printer),
        Command::Edits(which) => edits::edits(&which, printer),
        Command::Init(args) => init::init(&args),
        Command::Studio(args) => studio::studio(&args, printer),
        Command::Schema => schema::schema(),
        Command::Photos(args) => photos::photos(&args, force, printer),
        Command::Info(args) => info::info(&args),
        Command::Explain(args) => explain::explain(&args),
        Command::Doctor => doctor::doctor(),
        Command::Completions(args) => completions::completions(&args),
        Command::Man(args) => completions::man(&args, force),
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
