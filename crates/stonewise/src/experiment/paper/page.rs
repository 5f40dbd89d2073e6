//! The page of the experiment and its files.

use super::case::Case;
use super::figures::figures;
use super::tables::PaperTables;
use crate::error::{Error, Result};
use crate::experiment::tables::TextTable;
use crate::figure::{Page, jpeg_element};
use crate::files::write_text;
use std::fs;
use std::path::Path;
use stonewise_io::table::write_csv;

/// What `table2.csv` as a whole holds.
const TABLE_2: &str = "One row per method, survey, motion and region.";

/// Writes everything that the experiment came to; `example`: caption and JPEG of figure 5.
pub(super) fn write(
    cases: &[Case],
    example: Option<(String, Vec<u8>)>,
    tables: &PaperTables,
    out: &Path,
) -> Result<()> {
    write_text(&out.join("tables.md"), &tables.markdown())?;
    write_csv(&out.join("table2.csv"), &tables.details, TABLE_2, None)?;
    let folder = out.join("figures");
    fs::create_dir_all(&folder).map_err(Error::io("making a folder", &folder))?;
    let mut page = Page::new("The paper's experiment");
    page.note(
        "One epoch is split at random into two halves of its points and photos; each half is labelled on its own; the points \
         of the second are then moved by a known field, and everything is measured as between two epochs. In-plane figures are \
         per axis, as the paper's.",
    );
    page.heading("Table 1: parameters")
        .html(&tables.parameters.html(None));
    page.heading("Table 2: RMSE of detected and applied motions")
        .html(&tables.rmse.html(None));
    page.note(
        "In-plane: the translation of 2 cm along and 5 cm up. Out-of-plane: the bulge, over all stones of the wall, still ones \
         too; the rows \"inside it\" below count only the place that moves. The zero predictor always answers \"did not move\".",
    );
    page.html(&TextTable::of(&tables.details).html(None));
    page.heading("Figures");
    if let Some((caption, jpeg)) = example {
        page.figure(&caption, &jpeg_element(&jpeg, &caption));
    }
    for (name, caption, plot) in cases.iter().flat_map(figures) {
        let svg = plot.svg();
        write_text(&folder.join(format!("{name}.svg")), &svg)?;
        page.figure(&caption, &svg);
    }
    write_text(&out.join("index.html"), &page.finish())
}
