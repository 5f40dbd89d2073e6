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
            printer::note(&format!("error: {}", explain(&error)));
            ExitCode::from(FAILED)
        }
    }
}

/// The error and its causes in one line; a cause that is part of the text already is not said twice.
fn explain(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |text, cause| {
        let cause = cause.to_string();
        match text.as_str() {
            "" => cause,
            said if said.contains(&cause) => text,
            said => format!("{said}: {cause}"),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn no_cause_is_said_twice() {
        let io = std::io::Error::other("disk on fire");
        let error = Err::<(), _>(io)
            .context("writing failed: disk on fire: a.csv")
            .context("the run is not finished");
        let text = explain(&error.unwrap_err());
        assert_eq!(
            text,
            "the run is not finished: writing failed: disk on fire: a.csv"
        );
    }
}
