//! Tables as comma-separated text.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::column::Values;
use super::csv_metadata::{write_csv_metadata, write_metadata_of};
use super::{Column, Table, TableError};
use crate::atomic::write_atomically;

/// Decimals of metres and radians: 0.1 micrometres are below the error of any survey.
const DECIMALS: i32 = 7;
/// Significant digits of other numbers, covariances among them.
const SIGNIFICANT: i32 = 6;
/// From here on numbers have an exponent.
const LARGE: f64 = 1e15;

/// Writes a table as CSV: a header line, then one line per row, `\n` at each end.
///
/// An empty cell stays empty; an empty string is written as `""`. Floats are rounded to what a reader can use: metres
/// and radians to seven decimals, all others to six significant digits, of which none before the decimal point is lost;
/// Parquet files keep every bit. Booleans are 1 and 0. Text is quoted where it holds a comma, a quote, a line break or
/// spaces at an end (RFC 4180). Text that a spreadsheet would take for a formula, because it begins with =, +, - or @,
/// gets an apostrophe in front.
///
/// Units and meanings of the columns go into `NAME.csv-metadata.json` beside it (W3C CSV on the Web).
/// `description`: what the table as a whole holds. `primary_key`: the column that identifies a row, if there
/// is one.
///
/// # Errors
/// A file cannot be written; an earlier file is kept then.
pub fn write_csv(
    path: &Path,
    table: &Table,
    description: &str,
    primary_key: Option<&str>,
) -> Result<(), TableError> {
    write_csv_alone(path, table)?;
    write_csv_metadata(path, table, description, primary_key)
}

/// Writes a table as [`write_csv`] does, with its metadata in the file `metadata`; `way`: from the folder of that
/// file to the table, with `/`.
///
/// # Errors
/// As [`write_csv`].
pub fn write_csv_described_in(
    [path, metadata]: [&Path; 2],
    way: &str,
    table: &Table,
    description: &str,
    primary_key: Option<&str>,
) -> Result<(), TableError> {
    write_csv_alone(path, table)?;
    write_metadata_of(way, metadata, table, description, primary_key)
}

fn write_csv_alone(path: &Path, table: &Table) -> Result<(), TableError> {
    write_atomically(path, |partial| {
        let mut out = BufWriter::new(File::create(partial)?);
        write_rows(&mut out, table)?;
        out.flush()
    })
    .map_err(|e| TableError::unwritable(path, e))
}

