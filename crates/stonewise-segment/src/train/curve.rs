//! Figures of a training, step by step, as CSV.

use super::error::TrainError;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use stonewise_io::atomic::write_atomically;
use stonewise_io::table::{CsvError, CsvFile, CsvRow, Table, write_csv_metadata};

/// A CSV that grows by a row at a time; its first column is the step.
pub struct Curve {
    path: PathBuf,
    file: File,
}

impl Curve {
    /// Opens the curve of a training that has come to `steps`: rows of later steps, which will be done again,
    /// are removed. Units and meanings of the columns go into a file beside it.
    ///
    /// `columns`: what the curve holds, without rows. `description`: the same in a sentence.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn open(path: &Path, columns: &Table, description: &str, steps: u64) -> Result<Self, TrainError> {
        let old = match std::fs::read_to_string(path) {
            Ok(text) if steps > 0 => text,
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(TrainError::io("reading the curve", path)(error));
            }
            _ => String::new(),
        };
        let names: Vec<&str> = columns.names().collect();
        let mut text = format!("{}\n", names.join(","));
        let old = table(path, old)?;
        // The last row of a training that was killed may be half a row.
        for row in old.rows().flatten() {
            if row.text(0).parse().is_ok_and(|step: u64| step <= steps) {
                let cells: Vec<&str> = (0..old.head().len()).map(|i| row.text(i)).collect();
                text += &format!("{}\n", cells.join(","));
            }
        }
        write_atomically(path, |partial| std::fs::write(partial, text))
            .map_err(TrainError::io("writing the curve", path))?;
        write_csv_metadata(path, columns, description, Some("step"))?;
        let file = OpenOptions::new().append(true).open(path);
        Ok(Self {
            path: path.to_owned(),
            file: file.map_err(TrainError::io("writing the curve", path))?,
        })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, step: u64, values: &[f64]) -> Result<(), TrainError> {
        let values: String = values.iter().map(|v| format!(",{v:.6}")).collect();
        let written = self.file.write_all(format!("{step}{values}\n").as_bytes());
        written.map_err(TrainError::io("writing the curve", &self.path))
    }
}

/// The columns of a curve by position, the step among them; rows that are not numbers throughout are left
/// out.
///
/// # Errors
/// The file cannot be read.
pub fn read_curve(path: &Path) -> Result<Vec<Vec<f64>>, TrainError> {
    let text = std::fs::read_to_string(path).map_err(TrainError::io("reading the curve", path))?;
    let file = table(path, text)?;
    let numbers = |row: CsvRow<'_>| (0..file.head().len()).map(|i| row.text(i).parse().ok()).collect();
    Ok(file.rows().flatten().filter_map(numbers).collect())
}

fn table(path: &Path, text: String) -> Result<CsvFile, TrainError> {
    let damaged = |e: CsvError| std::io::Error::new(std::io::ErrorKind::InvalidData, e.said());
    CsvFile::parse(path, text).map_err(|e| TrainError::io("reading the curve", path)(damaged(e)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_curve_has_no_row_twice() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("loss.csv");
        let mut columns = Table::new();
        columns.push("step", "", "steps done", Vec::<u64>::new()).unwrap();
        columns
            .push("loss", "", "sum of all losses", Vec::<f64>::new())
            .unwrap();
        let mut curve = Curve::open(&path, &columns, "losses", 0).unwrap();
        for step in 1..=4 {
            curve.add(step, &[step as f64 / 2.0]).unwrap();
        }
        let mut curve = Curve::open(&path, &columns, "losses", 2).unwrap();
        curve.add(3, &[9.0]).unwrap();
        assert_eq!(read_curve(&path).unwrap(), [[1.0, 0.5], [2.0, 1.0], [3.0, 9.0]]);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("step,loss\n"), "{text}");
    }
}
