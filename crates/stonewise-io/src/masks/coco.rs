//! COCO instance annotations.

use super::json_text::read_json_text;
use super::{InstanceInfo, LabelledPhoto, MaskError};
use crate::photo_name::{Fit, PhotoName};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use stonewise_core::raster::{Raster, Rle, fill_polygon};

/// A COCO instances file in memory, its masks still as polygons and runs.
#[derive(Clone, Debug)]
pub struct CocoMasks {
    path: PathBuf,
    images: Vec<RawImage>,
    /// By the image's id.
    annotations: BTreeMap<String, Vec<RawAnnotation>>,
    remarks: Vec<String>,
}

/// A photo that a COCO file lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListedPhoto<'a> {
    /// Its name, folders included where the file has them.
    pub file_name: &'a str,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Number of its masks.
    pub masks: usize,
}

#[derive(Deserialize)]
struct RawFile {
    images: Vec<RawImage>,
    annotations: Vec<RawAnnotation>,
    #[serde(default)]
    categories: Vec<RawCategory>,
}

#[derive(Clone, Debug, Deserialize)]
struct RawImage {
    id: Value,
    file_name: String,
    width: u32,
    height: u32,
}

#[derive(Deserialize)]
struct RawCategory {
    id: Value,
    name: String,
}

/// Programs write numbers, texts, true and null for the same thing; what cannot be used is named when it is.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
struct RawAnnotation {
    id: Value,
    image_id: Value,
    category_id: Value,
    segmentation: RawSegmentation,
    /// Left, top, width, height, pixels.
    bbox: Value,
    iscrowd: Value,
    score: Value,
    /// Any number; only positive whole ones name a stone.
    stone_id: Value,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum RawSegmentation {
    Polygons(Vec<Vec<f64>>),
    /// One polygon without the list around it.
    Polygon(Vec<f64>),
    /// Size is (height, width).
    Runs {
        size: [u32; 2],
        counts: Vec<u32>,
    },
    Compressed {
        size: [u32; 2],
        counts: String,
    },
    /// Null.
    Nothing(()),
    Other(IgnoredAny),
}

impl Default for RawSegmentation {
    fn default() -> Self {
        Self::Nothing(())
    }
}

impl RawAnnotation {
    fn is_crowd(&self) -> bool {
        self.iscrowd == Value::Bool(true) || self.iscrowd.as_f64().is_some_and(|n| n != 0.0)
    }
}

/// An id as a text: numbers and texts of the same digits are one.
fn id(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        value => value.to_string(),
    }
}

/// Horizontal runs (y, begin, end) of a mask, cut to the image.
type Spans = Vec<(u32, u32, u32)>;

impl CocoMasks {
    /// Reads a file; masks are decoded photo by photo, later.
    ///
    /// Where annotations have several categories, those of the category `stone` or `stones` count. Crowds count as
    /// stones: labelling programs write what is drawn with a brush as crowds.
    ///
    /// # Errors
    /// The file cannot be read, is no COCO instances file, lists no image, or has several categories none of which is
    /// called stone.
    pub fn open(path: &Path) -> Result<Self, MaskError> {
        let text = read_json_text(path)?;
        let raw: RawFile = serde_json::from_str(&text).map_err(|e| MaskError::Json {
            path: path.to_owned(),
            problem: e.to_string(),
        })?;

        if raw.images.is_empty() {
            return Err(MaskError::Empty {
                path: path.to_owned(),
                expected: "the file lists no image",
            });
        }

        let mut used: BTreeMap<String, usize> = BTreeMap::new();
        for annotation in raw.annotations.iter().filter(|a| !a.category_id.is_null()) {
            *used.entry(id(&annotation.category_id)).or_default() += 1;
        }
        let names: BTreeMap<String, &str> = raw
            .categories
            .iter()
            .map(|c| (id(&c.id), c.name.trim()))
            .collect();
        let is_stone = |category: &String| {
            let name = names.get(category).map(|name| name.to_lowercase());
            matches!(name.as_deref(), Some("stone" | "stones"))
        };
        let count = |(category, n): (&String, &usize)| {
            let name = names.get(category).copied().unwrap_or(category);
            format!("{name:?} ({n})")
        };
        let knows_stones = names.keys().any(is_stone);
        let others: BTreeMap<String, usize> = { used.iter() }
            .filter(|(category, _)| !is_stone(category))
            .map(|(category, n)| (category.clone(), *n))
            .collect();
        if !knows_stones && others.len() > 1 {
            return Err(MaskError::Categories {
                path: path.to_owned(),
                found: others.iter().map(count).collect::<Vec<_>>().join(", "),
            });
        }

        let mut remarks = Vec::new();
        if knows_stones && !others.is_empty() {
            let found: Vec<String> = others.iter().map(count).collect();
            remarks.push(format!(
                "not used: annotations of the categories {}",
                found.join(", ")
            ));
        }
        let listed: BTreeSet<String> = raw.images.iter().map(|image| id(&image.id)).collect();
        let (mut crowds, mut lost) = (0, Vec::new());
        let mut annotations: BTreeMap<String, Vec<RawAnnotation>> = BTreeMap::new();
        for annotation in raw.annotations {
            if knows_stones && others.contains_key(&id(&annotation.category_id)) {
                continue;
            }
            let image = id(&annotation.image_id);
            if !listed.contains(&image) {
                lost.push(id(&annotation.id));
                continue;
            }
            crowds += usize::from(annotation.is_crowd());
            annotations.entry(image).or_default().push(annotation);
        }
        if crowds > 0 {
            remarks.push(format!(
                "{crowds} annotations are marked as crowds (iscrowd): read as stones"
            ));
        }
        if let Some(first) = lost.first() {
            let n = lost.len();
            remarks.push(format!(
                "not used: {n} annotations of images that it does not list, first annotation {first}"
            ));
        }

        Ok(Self {
            path: path.to_owned(),
            images: raw.images,
            annotations,
            remarks,
        })
    }

