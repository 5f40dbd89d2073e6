//! What people say of results: remarks and a signature.

use super::Timestamp;
use crate::names::{PairFile, REMARKS, VERDICT};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_base::files::{is_there, read_json};

/// `remarks.json`, which people write beside the results; a run leaves it as it is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Remarks {
    /// In the order in which they were made.
    pub remarks: Vec<Remark>,
    /// Who stands for the results.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signature: Option<Signature>,
}

impl Remarks {
    /// What was said of the results in `dir`.
    ///
    /// # Errors
    /// The file cannot be read, or is damaged.
    pub fn read(dir: &Path) -> Result<Self, Error> {
        let path = dir.join(REMARKS);
        match is_there(&path)? {
            true => read_json(&path),
            false => Ok(Self::default()),
        }
    }

    /// Whether there is a signature, and it is under the results in `dir` as they are.
    ///
    /// # Errors
    /// A result file cannot be read.
    pub fn is_signed(&self, dir: &Path) -> Result<bool, Error> {
        match &self.signature {
            Some(signature) => Ok(signature.blake3 == signed_digest(dir)?),
            None => Ok(false),
        }
    }
}

/// A remark on a stone, on a zone of deformation, or on the wall.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Remark {
    /// The stone that it is about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stone: Option<u32>,
    /// The zone that it is about; with neither, it is about the wall.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zone: Option<u32>,
    /// Name of the later epoch whose report prints it; empty: every report.
    pub epoch: String,
    /// Who made it.
    pub who: String,
    /// When.
    pub when: Timestamp,
    /// What is said.
    pub text: String,
}

/// A signature under results.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Signature {
    /// Who signed.
    pub who: String,
    /// Where.
    pub place: String,
    /// When.
    pub when: Timestamp,
    /// What was signed, see [`signed_digest`].
    pub blake3: String,
}

/// Digest of what a signature stands for: the verdict and the stones of every later epoch. It changes with
/// every number of them, and not with reports and layers that are made of them again.
///
/// # Errors
/// A file cannot be read.
pub fn signed_digest(dir: &Path) -> Result<String, Error> {
    let mut hasher = blake3::Hasher::new();
    let stones = (1..).map(|pair| PairFile::StonesParquet.place(pair));
    for name in std::iter::once(VERDICT.to_owned()).chain(stones) {
        let path = dir.join(&name);
        if !is_there(&path)? {
            if name == VERDICT {
                continue;
            }
            break;
        }
        let bytes = fs::read(&path).map_err(Error::io("reading", &path))?;
        // Lengths keep the files apart.
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(&bytes);
    }
    Ok(hasher.finalize().to_hex().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_holds_verdict_and_all_stones_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("data")).unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        let digest = || signed_digest(folder.path()).unwrap();
        write("verdict.json", "ab");
        write("data/stones.parquet", "c");
        let first = digest();
        write("run.json", "x");
        write("stones.gpkg", "x");
        assert_eq!(digest(), first);
        write("data/stones_2.parquet", "");
        let two = digest();
        write("data/stones_2.parquet", "d");
        write("verdict.json", "a");
        write("data/stones.parquet", "bc");
        assert!(two != first && digest() != two && digest() != first);
        fs::remove_file(folder.path().join("data/stones_2.parquet")).unwrap();
        assert_ne!(digest(), first);
    }
}
