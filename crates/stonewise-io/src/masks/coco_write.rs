//! Writing of COCO instance annotations.

use super::{InstanceInfo, MaskError};
use crate::atomic::write_atomically;
use serde_json::{Value, json};
use std::path::Path;
use stonewise_core::geometry::signed_area;
use stonewise_core::raster::{LabelImage, Ring, Rle, label_outlines};

/// A photo's masks, to be written.
#[derive(Clone, Copy, Debug)]
pub struct CocoPhoto<'a> {
    /// Name of the photo, with the folders that tell it apart.
    pub file_name: &'a str,
    /// Instance of every pixel.
    pub labels: &'a LabelImage,
    /// What is known of the instances; labels that are not listed get score 1.
    pub instances: &'a [InstanceInfo],
}

/// A COCO instances file with one category, `stone`, that grows photo by photo.
///
/// Polygons run along pixel edges, so the file reads back to the same pixels; a mask with a hole, which
/// COCO's polygons cannot hold, is written as compressed runs.
#[derive(Clone, Debug, Default)]
pub struct CocoFile {
    images: Vec<Value>,
    annotations: Vec<Value>,
}

impl CocoFile {
    /// Adds a photo; only the outlines of its masks stay in memory.
    pub fn add(&mut self, photo: &CocoPhoto<'_>) {
        let image_id = self.images.len() + 1;
        self.images.push(json!({
            "id": image_id,
            "file_name": photo.file_name,
            "width": photo.labels.width(),
            "height": photo.labels.height(),
        }));
        for (label, rings) in label_outlines(photo.labels) {
            let mut annotation = annotation(photo.labels, label, &rings);
            annotation["id"] = json!(self.annotations.len() + 1);
            annotation["image_id"] = json!(image_id);
            if let Some(info) = photo.instances.iter().find(|info| info.id == label) {
                annotation["score"] = json!(info.score);
                if let Some(stone) = info.stone_ref {
                    annotation["stone_id"] = json!(stone);
                }
            }
            self.annotations.push(annotation);
        }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), MaskError> {
        let file = json!({
            "images": self.images,
            "annotations": self.annotations,
            "categories": [{ "id": 1, "name": "stone" }],
        });
        write_atomically(path, |partial| std::fs::write(partial, file.to_string())).map_err(|source| {
            MaskError::Write {
                path: path.to_owned(),
                source,
            }
        })
    }
}

fn annotation(labels: &LabelImage, label: u32, rings: &[Ring]) -> Value {
    let area: f64 = rings.iter().map(|ring| signed_area(ring)).sum();
    let vertices = || rings.iter().flatten();
    let low = |axis: usize| vertices().map(|v| v[axis]).fold(f64::INFINITY, f64::min);
    let high = |axis: usize| vertices().map(|v| v[axis]).fold(f64::NEG_INFINITY, f64::max);
    let has_hole = rings.iter().any(|ring| signed_area(ring) < 0.0);
    let segmentation = if has_hole {
        let [columns, rows] = [0, 1].map(|axis| low(axis) as u32..high(axis) as u32);
        let counts = Rle::of_label(labels, label, columns, rows).to_compressed();
        json!({ "size": [labels.height(), labels.width()], "counts": counts })
    } else {
        json!(rings.iter().map(|ring| ring.as_flattened()).collect::<Vec<_>>())
    };
    json!({
        "category_id": 1,
        "iscrowd": 0,
        "area": area,
        "bbox": [low(0), low(1), high(0) - low(0), high(1) - low(1)],
        "segmentation": segmentation,
    })
}
