//! The stones of all photos of a folder, as files for people and labelling tools.

use super::overlay::outlined;
use crate::error::{Error, Result};
use crate::files::{read_json, write_json, write_readable_json};
use crate::storage::step::{Key, Origin, path_digest};
use crate::storage::store::{Keeps, StepStore};
use crate::warnings::{Warning, Warnings};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stonewise_core::progress::Progress;
use stonewise_io::image_io::{image_size, photos_in, read_rgb, write_jpeg};
use stonewise_io::masks::{CocoFile, CocoMasks, CocoPhoto, InstanceInfo, read_label_png, write_label_png};
use stonewise_segment::dataset::Reference;
use stonewise_segment::evaluation::{MaskScore, PhotoPairs, pair_masks};
use stonewise_segment::tiling::{TilingOptions, outline_boxes, segment_photo};
use stonewise_segment::{Segmentation, StoneFinder, Weights};

const STEP: &str = "segment";
/// Scores of a photo's stones, in the folder of its step.
const SCORES: &str = "scores.json";
/// Quality of the overlays.
const JPEG_QUALITY: u8 = 85;

/// Photos in which stones are to be found.
#[derive(Clone, Copy, Debug)]
pub struct FolderJob<'a> {
    /// A folder of photos, or one photo.
    pub photos: &'a Path,
    /// Where results go; made if need be.
    pub out: &'a Path,
    /// The detector.
    pub weights: &'a Weights,
    /// How photos are cut into tiles.
    pub tiling: &'a TilingOptions,
    /// A COCO file with a box for each stone; absent: the detector finds the stones.
    pub boxes: Option<&'a Path>,
    /// Masks to measure the result on.
    pub reference: Option<&'a Reference>,
}

/// What came out.
#[derive(Clone, Debug)]
pub struct FolderSummary {
    /// Photos done.
    pub photos: usize,
    /// Stones in them.
    pub stones: usize,
    /// Photos that were left out, and why.
    pub warnings: Vec<Warning>,
    /// Figures, where there is a reference.
    pub evaluation: Option<MaskEvaluation>,
}

/// Figures of photos against a reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaskEvaluation {
    /// Each photo that the reference has masks for.
    pub photos: Vec<PhotoScore>,
    /// All of them together.
    pub total: MaskScore,
}

/// Figures of one photo.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhotoScore {
    /// Its name in the folder.
    pub photo: String,
    /// The figures.
    #[serde(flatten)]
    pub score: MaskScore,
}

