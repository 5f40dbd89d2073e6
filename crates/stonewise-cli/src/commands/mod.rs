//! One file per subcommand: parse, call the library, print.

mod init;
mod run;

use crate::args::{Args, Command};
use crate::printer::Printer;
use anyhow::Result;
use stonewise::Until;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything that was asked for was done.
    Done,
    /// Done, but for inputs that were left out.
    SkippedInputs,
}

/// Runs the command that was asked for.
pub fn dispatch(args: Args, printer: &Printer) -> Result<Outcome> {
    if let Some(threads) = args.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()?;
    }
    match args.command {
        Command::Run(args) => run::run(&args, Until::Reported, printer),
        Command::Segment(args) => run::run(&args, Until::Segmented, printer),
        Command::Label(args) => run::run(&args, Until::Labelled, printer),
        Command::Match(args) => run::run(&args, Until::Matched, printer),
        Command::Register(args) => run::run(&args, Until::Registered, printer),
        Command::Init(args) => init::init(&args),
    }
}
