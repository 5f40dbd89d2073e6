//! Edits from a COCO file: polygons in photos whose category is the name of an edit.

use super::edits_file::{Action, Edit};
use super::signed::Signed;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_base::error::{Error, Result};
use stonewise_io::text::read_text;

#[derive(Deserialize)]
struct RawFile {
    images: Vec<RawImage>,
    annotations: Vec<RawAnnotation>,
    categories: Vec<RawCategory>,
}

#[derive(Deserialize)]
struct RawImage {
    id: u64,
    file_name: String,
}

#[derive(Deserialize)]
struct RawCategory {
    id: u64,
    name: String,
}

#[derive(Deserialize)]
struct RawAnnotation {
    #[serde(default)]
    id: u64,
    image_id: u64,
    category_id: u64,
    segmentation: Value,
    /// What editors such as CVAT keep beside a polygon.
    #[serde(default)]
    attributes: BTreeMap<String, Value>,
}

/// The edits of a COCO file, in its order, and how many annotations of other categories it has.
pub(super) fn edits(path: &Path, epoch: Option<&str>, signed: &Signed) -> Result<(Vec<Edit>, Vec<String>)> {
    let wrong = |message: String| Error::Input {
        path: path.to_path_buf(),
        message,
    };
    let text = read_text(path).map_err(Error::io("reading", path))?;
    let file: RawFile = serde_json::from_str(&text).map_err(|e| {
        wrong(format!(
            "no COCO file with images, annotations and categories ({e})"
        ))
    })?;
    let photos: BTreeMap<u64, &str> = file.images.iter().map(|i| (i.id, i.file_name.as_str())).collect();
    let action = |c: &RawCategory| {
        let word = Value::from(c.name.to_lowercase());
        Some((c.id, Action::deserialize(&word).ok()?))
    };

    let actions: BTreeMap<u64, Action> = file.categories.iter().filter_map(action).collect();
    if actions.is_empty() {
        let wanted = "name categories merge, split, delete, add or ignore";
        return Err(wrong(format!("none of its categories is an edit: {wanted}")));
    }

    let (mut edits, mut others) = (Vec::new(), 0);
    for annotation in &file.annotations {
        let Some(&action) = actions.get(&annotation.category_id) else {
            others += 1;
            continue;
        };
        let named = |what: &str| wrong(format!("annotation {}: {what}", annotation.id));
        let photo = photos
            .get(&annotation.image_id)
            .ok_or_else(|| named("its image is not in the file"))?;
        let polygons: Vec<Vec<f64>> = Vec::deserialize(&annotation.segmentation)
            .map_err(|_| named("edits are polygons, not runs of pixels"))?;
        let text = |key: &str, or: &str| match annotation.attributes.get(key) {
            Some(Value::String(text)) if !text.trim().is_empty() => text.clone(),
            _ => or.to_owned(),
        };
        for polygon in polygons {
            edits.push(Edit {
                action,
                photo: Some((*photo).to_owned()),
                epoch: epoch.map(str::to_owned),
                epochs: None,
                at: Vec::new(),
                line: Vec::new(),
                outline: polygon.chunks_exact(2).map(|p| [p[0], p[1]]).collect(),
                corners: Vec::new(),
                who: text("who", &signed.who),
                when: text("when", &signed.when),
                why: text("why", &signed.why),
            });
        }
    }

    let note = format!("annotations of other categories, which are no edits: {others}");
    Ok((edits, (others > 0).then_some(note).into_iter().collect()))
}
