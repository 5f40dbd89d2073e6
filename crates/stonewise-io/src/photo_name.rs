//! Names of photos as different programs write them.

use crate::text::composed;
use std::path::Path;

/// A photo's name in lower case and one form of Unicode, cut into folders and file.
pub(crate) struct PhotoName {
    folders: Vec<String>,
    file: String,
}

/// How well two names fit; larger is better. First whether the files' names are the same, then how many
/// folders are.
pub(crate) type Fit = (u8, usize);

impl PhotoName {
    pub(crate) fn new(name: &str) -> Self {
        let mut folders: Vec<String> = composed(name)
            .to_lowercase()
            .split(['/', '\\'])
            .map(str::to_owned)
            .collect();
        let file = folders.pop().unwrap_or_default();
        Self { folders, file }
    }

    /// How well a file fits this name, which may lack its extension; `None` if not at all.
    pub(crate) fn fit(&self, other: &Self) -> Option<Fit> {
        let sort = if self.file == other.file {
            2
        } else if self.file == stem(&other.file) {
            1
        } else if self.stem() == stem(&other.file) {
            0
        } else {
            return None;
        };
        let pairs = self.folders.iter().rev().zip(other.folders.iter().rev());
        Some((sort, pairs.take_while(|(a, b)| a == b).count()))
    }

    /// The file's name without the extension of a photo.
    pub(crate) fn stem(&self) -> &str {
        if is_photo(Path::new(&self.file)) {
            stem(&self.file)
        } else {
            &self.file
        }
    }

    /// The file's name.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// The name of another file in the same folders.
    pub(crate) fn with_file(&self, file: String) -> Self {
        Self {
            folders: self.folders.clone(),
            file,
        }
    }

    /// How many folders the name has.
    pub(crate) fn depth(&self) -> usize {
        self.folders.len()
    }
}

/// Whether the extension is a photo's.
pub fn is_photo(path: &Path) -> bool {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    matches!(
        extension.as_deref(),
        Some("jpg" | "jpeg" | "png" | "tif" | "tiff")
    )
}

fn stem(file: &str) -> &str {
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}
