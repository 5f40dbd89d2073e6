//! All systems that `stonewise_io::crs::projjson` writes, one a line; `testdata/crs/projjson.py` compares them with PROJ.

use crate::Outcome;
use crate::words::Words;
use std::io::Write;
use stonewise_io::crs::projjson;

/// Prints the definitions.
pub fn run(_: &Words) -> Outcome {
    let mut out = std::io::stdout().lock();
    for definition in (1..100_000).filter_map(projjson) {
        writeln!(out, "{definition}")?;
    }
    Ok(())
}
