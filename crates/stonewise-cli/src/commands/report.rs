//! `report`.

use crate::args::ReportArgs;
use crate::commands::Outcome;
use crate::printer::Printer;
use anyhow::Result;
use stonewise::OutputFolder;
use stonewise::report::Pdf;
use stonewise::results::names::{DATA_DIR, PairFile};

/// Writes the report and the layers again, from result files alone; with `--pdf` as PDF, too.
pub fn report(args: &ReportArgs, force: bool, printer: &Printer) -> Result<Outcome> {
    let pdf = args.pdf.as_deref().map(|pdf| Pdf::at(pdf, force)).transpose()?;
    let folder = OutputFolder::of_results(&args.results)?;
    stonewise::report::write_report(&args.results)?;
    stonewise::export::write_layers(&args.results)?;
    folder.note_made_anew()?;
    printer.log(&format!(
        "wrote {}, stones.gpkg, and stones.geo.parquet, stones.vtp, stones.ply and stones.dxf in {DATA_DIR}",
        args.results.join(PairFile::ReportPage.place(1)).display()
    ));
    if let Some(pdf) = &pdf {
        match args.yearly {
            true => pdf.write_yearly(&args.results, printer)?,
            false => pdf.write(&args.results, !args.no_appendix, printer)?,
        }
        printer.log(&format!("wrote {}", pdf.path().display()));
    }
    Ok(Outcome::Done)
}
