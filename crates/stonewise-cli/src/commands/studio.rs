//! `studio`.

use crate::args::StudioArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use crate::stdout::stdout;
use anyhow::{Context, Result};
use std::io::Write;
use std::process::{Command, Stdio};
use stonewise_core::progress::Progress;
use stonewise_studio::Studio;

/// Serves the page until Ctrl-C, or until the last page has been closed for a while.
pub fn studio(args: &StudioArgs, printer: &Printer) -> Result<Outcome> {
    let studio = Studio::open(&args.place, args.port, args.view)
        .with_context(|| format!("the studio cannot open {}", args.place.display()))?;
    let mut out = stdout();
    writeln!(out, "{}", studio.address())?;
    out.flush()?;
    if !args.no_browser {
        let address = studio.address_for_browser();
        if !address.is_some_and(|address| start_browser(&address)) {
            printer.log("note: no browser could be started; open the address above");
        }
    }
    printer.log("Ctrl-C ends the studio; a minute after the last page is closed it ends by itself");
    printer.listen();
    studio.wait(|| printer.is_cancelled());
    Ok(Outcome::Done)
}

/// Opens an address with the program that the system has for it.
fn start_browser(address: &str) -> bool {
    let (program, first): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("rundll32", &["url.dll,FileProtocolHandler"]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(first).arg(address);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.spawn().is_ok()
}
