//! `report`.

use crate::args::ReportArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::Result;

/// Writes the report again, from result files alone.
pub fn report(args: &ReportArgs, printer: &Printer) -> Result<Outcome> {
    stonewise::report::write_report(&args.results)?;
    printer.log(&format!(
        "wrote {}",
        args.results.join("report/index.html").display()
    ));
    Ok(Outcome::Done)
}
