//! Motions of finished results against stones that are taken as fixed.

use crate::error::explained;
use pyo3::prelude::*;
use std::path::PathBuf;
use stonewise::results::fixed_datum;
use stonewise_io::table::write_parquet;

/// Writes the table of `stonewise datum` as Parquet.
#[pyfunction]
pub fn fixed(results: PathBuf, stones: &str, out: PathBuf) -> PyResult<()> {
    let table = fixed_datum(&results, stones).map_err(explained)?;
    write_parquet(&out, &table).map_err(explained)
}
