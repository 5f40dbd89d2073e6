//! The `stonewise` command: reads arguments, calls the library, prints.

mod args;
mod commands;
mod printer;

use std::process::ExitCode;

/// Everything that was asked for was done.
const DONE: u8 = 0;
/// Something failed.
const FAILED: u8 = 1;
/// Finished, but some inputs were left out.
const SKIPPED_INPUTS: u8 = 3;

fn main() -> ExitCode {
    let args = <args::Args as clap::Parser>::parse();
    let printer = printer::Printer::new(args.quiet);
    let outcome = commands::dispatch(args, &printer);
    printer.finish();
    match outcome {
        Ok(commands::Outcome::Done) => ExitCode::from(DONE),
        Ok(commands::Outcome::SkippedInputs) => ExitCode::from(SKIPPED_INPUTS),
        Err(error) => {
            printer::note(&format!("error: {error:#}"));
            ExitCode::from(FAILED)
        }
    }
}