/// Finds the stones of all photos of a folder, or outlines those in given boxes, and writes, in `out`:
///
/// - `labels/NAME.png`: stone of every pixel, 16 bits,
/// - `overlays/NAME.jpg`: the photo with the outlines of its stones; of photos that differ in their extensions alone, the
///   names of both keep them (`NAME.tif.png`),
/// - `masks.json`: all masks as a COCO instances file,
/// - `evaluation.json`: figures, where there is a reference.
///
/// Masks belong to the pixels as the photo stores them. Photos that an interrupted call finished are taken
/// over if photo, detector and parameters are the same.
///
/// # Errors
/// There is no photo, the detector cannot be read, a file cannot be written, or the caller stopped it. A
/// photo that cannot be read is a warning.
pub fn segment_folder(job: &FolderJob, progress: &dyn Progress) -> Result<FolderSummary> {
    let (root, photos) = photos_of(job.photos)?;
    let store = StepStore::new(&job.out.join("work").join(STEP), Keeps::Newest)?;
    let weights = store.weights_digest(job.weights)?;
    let boxes = job.boxes.map(CocoMasks::open).transpose()?;
    let boxes_digest = job.boxes.map(path_digest).transpose()?;
    let detector = StoneFinder::open(job.weights, job.tiling.min_score as f32)?;
    let warnings = Warnings::default();
    // Tiles, or boxes.
    let work = |photo: &PathBuf| match (image_size(photo), &boxes) {
        (Ok((width, height)), None) => job.tiling.tile_count(width, height, 1.0),
        (Ok((width, height)), Some(boxes)) => {
            let of_photo = boxes.boxes_for(&photo.to_string_lossy(), width, height);
            of_photo.ok().flatten().map_or(0, |b| b.len() as u64)
        }
        (Err(_), _) => 0,
    };
    progress.agenda(&["stones in the photos".to_owned()]);
    progress.enter(0);
    progress.begin("stones", photos.iter().map(work).sum());
    let mut masks = CocoFile::default();
    let (mut count, mut stones) = (0, 0);
    let mut pairs: Vec<(String, PhotoPairs)> = Vec::new();
    for (photo, number) in photos.iter().zip(1..) {
        progress.check()?;
        progress.detail(&format!("photo {number} of {}", photos.len()));
        let name = photo.strip_prefix(&root).unwrap_or(photo);
        let is_same = |other: &&PathBuf| other.with_extension("") == photo.with_extension("");
        let is_shared = photos.iter().filter(is_same).count() > 1;
        let labels = file_in(&job.out.join("labels"), name, "png", is_shared)?;
        let key = Key::new(
            STEP,
            &(job.tiling, &boxes_digest),
            &[&weights, &path_digest(photo)?],
        );
        let mut unreadable = None;
        let done = store.step(
            &name.to_string_lossy(),
            key,
            std::slice::from_ref(&labels),
            |step| {
                let image = read_rgb(photo).inspect_err(|error| unreadable = Some(error.to_string()))?;
                let segmented = match &boxes {
                    None => segment_photo(&detector, &image, 1.0, None, job.tiling, progress)?,
                    Some(boxes) => {
                        let of_photo =
                            boxes.boxes_for(&photo.to_string_lossy(), image.width(), image.height())?;
                        let of_photo = of_photo.unwrap_or_default();
                        outline_boxes(&detector, &image, None, &of_photo, job.tiling, progress)?
                    }
                };
                let overlay = file_in(&job.out.join("overlays"), name, "jpg", is_shared)?;
                write_jpeg(&overlay, &outlined(&image, &segmented.labels), JPEG_QUALITY)?;
                write_label_png(&labels, &segmented.labels)?;
                write_json(&step.file(SCORES), &segmented.scores)
            },
        );
        if let Some(reason) = unreadable {
            warnings.skipped(STEP, photo.to_string_lossy(), reason);
            continue;
        }
        let (step, origin) = done?;
        if origin == Origin::Found {
            progress.advance(work(photo));
        }
        let scores: BTreeMap<u32, f32> = read_json(&step.file(SCORES))?;
        let segmented = Segmentation {
            labels: read_label_png(&labels)?,
            scores,
        };
        count += 1;
        stones += segmented.scores.len();
        let name = name.to_string_lossy();
        add_masks(&mut masks, &name, &segmented);
        let (width, height) = (segmented.labels.width(), segmented.labels.height());
        let known = match job.reference {
            Some(reference) => reference.of_photo(photo, width, height)?,
            None => None,
        };
        if let Some((reference, ignore)) = known {
            pairs.push((name.into_owned(), pair_masks(&segmented, &reference, &ignore)));
        }
    }
    masks.write(&job.out.join("masks.json"))?;
    let evaluation = job.reference.map(|_| evaluation(&pairs));
    if let Some(evaluation) = &evaluation {
        write_readable_json(&job.out.join("evaluation.json"), evaluation)?;
    }
    Ok(FolderSummary {
        photos: count,
        stones,
        warnings: warnings.sorted(),
        evaluation,
    })
}

/// The folder that names are relative to, and the photos.
fn photos_of(path: &Path) -> Result<(PathBuf, Vec<PathBuf>)> {
    if path.is_file() {
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        return Ok((folder, vec![path.to_path_buf()]));
    }
    let photos = photos_in(path)?;
    if photos.is_empty() {
        return Err(Error::Input {
            path: path.to_path_buf(),
            message: "no photo (JPEG or PNG) in this folder".to_owned(),
        });
    }
    Ok((path.to_path_buf(), photos))
}

/// A file named after a photo, without the photo's extension unless another photo has the same name but for that
/// (`is_shared`); makes the folders on the way.
fn file_in(folder: &Path, name: &Path, extension: &str, is_shared: bool) -> Result<PathBuf> {
    let mut path = folder.join(name);
    match is_shared {
        true => path.add_extension(extension),
        false => path.set_extension(extension),
    };
    let parent = path.parent().unwrap_or(folder);
    fs::create_dir_all(parent).map_err(Error::io("making a folder", parent))?;
    Ok(path)
}

fn add_masks(masks: &mut CocoFile, name: &str, segmented: &Segmentation) {
    let info = |(&id, &score): (&u32, &f32)| InstanceInfo {
        id,
        score: f64::from(score),
        stone_ref: None,
    };
    let instances: Vec<InstanceInfo> = segmented.scores.iter().map(info).collect();
    masks.add(&CocoPhoto {
        file_name: name,
        labels: &segmented.labels,
        instances: &instances,
    });
}

fn evaluation(scores: &[(String, PhotoPairs)]) -> MaskEvaluation {
    let photo = |(name, pairs): &(String, PhotoPairs)| PhotoScore {
        photo: name.clone(),
        score: MaskScore::of(std::slice::from_ref(pairs)),
    };
    let all: Vec<PhotoPairs> = scores.iter().map(|(_, pairs)| pairs.clone()).collect();
    MaskEvaluation {
        photos: scores.iter().map(photo).collect(),
        total: MaskScore::of(&all),
    }
}