fn write_rows(out: &mut impl Write, table: &Table) -> io::Result<()> {
    for (i, name) in table.names().enumerate() {
        separate(out, i)?;
        write_text(out, name)?;
    }
    writeln!(out)?;
    let unit = |name: &str| table.metadata(&format!("{name}.unit")).unwrap_or("").to_owned();
    let units: Vec<String> = table.names().map(unit).collect();
    for row in 0..table.rows() {
        for (i, (_, column)) in table.columns().enumerate() {
            separate(out, i)?;
            write_cell(out, column, row, &units[i])?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn separate(out: &mut impl Write, column: usize) -> io::Result<()> {
    if column > 0 { out.write_all(b",") } else { Ok(()) }
}

fn write_cell(out: &mut impl Write, column: &Column, row: usize, unit: &str) -> io::Result<()> {
    if !column.is_filled(row) {
        return Ok(());
    }
    match column.raw() {
        Values::F64(v) => write_float(out, v[row], unit),
        Values::F32(v) => write_float(out, f64::from(v[row]), unit),
        Values::I64(v) => write!(out, "{}", v[row]),
        Values::U64(v) => write!(out, "{}", v[row]),
        Values::U32(v) => write!(out, "{}", v[row]),
        Values::U16(v) => write!(out, "{}", v[row]),
        Values::U8(v) => write!(out, "{}", v[row]),
        Values::Bool(v) => write!(out, "{}", u8::from(v[row])),
        Values::Text(v) => write_text(out, &v[row]),
        Values::Bytes(v) => v[row].iter().try_for_each(|byte| write!(out, "{byte:02x}")),
    }
}

fn write_float(out: &mut impl Write, value: f64, unit: &str) -> io::Result<()> {
    match rounded(value, unit) {
        value if is_plain(value) => write!(out, "{value}"),
        value => write!(out, "{value:e}"),
    }
}

/// The number with the digits that a reader can use.
fn rounded(value: f64, unit: &str) -> f64 {
    let decimals = match unit {
        _ if value == 0.0 => 0,
        "m" | "rad" => DECIMALS,
        _ => SIGNIFICANT - 1 - (value.abs().log10().floor() as i32).clamp(-300, SIGNIFICANT - 1),
    };
    let text = match value.abs() < LARGE {
        true => format!("{value:.*}", decimals.unsigned_abs() as usize),
        false => format!("{value:.*e}", SIGNIFICANT as usize - 1),
    };
    // Without the sign of a zero.
    text.parse::<f64>().map_or(value, |v| v + 0.0)
}

/// Whether a number is short without an exponent.
fn is_plain(value: f64) -> bool {
    value == 0.0 || !value.is_finite() || (1e-5..LARGE).contains(&value.abs())
}

fn write_text(out: &mut impl Write, text: &str) -> io::Result<()> {
    let shielded = format!("'{text}");
    let is_formula = text.trim_start().starts_with(['=', '+', '-', '@']);
    let text = if is_formula { &shielded } else { text };
    let quoted = text.is_empty() || text.contains([',', '"', '\n', '\r']) || text.trim() != text;
    if quoted {
        write!(out, "\"{}\"", text.replace('"', "\"\""))
    } else {
        out.write_all(text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_begins_like_a_formula() {
        let mut table = Table::new();
        let names = ["=1+1", "+a", "-b.jpg", "@c", " =HYPERLINK(\"x\")", "a=b"];
        table
            .push("photo", "", "photo", names.map(str::to_owned).to_vec())
            .unwrap();
        table.push("number", "", "number", vec![-1.5; 6]).unwrap();
        let mut out = Vec::new();
        write_rows(&mut out, &table).unwrap();
        let expected = "photo,number\n'=1+1,-1.5\n'+a,-1.5\n'-b.jpg,-1.5\n'@c,-1.5\n\
                        \"' =HYPERLINK(\"\"x\"\")\",-1.5\na=b,-1.5\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
    }

    #[test]
    fn numbers_have_digits_that_mean_something() {
        let written = |value: f64, unit: &str| {
            let (mut table, mut out) = (Table::new(), Vec::new());
            table.push("x", unit, "x", vec![value]).unwrap();
            write_rows(&mut out, &table).unwrap();
            let text = String::from_utf8(out).unwrap();
            text.strip_prefix("x\n").unwrap().trim_end().to_owned()
        };
        for (value, unit, expected) in [
            (-0.0004947185324852614, "m", "-0.0004947"),
            (412_345.123_456_789, "m", "412345.1234568"),
            (-3.2e-9, "m", "0"),
            (0.003_322_166_533_399_558, "rad", "0.0033222"),
            (3.4727908551270866e-7, "m2", "3.47279e-7"),
            (-1.5e-12, "rad2", "-1.5e-12"),
            (0.957626602851628, "", "0.957627"),
            (24.123456789, "mm", "24.1235"),
            (1_234_567.891, "", "1234568"),
            (2.512_345_678e17, "", "2.51235e17"),
            (0.0, "m2", "0"),
            (f64::NAN, "m2", "NaN"),
        ] {
            assert_eq!(written(value, unit), expected, "{value} {unit}");
        }
    }

    #[test]
    fn cells_are_written_by_type() {
        let mut table = Table::new();
        table.push("id", "", "id", vec![1u32, 2, 3]).unwrap();
        table
            .push("d, m", "", "d, m", vec![Some(0.1), None, Some(1.5e-9)])
            .unwrap();
        table.push("f", "", "f", vec![0.1f32, 1e20, -2.0]).unwrap();
        table
            .push("ok", "", "ok", vec![Some(true), Some(false), None])
            .unwrap();
        let words = ["plain", "", "say \"no\", twice"].map(str::to_owned);
        table.push("word", "", "word", words.to_vec()).unwrap();
        let mut out = Vec::new();
        write_rows(&mut out, &table).unwrap();
        let expected = "id,\"d, m\",f,ok,word\n\
                        1,0.1,0.1,1,plain\n\
                        2,,1e20,0,\"\"\n\
                        3,1.5e-9,-2,,\"say \"\"no\"\", twice\"\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
    }
}
