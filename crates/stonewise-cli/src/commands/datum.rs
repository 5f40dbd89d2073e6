//! `datum`.

use crate::args::DatumArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::{Result, bail};
use stonewise::results::fixed_datum;
use stonewise_io::table::write_csv;

/// What the table as a whole holds.
const DESCRIPTION: &str =
    "Motions of the stones against the rigid motion of the stones that were taken as fixed.";

/// Writes the motions of finished results against stones that are taken as fixed.
pub fn datum(args: &DatumArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    if args.out.exists() && !force {
        bail!("{} exists; --force replaces it", args.out.display());
    }
    let table = fixed_datum(&args.results, &args.fixed)?;
    write_csv(&args.out, &table, DESCRIPTION, None)?;
    printer.log(&format!(
        "motions against the fixed stones written to {}",
        args.out.display()
    ));
    Ok(Outcome::Done)
}
