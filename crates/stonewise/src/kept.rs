//! Files that a finished step stands for: how long they are and what they hold.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// Length and digest of one file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Kept {
    /// Name, relative to the folder of the step; of published files, their name alone.
    pub file: PathBuf,
    /// Length.
    pub bytes: u64,
    /// BLAKE3 of the content, hexadecimal.
    pub blake3: String,
}

impl Kept {
    /// Reads a file from end to end. `name`: what to note it under.
    pub fn of(path: &Path, name: PathBuf) -> Result<Self> {
        let bytes = fs::metadata(path).map_err(Error::io("reading", path))?.len();
        Ok(Self {
            file: name,
            bytes,
            blake3: file_digest(path)?,
        })
    }

    /// Why a file is not the one that was kept; `None` if it is.
    pub fn differs(&self, path: &Path) -> Option<String> {
        self.differs_in_length(path).or_else(|| match file_digest(path) {
            Ok(digest) if digest == self.blake3 => None,
            Ok(_) => Some(format!("{} was changed or damaged", path.display())),
            Err(error) => Some(error.to_string()),
        })
    }

    /// What is wrong with the file by its length alone; its content is not read.
    pub fn differs_in_length(&self, path: &Path) -> Option<String> {
        let name = path.display();
        match fs::metadata(path) {
            Err(_) => Some(format!("{name} is missing")),
            Ok(data) if data.len() == self.bytes => None,
            Ok(data) => Some(format!(
                "{name} has {} bytes instead of {}",
                data.len(),
                self.bytes
            )),
        }
    }
}

/// All files of a folder and below, ascending by name; `but`: names at its top that do not count.
pub(crate) fn files_of(folder: &Path, but: &[&str]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(dir) = open.pop() {
        for entry in fs::read_dir(&dir).map_err(Error::io("listing", &dir))? {
            let entry = entry.map_err(Error::io("listing", &dir))?;
            // Links are files here: what they lead to is not followed.
            match entry.file_type().is_ok_and(|t| t.is_dir()) {
                true => open.push(entry.path()),
                false => files.push(entry.path()),
            }
        }
    }
    let own = |path: &PathBuf| {
        let below = path.strip_prefix(folder).unwrap_or(path);
        !but.iter().any(|name| below == Path::new(name))
    };
    files.retain(own);
    files.sort();
    Ok(files)
}

/// Digest of a file's content.
pub(crate) fn file_digest(path: &Path) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let file = File::open(path).map_err(Error::io("opening", path))?;
    hasher.update_reader(file).map_err(Error::io("reading", path))?;
    Ok(hasher.finalize().to_hex().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_flipped_bit_a_missing_byte_and_a_missing_file_are_seen() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("tile");
        let content: Vec<u8> = (0..5000u32).map(|i| (i * 7) as u8).collect();
        fs::write(&path, &content).unwrap();
        let kept = Kept::of(&path, "tile".into()).unwrap();
        assert_eq!(kept.differs(&path), None);
        for at in [0, 2500, 4999] {
            let mut spoilt = content.clone();
            spoilt[at] ^= 1 << (at % 8);
            fs::write(&path, spoilt).unwrap();
            assert!(kept.differs(&path).unwrap().contains("changed or damaged"));
        }
        fs::write(&path, &content[..4999]).unwrap();
        assert!(
            kept.differs(&path)
                .unwrap()
                .contains("4999 bytes instead of 5000")
        );
        fs::remove_file(&path).unwrap();
        assert!(kept.differs(&path).unwrap().contains("missing"));
    }
}
