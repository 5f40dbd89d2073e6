//! A network as a table, with the lower triangle of its covariance in a file beside it.

use super::{AdjustedCoordinate, Begins, NetworkError, Raw, covariance_text, error, number, text_of};
use crate::table::{CsvError, CsvFile};
use nalgebra::DMatrix;
use std::path::Path;

const PLACE: [&str; 3] = ["x", "y", "z"];
const ADJUSTED: [&str; 3] = ["dx", "dy", "dz"];

pub(super) fn read(path: &Path) -> Result<(Raw, Begins), NetworkError> {
    let in_table = |e: CsvError| {
        let column = e.column.map_or(String::new(), |name| format!("{name}: "));
        error(path, e.line, format!("{column}{}", e.message))
    };
    let file = CsvFile::parse(path, text_of(path)?).map_err(in_table)?;
    let column = |name: &str| {
        let missing = || error(path, 1, format!("no column {name}: name, x, y and z are needed"));
        file.column(name).ok_or_else(missing)
    };
    let of_name = column("name")?;
    let place = [column("x")?, column("y")?, column("z")?];
    let adjusted = match ADJUSTED.map(|name| file.column(name)) {
        [None, None, None] => place.map(Some),
        named => named,
    };

    let mut raw = Raw::default();
    let mut count = 0;
    for row in file.rows() {
        let row = row.map_err(in_table)?;
        let name = row.text(of_name).to_owned();
        let wrong = |message: String| error(path, row.line(), message);
        if name.is_empty() {
            return Err(wrong("a point needs a name".to_owned()));
        }
        if raw.points.iter().any(|p| p.name == name) {
            return Err(wrong(format!("{name} is there twice: remove one")));
        }
        let point = raw.point(&name, row.line());
        for axis in 0..3 {
            let value = row.number(place[axis]).map_err(in_table)?;
            let missing = || {
                wrong(format!(
                    "{name}: {} is empty: give the place of the point",
                    PLACE[axis]
                ))
            };
            point.place[axis] = Some(value.ok_or_else(missing)?);
            let Some(of_value) = adjusted[axis] else { continue };
            if let Some(value_m) = row.number(of_value).map_err(in_table)? {
                point.adjusted[axis] = Some(AdjustedCoordinate { value_m, row: count });
                count += 1;
            }
        }
    }

    let matrix_path = path.with_extension("cov");
    let text = covariance_text(&matrix_path, path)?;
    let lines = text.lines().zip(1..).filter(|(text, _)| !text.trim().is_empty());
    raw.covariance = DMatrix::zeros(count, count);
    let mut rows = 0;
    for (text, line) in lines {
        let wrong = |message: String| error(&matrix_path, line, message);
        let cells = text.split(|c: char| c.is_whitespace() || ",;".contains(c));
        let row: Result<Vec<f64>, String> = cells.filter(|cell| !cell.is_empty()).map(number).collect();
        let row = row.map_err(wrong)?;
        rows += 1;
        if row.len() != rows || rows > count {
            let message = format!(
                "{} numbers in row {rows} of a lower triangle of {count} rows: row 1 has one number, each other one more than \
                 the row above it",
                row.len()
            );
            return Err(wrong(message));
        }
        for (c, value) in row.into_iter().enumerate() {
            raw.covariance[(rows - 1, c)] = value;
            raw.covariance[(c, rows - 1)] = value;
        }
    }
    if rows < count {
        let message = format!("{rows} rows, and {count} values are adjusted: add a row for each");
        return Err(error(&matrix_path, rows.max(1), message));
    }
    let begins = Begins {
        path: matrix_path,
        line: 1,
    };
    Ok((raw, begins))
}
