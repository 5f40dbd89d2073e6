//! Text of a JSON file.

use super::MaskError;
use crate::text;
use std::path::Path;

/// The text of a file, without the mark that some editors put before it.
pub fn read_json_text(path: &Path) -> Result<String, MaskError> {
    text::read_text(path).map_err(|source| MaskError::Read {
        path: path.to_owned(),
        source,
    })
}
