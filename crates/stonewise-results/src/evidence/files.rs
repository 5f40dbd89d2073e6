//! The folder of excerpts and its files.

use crate::names::EVIDENCE_DIR;
use std::path::{Path, PathBuf};
use stonewise_base::error::Error;
use stonewise_base::files::is_there;
use stonewise_io::table::{Table, read_parquet};

/// A file of the folder.
pub(super) fn path(dir: &Path, stem: &str, epoch: usize, extension: &str) -> PathBuf {
    dir.join(EVIDENCE_DIR).join(format!("{stem}_{epoch}.{extension}"))
}

/// Makes the folder.
pub(super) fn make_dir(dir: &Path) -> Result<(), Error> {
    let folder = dir.join(EVIDENCE_DIR);
    std::fs::create_dir_all(&folder).map_err(Error::io("making the folder", &folder))
}

/// A whole number above zero of a table's metadata.
pub(super) fn metadata_number(table: &Table, key: &str, path: &Path) -> Result<u32, Error> {
    let value = table
        .metadata(key)
        .and_then(|v| v.parse::<u32>().ok())
        .filter(|v| *v > 0);
    value.ok_or_else(|| Error::Results {
        path: path.into(),
        message: format!("no {key} in the table's metadata"),
    })
}

/// A table, or `None` where the file is missing.
pub fn read_table(path: &Path) -> Result<Option<Table>, Error> {
    if !is_there(path)? {
        return Ok(None);
    }
    Ok(Some(read_parquet(path)?))
}
