//! CSV files of readings: a first line that names the columns, one of them `date`.

use std::path::{Path, PathBuf};
use stonewise_base::error::{Error, Result};
use stonewise_results::calendar::day_of;

/// A file of readings, cell by cell.
pub(crate) struct DatedCsv {
    path: PathBuf,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Its lines below the head, without empty ones.
    pub rows: Vec<DatedRow>,
}

/// A line of it.
pub(crate) struct DatedRow {
    /// Its number in the file, the head being 1.
    pub line: usize,
    /// Its date as it is written.
    pub date: String,
    /// Days since 1970-01-01.
    pub day: f64,
    cells: Vec<String>,
}

impl DatedCsv {
    /// Reads a file; `what` it is, after "reading".
    ///
    /// # Errors
    /// With the line: no column `date`, two columns of one name, another number of cells, a date that is not valid.
    pub fn read(path: &Path, what: &'static str) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(Error::io(what, path))?;
        let mut file = Self {
            path: path.to_path_buf(),
            head: Vec::new(),
            rows: Vec::new(),
        };
        let text = String::from_utf8(bytes)
            .map_err(|_| file.error(1, "a character that is not in UTF-8: save the file as UTF-8"))?;
        let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
        file.head = lines.next().map_or_else(Vec::new, |(_, head)| cells(head));
        let Some(of_date) = file.place("date") else {
            let message = "the first line must name the columns, separated by commas, one of them `date`";
            return Err(file.error(1, message));
        };

        let head = &file.head;
        if let Some(twin) = (1..head.len()).find(|&i| head[..i].contains(&head[i])) {
            let message = format!("two columns are named {:?}: rename one", head[twin]);
            return Err(file.error(1, message));
        }

        for (line, text) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let cells = cells(text);
            if cells.len() != file.head.len() {
                let message = format!(
                    "{} cells, but the first line names {} columns: write decimals with a point, and leave a cell empty where \
                     there is no reading",
                    cells.len(),
                    file.head.len()
                );
                return Err(file.error(line, message));
            }
            let date = cells[of_date].clone();
            let Some(day) = day_of(&date) else {
                return Err(file.error(line, format!("{date:?} is no date: write it as 2026-04-10")));
            };
            file.rows.push(DatedRow {
                line,
                date,
                day,
                cells,
            });
        }

        Ok(file)
    }

    /// An error in a line.
    pub fn error(&self, line: usize, message: impl Into<String>) -> Error {
        Error::Project {
            path: self.path.clone(),
            line,
            message: message.into(),
        }
    }

    /// The place of a column.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.head.iter().position(|c| c == name)
    }

    /// A number; `None` for an empty cell.
    ///
    /// # Errors
    /// The cell holds something else.
    pub fn number(&self, row: &DatedRow, column: usize) -> Result<Option<f64>> {
        let cell = row.text(column);
        if cell.is_empty() {
            return Ok(None);
        }
        match cell.parse::<f64>().ok().filter(|v| v.is_finite()) {
            Some(value) => Ok(Some(value)),
            None => {
                let name = &self.head[column];
                let message =
                    format!("{name}: {cell:?} is no number: leave the cell empty where there is no reading");
                Err(self.error(row.line, message))
            }
        }
    }
}

impl DatedRow {
    /// A cell as it is written.
    pub fn text(&self, column: usize) -> &str {
        &self.cells[column]
    }
}

fn cells(line: &str) -> Vec<String> {
    line.split(',')
        .map(|c| c.trim().trim_matches('"').to_owned())
        .collect()
}
