//! The `stonewise` command, see the library of this crate.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(stonewise_cli::main_with_args(std::env::args_os()))
}
