//! Names of photos that every file system takes.

use crate::photo_name::is_photo;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The longest name without number and extension, bytes; file systems take 255, or 143 if they encrypt.
const LONGEST: usize = 100;
/// Names that Windows keeps for devices, whatever their extension.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];

/// The names that were given, none of them twice in any case of letters.
#[derive(Default)]
pub struct FileNames {
    taken: BTreeSet<String>,
    /// How often each name occurred.
    tries: BTreeMap<String, usize>,
}

impl FileNames {
    /// The name without extension, or a number is appended if it is taken.
    pub fn unique(&mut self, stem: &str) -> String {
        let tries = self.tries.entry(stem.to_lowercase()).or_default();
        loop {
            *tries += 1;
            let name = match *tries {
                1 => stem.to_owned(),
                n => format!("{stem}_{n}"),
            };
            if self.taken.insert(name.to_lowercase()) {
                return name;
            }
        }
    }
}

/// An image's name as that of a file, without the extension of a photo; `None` where nothing is left of it.
pub fn safe_stem(name: &str) -> Option<String> {
    let stem = match name.rsplit_once('.') {
        Some((stem, _)) if is_photo(Path::new(name)) => stem,
        _ => name,
    };
    let is_safe = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.');
    let mut safe: String = stem.chars().map(|c| if is_safe(c) { c } else { '_' }).collect();
    while safe.len() > LONGEST {
        safe.pop();
    }
    // Files with a dot in front are hidden; Windows drops one at the end.
    let safe = safe.trim_matches(['.', '_']);
    let first = safe.split('.').next().unwrap_or_default().to_lowercase();
    let is_port = first.len() == 4 && (first.starts_with("com") || first.starts_with("lpt"));
    match safe {
        "" => None,
        safe if is_port || DEVICES.contains(&first.as_str()) => Some(format!("photo_{safe}")),
        safe => Some(safe.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_safe() {
        let long = "ä".repeat(200);
        for (name, expected) in [
            ("Setup 12: front.JPG", Some("Setup_12__front")),
            ("../../etc/passwd", Some("etc_passwd")),
            ("C:\\a\\b.png", Some("C__a_b")),
            ("Süd\n1", Some("Süd_1")),
            ("cube.v2", Some("cube.v2")),
            ("Con", Some("photo_Con")),
            ("lpt1.x", Some("photo_lpt1.x")),
            (".", None),
            (" \t", None),
            ("", None),
            (long.as_str(), Some(&long[..100])),
        ] {
            assert_eq!(safe_stem(name).as_deref(), expected, "{name}");
        }
    }

    #[test]
    fn no_name_is_given_twice() {
        let mut names = FileNames::default();
        let given = ["a", "A", "a_2", "a", "b"].map(|name| names.unique(name));
        assert_eq!(given, ["a", "A_2", "a_2_2", "a_3", "b"]);
    }
}
