//! The index of a project, and the files that it names.

use super::super::{CameraError, malformed, read_text};
use super::uri::path_and_fragment;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// The index.
pub struct Project {
    path: PathBuf,
    pub items: Vec<Item>,
}

/// A part of the project.
#[derive(Deserialize)]
pub struct Item {
    pub id: String,
    #[serde(rename = "type")]
    pub kind: String,
    pub resources: Vec<Resource>,
    pub sources: Vec<Source>,
}

/// A file of a part.
#[derive(Deserialize)]
pub struct Resource {
    uri: String,
    format: String,
}

/// A part that another part was made from.
#[derive(Deserialize)]
pub struct Source {
    pub id: String,
}

/// A part of the content of a file, and where it comes from.
pub struct Loaded<T> {
    pub path: PathBuf,
    pub content: T,
}

#[derive(Deserialize)]
struct Index {
    version: String,
    items: Vec<Item>,
}

impl Project {
    pub fn open(path: &Path) -> Result<Self, CameraError> {
        let index: Index = json(path, "an OPF project")?;
        if index.version.split(['.', '-']).next() != Some("1") {
            let problem = format!(
                "OPF {} is not supported: export the project as OPF 1",
                index.version
            );
            return Err(malformed(path, "version", problem));
        }
        Ok(Self {
            path: path.to_owned(),
            items: index.items,
        })
    }

    /// The files of an item that have the format `application/opf-FORMAT+json`.
    pub fn load<T: DeserializeOwned>(
        &self,
        item: &Item,
        format: &str,
    ) -> Result<Vec<Loaded<T>>, CameraError> {
        let full = format!("application/opf-{format}+json");
        let wanted = item.resources.iter().filter(|resource| resource.format == full);
        let load = |resource: &Resource| {
            let uri = &resource.uri;
            if uri.contains("://") {
                let problem = format!("{uri} does not lie beside the project: export it with all its files");
                return Err(malformed(&self.path, format!("item {}", item.kind), problem));
            }
            let path = self.path.with_file_name(path_and_fragment(uri).0);
            if !path.is_file() {
                let problem =
                    format!("the project names {uri}, which is not there: copy all files of the project");
                return Err(malformed(&self.path, format!("item {}", item.kind), problem));
            }
            Ok(Loaded {
                content: json(&path, &format!("a file of the format {full}"))?,
                path,
            })
        };
        wanted.map(load).collect()
    }

    /// Such files of all items of a type; an error where there is none.
    pub fn load_all<T: DeserializeOwned>(
        &self,
        kind: &str,
        format: &str,
    ) -> Result<Vec<Loaded<T>>, CameraError> {
        let mut all = Vec::new();
        for item in self.items.iter().filter(|item| item.kind == kind) {
            all.extend(self.load(item, format)?);
        }
        if all.is_empty() {
            return Err(self.lacks(kind));
        }
        Ok(all)
    }

    /// The error for a project without an item of a type.
    pub fn lacks(&self, kind: &str) -> CameraError {
        let problem =
            format!("the project has no {kind}: calibrate the cameras and export the project again");
        malformed(&self.path, "items", problem)
    }
}

fn json<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T, CameraError> {
    serde_json::from_str(&read_text(path)?).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        malformed(path, place, format!("not {what} ({e})"))
    })
}
