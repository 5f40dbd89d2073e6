//! Telling formats apart.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::CloudError;
use crate::folder::extension;

/// A family of point cloud files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudFormat {
    /// LAS 1.0 to 1.4, plain, compressed as LAZ, or ordered as COPC.
    Las,
    /// ASTM E2807.
    E57,
    /// Leica PTX: text, each scan with the place of its scanner.
    Ptx,
    /// Stanford PLY, text or binary of either byte order.
    Ply,
    /// Text, one point per line; PTS too.
    Text,
}

/// Extensions of clouds in formats that are not read: of scanners' own programs, and of the Point Cloud Library.
const UNREAD_EXTENSIONS: [&str; 7] = ["rcp", "rcs", "fls", "zfs", "rdbx", "lgs", "pcd"];
/// Extensions of text files; every other format but PTX says what it is in its first bytes.
const TEXT_EXTENSIONS: [&str; 7] = ["xyz", "txt", "csv", "asc", "pts", "xyzrgb", "neu"];

impl CloudFormat {
    /// The format of a file: by its first bytes, else by its extension.
    ///
    /// # Errors
    /// The file cannot be read, or its format is not supported.
    pub fn of(path: &Path) -> Result<Self, CloudError> {
        let mut start = Vec::new();
        File::open(path)
            .and_then(|file| file.take(8).read_to_end(&mut start))
            .map_err(|e| CloudError::read(path, e))?;
        let extension = extension(path);
        match start.as_slice() {
            s if s.starts_with(b"LASF") => Ok(Self::Las),
            s if s.starts_with(b"ASTM-E57") => Ok(Self::E57),
            [b'p', b'l', b'y', next, ..] if next.is_ascii_whitespace() => Ok(Self::Ply),
            s if s.starts_with(b"# .PCD") || is_unread_cloud(path) => {
                Err(CloudError::NotRead(path.to_owned()))
            }
            _ if extension == "ptx" => Ok(Self::Ptx),
            _ if TEXT_EXTENSIONS.contains(&extension.as_str()) => Ok(Self::Text),
            _ => Err(wrong_start(path, &extension, start.is_empty())),
        }
    }
}

/// Whether a file is, by its name, a cloud in a format that is not read.
pub fn is_unread_cloud(path: &Path) -> bool {
    UNREAD_EXTENSIONS.contains(&extension(path).as_str())
}

impl fmt::Display for CloudFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Las => "LAS",
            Self::E57 => "E57",
            Self::Ptx => "PTX",
            Self::Ply => "PLY",
            Self::Text => "text",
        })
    }
}

fn wrong_start(path: &Path, extension: &str, empty: bool) -> CloudError {
    let signature = match extension {
        "las" | "laz" => "LASF",
        "e57" => "ASTM-E57",
        "ply" => "ply",
        _ => return CloudError::UnknownFormat(path.to_owned()),
    };
    let reason = if empty {
        "the file is empty".to_owned()
    } else {
        format!("not a {extension} file: it does not begin with {signature:?}")
    };
    CloudError::malformed(path, reason)
}
