//! The `stonewise` command: reads arguments, calls the library, prints.
//!
//! A library, so that the Python module has the same command and says the same of what goes wrong:
//!
//! ```
//! let words = ["stonewise", "explain", "not-converged"];
//! let exit_code = stonewise_cli::main_with_args(words.map(Into::into));
//! assert_eq!(exit_code, 0);
//! ```

mod args;
mod commands;
mod counted;
mod gone;
mod note;
mod printer;
mod renamed;
mod screen;
mod stdout;
mod steps;

use clap::FromArgMatches;
use clap::error::ErrorKind;
pub use commands::{measure, simulate_survey};
use std::ffi::OsString;
use std::io::Write;

/// Everything was done.
const DONE: u8 = 0;
/// Something failed.
const FAILED: u8 = 1;
/// Wrong arguments, or a wrong project or parameter file.
const WRONG_USAGE: u8 = 2;
/// Finished, but some inputs were left out, or the results as a whole are in doubt.
const IN_DOUBT: u8 = 3;
/// The verdict is at or above the state of `--exit-on`.
const VERDICT: u8 = 4;

/// Runs the command of these arguments, the first of which is the program's name; returns the exit code.
pub fn main_with_args(args: impl IntoIterator<Item = OsString>) -> u8 {
    say_panics_once();
    let mut words: Vec<OsString> = args.into_iter().collect();
    if let Some((present, said)) = renamed::renamed(&words) {
        if !words.iter().any(|word| word == "--quiet" || word == "-q") {
            note::note(&said);
        }
        words = present;
    }
    let parsed = args::command().try_get_matches_from(&words);
    let args = match parsed.and_then(|matches| args::Args::from_arg_matches(&matches)) {
        Ok(args) => args,
        Err(error) => {
            // A closed stream is no reason to fail.
            let _ = error.print();
            if let Some(instead) = gone::instead(&words).filter(|_| error.use_stderr()) {
                note::note(instead);
            }
            if error.kind() == ErrorKind::DisplayVersion && words.iter().any(|word| word == "--verbose") {
                let _ = write!(std::io::stdout(), "{}", commands::version_details());
            }
            return if error.use_stderr() { WRONG_USAGE } else { DONE };
        }
    };
    let printer = printer::Printer::new(args.quiet);

    let outcome = commands::dispatch(args, &printer);
    match &outcome {
        Ok(_) => printer.finish(),
        Err(_) => printer.abandon(),
    }

    match outcome {
        Ok(commands::Outcome::Done) => DONE,
        Ok(commands::Outcome::InDoubt) => IN_DOUBT,
        Ok(commands::Outcome::Verdict) => VERDICT,
        Ok(commands::Outcome::Failed) => FAILED,
        Err(error) => {
            note::note(&format!("error: {}{}", explain(&error), code(&error)));
            if is_wrong_usage(&error) {
                WRONG_USAGE
            } else {
                FAILED
            }
        }
    }
}

/// Panics of decoders become errors that name the file, so nothing is said of them; any other is a defect of
/// this program.
fn say_panics_once() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !stonewise_io::wall::is_behind_wall() {
            usual(panic);
            note::note("error: this is a defect of stonewise; please report it with the lines above");
        }
    }));
}

/// Code of the error in brackets, for `stonewise explain`; nothing where it has none.
fn code(error: &anyhow::Error) -> String {
    let mut known = errors_of_library(error);
    known
        .next()
        .map_or_else(String::new, |e| format!(" [{}]", e.code()))
}

/// Whether the command was given something that cannot be.
fn is_wrong_usage(error: &anyhow::Error) -> bool {
    errors_of_library(error).any(stonewise::Error::is_wrong_usage)
}

/// The library's errors among an error and its causes.
fn errors_of_library(error: &anyhow::Error) -> impl Iterator<Item = &stonewise::Error> {
    error.chain().filter_map(|cause| cause.downcast_ref())
}

/// The error and its causes in one line, as the command prints it; a cause that is part of the text already
/// is not said twice.
pub fn explain(error: &anyhow::Error) -> String {
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
