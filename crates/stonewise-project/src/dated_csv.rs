//! CSV files of readings: a first line that names the columns, one of them `date`.

use std::path::Path;
use stonewise_base::error::{Error, Result};
use stonewise_io::table::{CsvError, CsvFile, CsvRow};
use stonewise_results::calendar::day_of_cell;

/// A file of readings, cell by cell.
pub(crate) struct DatedCsv {
    /// Its cells.
    pub file: CsvFile,
    /// The column of dates.
    pub of_date: usize,
}

/// A line of it.
pub(crate) struct DatedRow<'a> {
    /// Its cells.
    pub cells: CsvRow<'a>,
    /// Its date as it is written.
    pub date: String,
    /// Days since 1970-01-01.
    pub day: f64,
}

impl DatedCsv {
    /// Reads a file; `what` it is, after "reading".
    ///
    /// # Errors
    /// With the line: no column `date`, two columns of one name.
    pub fn read(path: &Path, what: &'static str) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(Error::io(what, path))?;
        let file = CsvFile::parse(path, bytes).map_err(in_project)?;
        let Some(of_date) = date_column(&file) else {
            let message = "the first line must name the columns, one of them `date`";
            return Err(in_project(file.error(1, message)));
        };
        Ok(Self { file, of_date })
    }

    /// Its lines below the head.
    ///
    /// # Errors
    /// With the line: another number of cells than columns, a date that is not valid.
    pub fn rows(&self) -> impl Iterator<Item = Result<DatedRow<'_>>> {
        self.file.rows().map(|cells| {
            let cells = cells.map_err(in_project)?;
            let date = cells.text(self.of_date).to_owned();
            let Some(day) = day_of_cell(&date) else {
                let message = format!("{date:?} is no date: write it as 2026-04-10 or 10.04.2026");
                return Err(in_project(cells.error(message)));
            };
            Ok(DatedRow { cells, date, day })
        })
    }

    /// An error in the first line.
    pub fn error(&self, message: impl Into<String>) -> Error {
        in_project(self.file.error(1, message))
    }
}

impl DatedRow<'_> {
    /// A number; `None` for an empty cell.
    ///
    /// # Errors
    /// The cell holds something else.
    pub fn number(&self, column: usize) -> Result<Option<f64>> {
        self.cells.number(column).map_err(in_project)
    }

    /// An error in the line.
    pub fn error(&self, message: impl Into<String>) -> Error {
        in_project(self.cells.error(message))
    }
}

/// The column `date`, in whatever case; else, for heads in other languages, the one column that begins with a date.
fn date_column(file: &CsvFile) -> Option<usize> {
    let named = file
        .head()
        .iter()
        .position(|name| name.eq_ignore_ascii_case("date"));
    named.or_else(|| {
        let first = file.rows().next()?.ok()?;
        let mut dates = (0..file.head().len()).filter(|&i| day_of_cell(first.text(i)).is_some());
        dates.next().filter(|_| dates.next().is_none())
    })
}

/// An error in a file that the project file names.
fn in_project(error: CsvError) -> Error {
    Error::Project {
        path: error.path,
        line: error.line,
        message: match error.column {
            Some(column) => format!("{column}: {}", error.message),
            None => error.message,
        },
    }
}
