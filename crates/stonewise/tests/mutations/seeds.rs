//! Sound files to begin with: the fixtures of the other tests, and hostile ones.

use std::fs;
use std::path::{Path, PathBuf};

/// A file to change.
pub struct Seed {
    /// Its name, whose extension may tell the format.
    pub name: String,
    pub bytes: Vec<u8>,
}

/// Files of `testdata`, by their paths there.
pub fn testdata(names: &[&str]) -> Vec<Seed> {
    let seed = |name: &&str| Seed {
        name: name.rsplit('/').next().unwrap_or(name).to_owned(),
        bytes: fs::read(testdata_path(name)).unwrap(),
    };
    names.iter().map(seed).collect()
}

pub fn testdata_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata")
        .join(name)
}

/// A text as a file.
pub fn text(name: &str, text: &str) -> Seed {
    Seed {
        name: name.to_owned(),
        bytes: text.as_bytes().to_vec(),
    }
}

/// A file that a writer of ours makes.
pub fn written(name: &str, write: impl FnOnce(&Path)) -> Seed {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write(&path);
    Seed {
        name: name.to_owned(),
        bytes: fs::read(&path).unwrap(),
    }
}

/// A project that names every kind of input; the files are those of [`PROJECT_FILES`].
pub const PROJECT: &str = r#"[project]
name = "wall"
crs = "EPSG:25832"
false_origin = [450000.0, 5600000.0, 0.0]

[[epochs]]
name = "one"
clouds = ["a.laz", "b.laz"]
images = "images"
cameras = "cameras.xml"
masks = "masks.json"

[[epochs]]
name = "two"
clouds = ["a.laz"]
images = "images"
cameras = "cameras.xml"
motion = { kind = "bulge", centre = [0.1, -0.3, 1.4], depth = 0.05, diameter = 4.0, direction = [1, 0, 0] }

[ingest]
size_m = 4.0

[registration]
epoch_error_m = 0.002

[[registration.stable]]
corners = [[3.0, -4.0, -0.5], [8.0, 4.0, 2.5]]

[m3c2]
min_points = 4
"#;
pub const PROJECT_FILES: [&str; 4] = ["a.laz", "b.laz", "cameras.xml", "masks.json"];
