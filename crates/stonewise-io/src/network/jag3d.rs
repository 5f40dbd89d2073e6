//! The export of JAG3D (`DefaultNetworkAdjustmentResultWriter`): `NAME.info` with a line for each adjusted coordinate,
//! of five columns between tabs: point, X, Y or Z, metres, column in the covariance from 0, number of observations; and
//! `NAME.cxx` with the whole covariance of all unknowns, m^2. X points north and Y east.

use super::{AdjustedCoordinate, Begins, NetworkError, Raw, covariance_text, error, number, text_of};
use nalgebra::DMatrix;
use std::path::Path;

pub(super) fn read(path: &Path) -> Result<(Raw, Begins), NetworkError> {
    let mut raw = Raw::default();
    let mut columns = Vec::new();
    for (text, line) in text_of(path)?.lines().zip(1..) {
        let cells: Vec<&str> = text.split('\t').map(str::trim).collect();
        let wrong = |message: String| error(path, line, message);
        let [name, axis, value, column, ..] = cells[..] else {
            if text.trim().is_empty() {
                continue;
            }
            let message = "point, axis, coordinate and column must stand between tabs, as JAG3D writes them";
            return Err(wrong(message.to_owned()));
        };
        let axis = match axis {
            "Y" => 0,
            "X" => 1,
            "Z" => 2,
            other => return Err(wrong(format!("the axis must be X, Y or Z, not {other:?}"))),
        };
        let value_m = number(value).map_err(wrong)?;
        let column: usize = column
            .parse()
            .map_err(|_| wrong(format!("{column:?} is no column")))?;
        let point = raw.point(name, line);
        if point.place[axis].replace(value_m).is_some() {
            return Err(wrong(format!("{name} is there twice: remove one")));
        }
        point.adjusted[axis] = Some(AdjustedCoordinate {
            value_m,
            row: columns.len(),
        });
        columns.push((column, line));
    }

    let matrix_path = path.with_extension("cxx");
    let text = covariance_text(&matrix_path, path)?;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for (text, line) in text.lines().zip(1..).filter(|(text, _)| !text.trim().is_empty()) {
        let row: Result<Vec<f64>, String> = text.split_whitespace().map(number).collect();
        rows.push(row.map_err(|message| error(&matrix_path, line, message))?);
    }
    let size = rows.len();
    if let Some(odd) = rows.iter().position(|row| row.len() != size) {
        let message = format!(
            "{} numbers in a matrix of {size} rows: is the file complete?",
            rows[odd].len()
        );
        return Err(error(&matrix_path, odd + 1, message));
    }
    if let Some((column, line)) = columns.iter().find(|(column, _)| *column >= size) {
        let message = format!(
            "column {column} is not in {}, which has {size}: export both files again",
            matrix_path.display()
        );
        return Err(error(path, *line, message));
    }
    raw.covariance = DMatrix::from_fn(columns.len(), columns.len(), |r, c| {
        rows[columns[r].0][columns[c].0]
    });
    let begins = Begins {
        path: matrix_path,
        line: 1,
    };
    Ok((raw, begins))
}
