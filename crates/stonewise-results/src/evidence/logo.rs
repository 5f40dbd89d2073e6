//! The picture of the report's first page.

use super::files::make_dir;
use crate::names::EVIDENCE_DIR;
use std::path::Path;
use stonewise_base::error::{Error, Result};
use stonewise_base::files::{is_there, read_bytes};
use stonewise_io::atomic::write_atomically;

/// Names of the file with its media type.
const FILES: [(&str, &str); 2] = [("logo.png", "image/png"), ("logo.jpg", "image/jpeg")];

/// A picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Logo {
    /// Its media type.
    pub media_type: &'static str,
    /// The file as it is.
    pub bytes: Vec<u8>,
}

/// Keeps a picture of this media type for the report.
///
/// # Errors
/// It cannot be read or written.
pub fn write_logo(dir: &Path, picture: &Path, media_type: &str) -> Result<()> {
    make_dir(dir)?;
    let bytes = read_bytes(picture)?;
    for (name, _) in FILES.iter().filter(|(_, kind)| *kind == media_type) {
        let path = dir.join(EVIDENCE_DIR).join(name);
        write_atomically(&path, |partial| std::fs::write(partial, &bytes))
            .map_err(Error::io("writing the logo", &path))?;
    }
    Ok(())
}

/// The picture, where there is one.
pub(super) fn read_logo(dir: &Path) -> Result<Option<Logo>> {
    for (name, media_type) in FILES {
        let path = dir.join(EVIDENCE_DIR).join(name);
        if is_there(&path)? {
            let bytes = read_bytes(&path)?;
            return Ok(Some(Logo { media_type, bytes }));
        }
    }
    Ok(None)
}
