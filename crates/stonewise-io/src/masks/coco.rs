//! COCO instance annotations.

use super::{InstanceInfo, LabelledPhoto, MaskError};
use crate::photo_name::{Fit, PhotoName};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use stonewise_core::raster::{Raster, Rle, fill_polygon};

/// A COCO instances file in memory, its masks still as polygons and runs.
#[derive(Clone, Debug)]
pub struct CocoMasks {
    path: PathBuf,
    images: Vec<RawImage>,
    annotations: BTreeMap<u64, Vec<RawAnnotation>>,
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
    id: u64,
    file_name: String,
    width: u32,
    height: u32,
}

#[derive(Deserialize)]
struct RawCategory {
    id: u64,
    name: String,
}

#[derive(Clone, Debug, Deserialize)]
struct RawAnnotation {
    #[serde(default)]
    id: u64,
    image_id: u64,
    #[serde(default)]
    category_id: Option<u64>,
    #[serde(default)]
    segmentation: RawSegmentation,
    /// Left, top, width, height, pixels.
    bbox: Option<[f64; 4]>,
    #[serde(default)]
    iscrowd: u8,
    score: Option<f64>,
    /// Any number; only positive whole ones name a stone.
    #[serde(default)]
    stone_id: serde_json::Value,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum RawSegmentation {
    Polygons(Vec<Vec<f64>>),
    /// Size is (height, width).
    Runs {
        size: [u32; 2],
        counts: Vec<u32>,
    },
    Compressed {
        size: [u32; 2],
        counts: String,
    },
}

impl Default for RawSegmentation {
    fn default() -> Self {
        Self::Polygons(Vec::new())
    }
}

/// Horizontal runs (y, begin, end) of a mask, cut to the image.
type Spans = Vec<(u32, u32, u32)>;

impl CocoMasks {
    /// Reads a file; masks are decoded photo by photo, later.
    ///
    /// Where the file has a category `stone` beside others, only its annotations count.
    ///
    /// # Errors
    /// The file cannot be read, is no COCO instances file or lists no image.
    pub fn open(path: &Path) -> Result<Self, MaskError> {
        let text = std::fs::read_to_string(path).map_err(|source| MaskError::Read {
            path: path.to_owned(),
            source,
        })?;
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

        let is_stone = |c: &&RawCategory| c.name.eq_ignore_ascii_case("stone");
        let stones: BTreeSet<u64> = raw.categories.iter().filter(is_stone).map(|c| c.id).collect();
        let mut annotations: BTreeMap<u64, Vec<RawAnnotation>> = BTreeMap::new();

        for annotation in raw.annotations {
            if stones.is_empty() || annotation.category_id.is_none_or(|id| stones.contains(&id)) {
                annotations
                    .entry(annotation.image_id)
                    .or_default()
                    .push(annotation);
            }
        }

        Ok(Self {
            path: path.to_owned(),
            images: raw.images,
            annotations,
        })
    }

    /// The photos that the file lists, in its order.
    pub fn photos(&self) -> impl Iterator<Item = ListedPhoto<'_>> {
        self.images.iter().map(|image| ListedPhoto {
            file_name: &image.file_name,
            width: image.width,
            height: image.height,
            masks: self.annotations.get(&image.id).map_or(0, Vec::len),
        })
    }

    /// The labels of a photo, see [`super::MaskSource::labels_for`].
    ///
    /// An instance's label is its place among the photo's annotations, from 1 on. Where masks overlap, the
    /// one of smaller area is on top (the later one if equal), so that a small stone inside the outline of a
    /// large one survives. The polygons of one annotation are joined, as pycocotools does. Crowds and masks
    /// without a visible pixel are left out with a warning.
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
            let left_out = |why: &str| format!("annotation {} of photo {photo_name} {why}", annotation.id);
            if annotation.iscrowd != 0 {
                warnings.push(left_out("is a crowd, not a stone"));
            } else if area == 0 {
                warnings.push(left_out("covers no pixel of the photo"));
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
            let id = index as u32 + 1;
            if is_visible[index + 1] {
                instances.push(InstanceInfo {
                    id,
                    score: annotation.score.unwrap_or(1.0),
                    stone_ref: annotation.stone_id.as_u64().filter(|&stone| stone != 0),
                });
            } else if masks.iter().any(|mask| mask.1 == id) {
                warnings.push(format!(
                    "annotation {} of photo {photo_name} is hidden under smaller ones",
                    annotation.id
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
            let bounds = annotation.bbox.map(|[x, y, w, h]| [x, y, x + w, y + h]);
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
                annotation: annotation.id,
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
        let annotations = self.annotations.get(&image.id);
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
            annotation: annotation.id,
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

        match &annotation.segmentation {
            RawSegmentation::Polygons(polygons) => {
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
            }
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
