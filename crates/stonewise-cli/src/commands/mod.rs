//! One file per subcommand: parse, call the library, print.

mod check;
mod compare;
mod edits;
mod evaluate;
mod experiment;
mod info;
mod init;
mod outcome;
mod part;
mod report;
mod run;
mod segment;
mod simulate;
mod split;
mod train;
mod tune;
mod units;

use crate::args::{Args, Command};
use crate::printer::Printer;
use anyhow::Result;
pub use outcome::Outcome;
pub use run::measure;
use stonewise::Until;

/// Runs the command that the arguments name.
pub fn dispatch(args: Args, printer: &Printer) -> Result<Outcome> {
    if let Some(threads) = args.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()?;
    }
    let force = args.force;
    match args.command {
        Command::Run(args) => run::run_all(&args, force, printer),
        Command::Plan(args) => units::plan(&args, force, printer),
        Command::Unit(args) => units::unit(&args, printer),
        Command::Segment(args) => segment::segment(args, force, printer),
        Command::Train(args) => train::train(&args, force, printer),
        Command::Label(args) => run::run(&args, Until::Labelled, force, printer),
        Command::Match(args) => run::run(&args, Until::Matched, force, printer),
        Command::Register(args) => run::run(&args, Until::Registered, force, printer),
        Command::M3c2(args) => compare::m3c2(&args, force, printer),
        Command::C2c(args) => compare::c2c(&args, force, printer),
        Command::C2m(args) => compare::c2m(&args, force, printer),
        Command::Evaluate(args) => evaluate::evaluate(&args, printer),
        Command::Report(args) => report::report(&args, force, printer),
        Command::Demo(args) => simulate::demo(&args, force, printer),
        Command::Simulate(args) => simulate::simulate(&args, force, printer),
        Command::Split(args) => split::split(&args, force, printer),
        Command::Tune(args) => tune::tune(&args, force, printer),
        Command::Experiment(which) => experiment::experiment(&which, force, printer),
        Command::Check(args) => check::check(&args, force, printer),
        Command::Edits(which) => edits::edits(&which, printer),
        Command::Init(args) => init::init(&args),
        Command::Info(args) => info::info(&args),
    }
}
