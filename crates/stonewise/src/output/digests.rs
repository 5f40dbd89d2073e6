//! The digests of all result files, in one file that `b3sum --check` reads, too.

use crate::error::{Error, Result};
use crate::files::write_text;
use crate::kept::file_digest;
use crate::results::names::DIGESTS;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// BLAKE3 of result files, hexadecimal, by their names relative to the folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Digests(BTreeMap<PathBuf, String>);

impl Digests {
    /// Reads these files from end to end; the list of digests itself does not count.
    pub fn of(folder: &Path, files: &[PathBuf]) -> Result<Self> {
        let files = files.iter().filter(|file| *file != Path::new(DIGESTS));
        let digest = |file: &PathBuf| Ok((file.clone(), file_digest(&folder.join(file))?));
        files.map(digest).collect::<Result<_>>().map(Self)
    }

    /// The digests that were noted in a folder; `None` where none were.
    ///
    /// # Errors
    /// The list cannot be read, or a line of it is damaged.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(DIGESTS);
        let text = match fs::read(&path) {
            Ok(text) => String::from_utf8_lossy(&text).into_owned(),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::io("reading the digests", &path)(e)),
        };
        let line = |(number, line): (usize, &str)| {
            let of_line = || {
                let (digest, name) = line.split_once("  ")?;
                let is_digest = digest.len() == 64 && digest.bytes().all(|b| b.is_ascii_hexdigit());
                let name = PathBuf::from(name);
                let is_below = name.components().all(|c| matches!(c, Component::Normal(_)));
                (is_digest && is_below).then(|| (name, digest.to_owned()))
            };
            of_line().ok_or_else(|| Error::Results {
                path: path.clone(),
                message: format!("line {} is damaged", number + 1),
            })
        };
        let lines = text.lines().enumerate().map(line);
        lines.collect::<Result<_>>().map(|all| Some(Self(all)))
    }

    /// Writes them into the folder, one line a file.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let line = |(name, digest): (&PathBuf, &String)| {
            let parts: Vec<_> = name
                .components()
                .map(|part| part.as_os_str().to_string_lossy())
                .collect();
            format!("{digest}  {}\n", parts.join("/"))
        };
        let text: String = self.0.iter().map(line).collect();
        write_text(&folder.join(DIGESTS), &text)
    }

    /// Takes other digests of the same folder in place of its own.
    pub fn replace(&mut self, others: Self) {
        self.0.extend(others.0);
    }

    /// Names and digests, ascending by name.
    pub fn iter(&self) -> impl Iterator<Item = (&Path, &str)> {
        self.0
            .iter()
            .map(|(name, digest)| (name.as_path(), digest.as_str()))
    }

    /// Whether the digest of this file was noted.
    pub fn holds(&self, file: &Path) -> bool {
        self.0.contains_key(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_that_of_b3sum() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("data")).unwrap();
        fs::write(dir.path().join("data/m3c2.csv"), "abc").unwrap();
        let digests = Digests::of(dir.path(), &["data/m3c2.csv".into()]).unwrap();
        digests.write(dir.path()).unwrap();
        // `printf abc | b3sum`
        assert_eq!(
            fs::read_to_string(dir.path().join(DIGESTS)).unwrap(),
            "6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85  data/m3c2.csv\n"
        );
        assert_eq!(Digests::read(dir.path()).unwrap(), Some(digests));
    }

    #[test]
    fn a_damaged_list_is_refused_with_its_line() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(Digests::read(dir.path()).unwrap(), None);
        fs::create_dir(dir.path().join("data")).unwrap();
        let good = "6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85  a.csv\n";
        for bad in [
            "6437  b.csv",
            &good.replace("a.csv", "../a.csv"),
            &good.replace("a.csv", "/etc/passwd"),
        ] {
            fs::write(dir.path().join(DIGESTS), format!("{good}{bad}")).unwrap();
            let message = Digests::read(dir.path()).unwrap_err().to_string();
            assert!(message.contains("line 2 is damaged"), "{message}");
        }
    }
}