    /// What of the file is not used, or not as it is marked, and why.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// The photos that the file lists, in its order.
    pub fn photos(&self) -> impl Iterator<Item = ListedPhoto<'_>> {
        self.images.iter().map(|image| ListedPhoto {
            file_name: &image.file_name,
            width: image.width,
            height: image.height,
            masks: self.annotations.get(&id(&image.id)).map_or(0, Vec::len),
        })
    }

    /// The labels of a photo, see [`super::MaskSource::labels_for`].
    ///
    /// An instance's label is its place among the photo's annotations, from 1 on. Where masks overlap, the
    /// one of smaller area is on top (the later one if equal), so that a small stone inside the outline of a
    /// large one survives. The polygons of one annotation are joined, as pycocotools does. Masks without a visible pixel
    /// are left out with a warning.
    ///
    /// # Errors
    /// As [`super::MaskSource::labels_for`].
    pub fn labels_for(
        &self,
        photo_name: &str,
        width: u32,
        height: u32,
    ) -> Result<Option<LabelledPhoto>, MaskError> {
        let Some(annotations) = self.annotations_of(photo_name, (width, height))? else {
            return Ok(None);
        };
        let mut warnings = Vec::new();
        let mut masks: Vec<(u64, u32, Spans)> = Vec::new();

        for (index, annotation) in annotations.iter().enumerate() {
            let spans = self.spans(annotation, width, height)?;
            let area: u64 = spans.iter().map(|&(_, begin, end)| u64::from(end - begin)).sum();
            if area == 0 {
                let id = id(&annotation.id);
                warnings.push(format!(
                    "annotation {id} of photo {photo_name} covers no pixel of the photo"
                ));
            } else {
                masks.push((area, index as u32 + 1, spans));
            }
        }

        masks.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut labels = Raster::filled(width, height, 0u32);
        for (_, id, spans) in &masks {
            for &(y, begin, end) in spans {
                let row = y as usize * width as usize;
                labels.data_mut()[row + begin as usize..row + end as usize].fill(*id);
            }
        }

        let mut is_visible = vec![false; annotations.len() + 1];
        for &label in labels.data() {
            is_visible[label as usize] = true;
        }
        let mut instances = Vec::new();

        for (index, annotation) in annotations.iter().enumerate() {
            let label = index as u32 + 1;
            if is_visible[index + 1] {
                instances.push(InstanceInfo {
                    id: label,
                    score: annotation.score.as_f64().unwrap_or(1.0),
                    stone_ref: annotation.stone_id.as_u64().filter(|&stone| stone != 0),
                });
            } else if masks.iter().any(|mask| mask.1 == label) {
                warnings.push(format!(
                    "annotation {} of photo {photo_name} is hidden under smaller ones",
                    id(&annotation.id)
                ));
            }
        }

        Ok(Some(LabelledPhoto {
            labels,
            instances,
            warnings,
        }))
    }

    /// The boxes of a photo's annotations: left, top, right, bottom, pixels. `None` where the file does not list
    /// the photo.
    ///
    /// # Errors
    /// Two images of the file fit the name; the photo has another size; an annotation has no `bbox`, or an empty
    /// one, or one outside the photo.
    pub fn boxes_for(
        &self,
        photo_name: &str,
        width: u32,
        height: u32,
    ) -> Result<Option<Vec<[f64; 4]>>, MaskError> {
        let Some(annotations) = self.annotations_of(photo_name, (width, height))? else {
            return Ok(None);
        };

        let corners = |annotation: &RawAnnotation| {
            let sides = <[f64; 4]>::deserialize(&annotation.bbox).ok();
            let bounds = sides.map(|[x, y, w, h]| [x, y, x + w, y + h]);
            let [width, height] = [width, height].map(f64::from);
            let shows = |[left, top, right, bottom]: &[f64; 4]| {
                left < right
                    && top < bottom
                    && *left < width
                    && *top < height
                    && *right > 0.0
                    && *bottom > 0.0
            };
            bounds.filter(shows).ok_or_else(|| MaskError::BadAnnotation {
                path: self.path.clone(),
                annotation: id(&annotation.id),
                problem: "no usable bbox: it must be [left, top, width, height] in pixels, within the photo"
                    .to_owned(),
            })
        };

        annotations
            .iter()
            .map(corners)
            .collect::<Result<_, _>>()
            .map(Some)
    }

    /// The annotations of a photo of this size; `None` where the file does not list it.
    fn annotations_of(
        &self,
        photo_name: &str,
        size: (u32, u32),
    ) -> Result<Option<&[RawAnnotation]>, MaskError> {
        let Some(image) = self.find(photo_name)? else {
            return Ok(None);
        };
        MaskError::check_size(&self.path, photo_name, (image.width, image.height), size)?;
        let annotations = self.annotations.get(&id(&image.id));
        Ok(Some(annotations.map_or(&[][..], Vec::as_slice)))
    }

    /// The one image that fits a photo's name best.
    fn find(&self, photo_name: &str) -> Result<Option<&RawImage>, MaskError> {
        let wanted = PhotoName::new(photo_name);
        let mut best: Option<(Fit, &RawImage)> = None;
        let mut rival: Option<&RawImage> = None;
        for image in &self.images {
            let Some(fit) = wanted.fit(&PhotoName::new(&image.file_name)) else {
                continue;
            };
            match best {
                Some((best_fit, _)) if fit < best_fit => {}
                Some((best_fit, _)) if fit == best_fit => rival = Some(image),
                _ => {
                    best = Some((fit, image));
                    rival = None;
                }
            }
        }
        match (best, rival) {
            (Some((_, first)), Some(second)) => Err(MaskError::Ambiguous {
                path: self.path.clone(),
                photo: photo_name.to_owned(),
                first: first.file_name.clone(),
                second: second.file_name.clone(),
            }),
            (best, _) => Ok(best.map(|(_, image)| image)),
        }
    }

    /// The pixels of an annotation, each once.
    fn spans(&self, annotation: &RawAnnotation, width: u32, height: u32) -> Result<Spans, MaskError> {
        let bad = |problem: String| MaskError::BadAnnotation {
            path: self.path.clone(),
            annotation: id(&annotation.id),
            problem,
        };

        let runs = |size: [u32; 2], rle: Rle| {
            if size == [height, width] {
                Ok(horizontal(&rle))
            } else {
                Err(bad(format!(
                    "runs for {}x{} px in a photo of {width}x{height} px",
                    size[1], size[0]
                )))
            }
        };

        let fill = |polygons: &[Vec<f64>]| {
            let mut spans = Spans::new();
            for polygon in polygons {
                if polygon.len() % 2 != 0 || !polygon.iter().all(|v| v.is_finite()) {
                    return Err(bad("a polygon must be pairs of numbers".to_owned()));
                }
                let ring = polygon.chunks_exact(2).map(|p| [p[0], p[1]]).collect();
                fill_polygon(&[ring], width, height, |y, begin, end| {
                    spans.push((y, begin, end))
                });
            }
            Ok(if polygons.len() > 1 { merged(spans) } else { spans })
        };

        match &annotation.segmentation {
            RawSegmentation::Polygons(polygons) => fill(polygons),
            RawSegmentation::Polygon(polygon) => fill(std::slice::from_ref(polygon)),
            RawSegmentation::Nothing(()) => Ok(Spans::new()),
            RawSegmentation::Other(_) => Err(bad(
                "its segmentation is neither a list of polygons [[x, y, x, y, ...]] nor runs {size, counts}: draw it again, or \
                 take it out"
                    .to_owned(),
            )),
            RawSegmentation::Runs { size, counts } => {
                let rle = Rle::from_counts(size[1], size[0], counts.clone());
                runs(*size, rle.map_err(|e| bad(e.to_string()))?)
            }
            RawSegmentation::Compressed { size, counts } => {
                let rle = Rle::from_compressed(size[1], size[0], counts);
                runs(*size, rle.map_err(|e| bad(e.to_string()))?)
            }
        }
    }
}

/// Spans of one pixel each for vertical runs, joined along rows.
fn horizontal(rle: &Rle) -> Spans {
    let mut spans = Spans::new();
    rle.for_each_run(|x, y, length| spans.extend((y..y + length).map(|y| (y, x, x + 1))));
    merged(spans)
}

/// Sorted spans without overlap.
fn merged(mut spans: Spans) -> Spans {
    spans.sort_unstable();
    let mut joined: Spans = Vec::with_capacity(spans.len());
    for (y, begin, end) in spans {
        match joined.last_mut() {
            Some(last) if last.0 == y && begin <= last.2 => last.2 = last.2.max(end),
            _ => joined.push((y, begin, end)),
        }
    }
    joined
}
