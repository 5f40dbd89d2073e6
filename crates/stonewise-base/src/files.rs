//! Small files of text and JSON, whole or not at all.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Makes the folder for the results, where it is not there yet.
///
/// # Errors
/// It cannot be made.
pub fn create_results_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|error| Error::Input {
        path: folder.to_path_buf(),
        message: format!("cannot create the results folder ({error}): give another one with --out"),
    })
}

/// Writes a text file.
///
/// # Errors
/// It cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<()> {
    stonewise_io::atomic::write_atomically(path, |partial| fs::write(partial, text))
        .map_err(Error::io("writing", path))
}

/// Whether something lies there. A file that cannot be looked at is not taken for a missing one.
///
/// # Errors
/// It cannot be looked at.
pub fn is_there(path: &Path) -> Result<bool> {
    path.try_exists().map_err(Error::io("accessing", path))
}

/// The canonical path of a file or folder that need not exist: the part that exists without links, the rest
/// appended.
pub fn resolved(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut rest = Vec::new();
    let mut known = path.as_path();
    loop {
        if let Ok(canonical) = known.canonicalize() {
            return rest.iter().rev().fold(canonical, |p, name| p.join(name));
        }
        let (Some(parent), Some(name)) = (known.parent(), known.file_name()) else {
            return path;
        };
        rest.push(name.to_owned());
        known = parent;
    }
}

/// The way from a folder to a file, neither of which need exist; `None` where there is none, such as from one drive of
/// Windows to another.
pub fn relative(folder: &Path, file: &Path) -> Option<PathBuf> {
    let (from, to) = (resolved(folder), resolved(file));
    let pairs = from.components().zip(to.components());
    let shared = pairs.take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    (shared > 0).then(|| up.chain(to.components().skip(shared)).collect())
}

/// Reads a file as it is.
///
/// # Errors
/// It cannot be read.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(Error::io("reading", path))
}

/// Writes JSON for a later step, in one line.
///
/// # Errors
/// JSON cannot represent the value; the file cannot be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    write_text(path, &serde_json::to_string(value).map_err(no_json(path))?)
}

/// Writes JSON that people read too.
///
/// # Errors
/// JSON cannot represent the value; the file cannot be written.
pub fn write_readable_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(no_json(path))?;
    write_text(path, &(text + "\n"))
}

/// Reads the text of a project file, or of another file of parameters.
///
/// # Errors
/// The file cannot be read; with the line: it is not in UTF-8.
pub fn read_parameters(path: &Path) -> Result<String> {
    String::from_utf8(read_bytes(path)?).map_err(|e| {
        let start = e.utf8_error().valid_up_to();
        let text = String::from_utf8_lossy(e.as_bytes());
        let message = "a character that is not in UTF-8: save the file as UTF-8".to_owned();
        Error::in_text(path, &text, start, message)
    })
}

/// Reads parameters from a file in TOML.
///
/// # Errors
/// The file cannot be read; with the line: it is not TOML, or holds an unknown key or a value of the wrong type.
pub fn read_toml<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<T> {
    let text = read_parameters(path)?;
    toml::from_str(&text).map_err(|e| Error::toml(path, &text, &e))
}

/// Reads what an earlier step wrote.
///
/// # Errors
/// The file cannot be read, or holds something else.
pub fn read_json<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<T> {
    let text = fs::read_to_string(path).map_err(Error::io("reading", path))?;
    serde_json::from_str(&text).map_err(|e| Error::Input {
        path: path.to_path_buf(),
        message: format!("damaged ({e}); remove its folder"),
    })
}

fn no_json(path: &Path) -> impl FnOnce(serde_json::Error) -> Error {
    let path = path.to_path_buf();
    move |e| Error::Input {
        path,
        message: format!("cannot be written as JSON ({e})"),
    }
}
