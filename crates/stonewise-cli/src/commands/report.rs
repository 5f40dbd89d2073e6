//! `report`.

use crate::args::ReportArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::Result;
use stonewise::OutputFolder;

/// Writes the report and the layers again, from result files alone.
pub fn report(args: &ReportArgs, printer: &Printer) -> Result<Outcome> {
    let _folder = OutputFolder::of_results(&args.results)?;
    stonewise::report::write_report(&args.results)?;
    stonewise::export::write_layers(&args.results)?;
    let results = args.results.display();
    printer.log(&format!(
        "wrote {results}/report/index.html, stones.gpkg, stones.geojson, stones.vtp and stones.ply"
    ));
    Ok(Outcome::Done)
}
