//! The `stonewise` command: reads arguments, calls the library, prints.

mod args;
mod commands;
mod printer;

use std::process::ExitCode;

/// Everything that was asked for was done.
const DONE: u8 = 0;
/// Something failed.
const FAILED: u8 = 1;
/// Wrong arguments, or a wrong project file.
const WRONG_USAGE: u8 = 2;
/// Finished, but some inputs were left out, or the results as a whole are in doubt.
const IN_DOUBT: u8 = 3;
/// The verdict is one that `--exit-on` asks for.
const VERDICT: u8 = 4;

fn main() -> ExitCode {
    say_panics_once();
    let args = <args::Args as clap::Parser>::parse();
    let printer = printer::Printer::new(args.quiet);
    let outcome = commands::dispatch(args, &printer);
    printer.finish();
    match outcome {
        Ok(commands::Outcome::Done) => ExitCode::from(DONE),
        Ok(commands::Outcome::InDoubt) => ExitCode::from(IN_DOUBT),
        Ok(commands::Outcome::Verdict) => ExitCode::from(VERDICT),
        Err(error) => {
            printer::note(&format!("error: {}", explain(&error)));
            ExitCode::from(if is_wrong_usage(&error) {
                WRONG_USAGE
            } else {
                FAILED
            })
        }
    }
}

/// Panics of decoders become errors that name the file, so nothing is said of them; any other is a defect of this program.
fn say_panics_once() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !stonewise_io::wall::is_behind_wall() {
            usual(panic);
            printer::note("error: this is a defect of stonewise; please report it with the lines above");
        }
    }));
}

/// Whether the command was given something that cannot be.
fn is_wrong_usage(error: &anyhow::Error) -> bool {
    let known = |cause: &(dyn std::error::Error + 'static)| {
        cause.downcast_ref().is_some_and(stonewise::Error::is_wrong_usage)
    };
    error.chain().any(known)
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
