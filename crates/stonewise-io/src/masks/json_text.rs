//! Text of a JSON file.

use super::MaskError;
use std::path::Path;

/// The text of a file in UTF-8, without the mark that some editors put before it.
pub fn read_json_text(path: &Path) -> Result<String, MaskError> {
    let text = std::fs::read_to_string(path).map_err(|source| MaskError::Read {
        path: path.to_owned(),
        source,
    })?;
    Ok(text.trim_start_matches('\u{feff}').to_owned())
}
