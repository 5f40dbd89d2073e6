//! The parts of the photos that show matched stones, cut out once and read back batch by batch.

use super::pairs::DiskPairs;
use super::registered::STEP;
use crate::error::{Error, Result};
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::project::Project;
use crate::results::track_side_px;
use crate::storage::epoch_tiles::KnownMotion;
use crate::storage::spill::{Spill, SpillBins};
use crate::storage::step::StepDir;
use crate::texts::notices::PHOTO_NOT_TRACKED;
use crate::warnings::Warnings;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::{Bounds, FaceFrame, View};
use stonewise_core::raster::RgbImage;
use stonewise_core::registration::PairSource;
use stonewise_core::registration::photos::{Chip, Photo, PhotoCamera, PhotoParams, PhotoSource};
use stonewise_io::image_io::read_rgb;

/// Whether stones are tracked in photos of these two epochs. Views of clouds measure nothing
/// that the clouds do not.
pub(super) fn tracks_photos(project: &Project, epochs: Pair<EpochId>) -> bool {
    let photographed = epochs.map(|e| project.epochs[e].photos.is_some());
    project.settings.registration.photos.enabled && photographed.into_array() == [true; 2]
}

/// Largest tangent of the angle between a photo's ray and the face's normal: beyond 63 degrees a stone shows
/// its joints.
const LARGEST_TANGENT: f64 = 2.0;
/// Pixels around a stone that interpolation needs.
const BORDER_PX: f64 = 3.0;
/// Bytes before the grey values of a chip: slot, photo, corner, width and height.
const HEADER: usize = 24;

/// Chips of all batches.
pub struct DiskPhotos {
    photos: Vec<Photo>,
    params: PhotoParams,
    chips: SpillBins<u32>,
    /// Pairs in each batch.
    counts: Vec<usize>,
}

/// A stone's box in its frame.
struct Boxed {
    batch: u32,
    slot: u32,
    centroid: Point3<f64>,
    frame: FaceFrame,
    bounds: Bounds,
    /// How its surroundings moved, metres.
    shift: Vector3<f64>,
}

impl DiskPhotos {
    /// Cuts out what the photos of both epochs show of the matched stones. `None` where an epoch has none.
    /// Memory: a photo a thread, and what is cut out of it.
    pub fn gather(
        context: &Context,
        photos: Pair<&Segmented>,
        labelled: Pair<&Labelled>,
        pairs: &DiskPairs,
        step: &StepDir,
        warnings: &Warnings,
    ) -> Result<Option<Self>> {
        let mut params = context.project.settings.registration.photos.clone();
        if photos.into_iter().any(|p| p.photo_count() < params.min_photos) {
            return Ok(None);
        }
        if params.rolling_shutter.is_none() {
            params.rolling_shutter = Some(has_rolling_shutter(context.project)?);
        }
        let (boxes, counts) = boxes(pairs)?;
        let mut list = Vec::new();
        let mut paths = Vec::new();
        for (epoch, (segmented, labelled)) in photos.zip(labelled).into_iter().enumerate() {
            // Views show nothing that the clouds do not contain.
            let count = segmented.photo_count();
            for (view, photo) in segmented.views.iter().zip(&segmented.photos).take(count) {
                list.push(Photo {
                    name: photo.camera.clone(),
                    epoch,
                    camera: camera(view, labelled),
                });
                paths.push((&photo.path, view));
            }
        }
        let shown = choose(&boxes, &list, &paths, &params);
        let mut spill = Spill::new(&step.file("chips"), |k: &u32| format!("c{k}"))?;
        let chips = |number: usize| -> Result<_> {
            let Some(stones) = shown.get(&number) else {
                return Ok(Vec::new());
            };
            let path = paths[number].0;
            let picture = match read_rgb(path) {
                Ok(picture) => picture,
                Err(error) => {
                    let message = PHOTO_NOT_TRACKED.say(&[("error", error.to_string().into())]);
                    warnings.notice(STEP, path.to_string_lossy(), message);
                    return Ok(Vec::new());
                }
            };
            let chips = stones.iter().filter_map(|&(k, corners)| {
                let chip = cut(&picture, boxes[k].slot, number as u32, corners)?;
                Some((boxes[k].batch, chip))
            });
            Ok(chips.collect())
        };
        let all = 0..paths.len();
        context
            .progress
            .each_prepared("cut stones out of photos", all, chips, |_, chips| {
                for (batch, chip) in &chips {
                    spill.push(*batch, chip)?;
                }
                Ok(())
            })?;
        Ok(Some(Self {
            photos: list,
            params,
            chips: spill.finish()?,
            counts,
        }))
    }
}

/// Whether a camera file of the project says that a camera has a rolling shutter.
fn has_rolling_shutter(project: &Project) -> Result<bool> {
    for epoch in &project.epochs {
        if epoch.read_cameras()?.rolling_shutter {
            return Ok(true);
        }
    }
    Ok(false)
}

fn camera(view: &View, labelled: &Labelled) -> Box<dyn PhotoCamera> {
    match &labelled.ingested.tiles.motion {
        None => Box::new(view.clone()),
        Some(motion) => Box::new(SeenBeforeMotion {
            view: view.clone(),
            motion: motion.clone(),
        }),
    }
}

/// The camera of a self-check: it sees moved points where they were when the photo was taken.
struct SeenBeforeMotion {
    view: View,
    motion: KnownMotion,
}

impl PhotoCamera for SeenBeforeMotion {
    fn project(&self, world: &Point3<f64>) -> Option<[f64; 2]> {
        PhotoCamera::project(&self.view, &self.motion.before(world))
    }

    fn centre(&self) -> Point3<f64> {
        PhotoCamera::centre(&self.view)
    }

    fn height_px(&self) -> f64 {
        self.view.height_px()
    }
}

/// The boxes of all pairs, and how many each batch holds. Memory: a batch a thread.
fn boxes(pairs: &DiskPairs) -> Result<(Vec<Boxed>, Vec<usize>)> {
    let of_batch = |batch: usize| -> Result<(Vec<Option<Boxed>>, usize)> {
        let loaded = pairs.load(batch)?;
        let shifts = pairs.shifts(batch);
        let found = loaded.iter().zip(&shifts).enumerate();
        let found = found
            .map(|(slot, (pair, shift))| {
                let frame = FaceFrame::from_normal(&pair.normal);
                let turn = frame.face_from_world();
                let points = &pair.points_first;
                let local = (0..points.len()).map(|i| Point3::from(turn * (points.world(i) - pair.centroid)));
                let bounds = Bounds::of(local)?;
                Some(Boxed {
                    batch: batch as u32,
                    slot: slot as u32,
                    centroid: pair.centroid,
                    frame,
                    bounds,
                    shift: *shift,
                })
            })
            .collect();
        Ok((found, loaded.len()))
    };
    let batches = (0..pairs.batch_count()).into_par_iter().map(of_batch);
    let (found, counts): (Vec<_>, Vec<_>) = batches.collect::<Result<Vec<_>>>()?.into_iter().unzip();
    Ok((found.into_iter().flatten().flatten().collect(), counts))
}

/// The part of an image: lowest pixel, and one beyond the highest.
type Corners = [[u32; 2]; 2];

/// For each photo the stones that it shows, with the part of it: for each stone the sharpest photos of either
/// epoch.
fn choose(
    boxes: &[Boxed],
    photos: &[Photo],
    paths: &[(&std::path::PathBuf, &View)],
    params: &PhotoParams,
) -> BTreeMap<usize, Vec<(usize, Corners)>> {
    let chosen: Vec<Vec<(usize, Corners)>> = boxes
        .par_iter()
        .map(|stone| {
            let mut chosen = Vec::new();
            for epoch in 0..2 {
                let mut seen: Vec<(f64, usize, Corners)> = photos
                    .iter()
                    .enumerate()
                    .filter(|(_, photo)| photo.epoch == epoch)
                    .filter_map(|(number, photo)| {
                        let (pixel_m, corners) = stone.seen_by(photo, paths[number].1, params.margin_m())?;
                        Some((pixel_m, number, corners))
                    })
                    .collect();
                seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                seen.truncate(params.max_photos);
                chosen.extend(seen.into_iter().map(|(_, number, corners)| (number, corners)));
            }
            chosen
        })
        .collect();
    let mut of_photo: BTreeMap<usize, Vec<(usize, Corners)>> = BTreeMap::new();
    for (k, photos) in chosen.into_iter().enumerate() {
        for (number, corners) in photos {
            of_photo.entry(number).or_default().push((k, corners));
        }
    }
    of_photo
}

impl Boxed {
    /// Size of a photo's pixel on the stone, and the part of the photo that shows it with a margin; `None`
    /// where the photo shows it from behind, too obliquely or not wholly.
    fn seen_by(&self, photo: &Photo, view: &View, margin_m: f64) -> Option<(f64, Corners)> {
        let shift = if photo.epoch == 1 {
            self.shift
        } else {
            Vector3::zeros()
        };
        let centre = self.centroid + shift;
        let ray = self.frame.face_from_world() * (centre - photo.camera.centre());
        if ray.z >= 0.0 || ray.xy().norm() > -LARGEST_TANGENT * ray.z {
            return None;
        }
        let pixel_m = photo.pixel_m(&centre, &self.frame.along, &self.frame.up)?;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for k in 0..8 {
            let corner = |margin: f64| {
                let pick = |axis: usize, by: f64| match (k >> axis) & 1 {
                    0 => self.bounds.min[axis] - by,
                    _ => self.bounds.max[axis] + by,
                };
                let local = Vector3::new(pick(0, margin), pick(1, margin), pick(2, 0.0));
                let world = centre + self.frame.face_from_world().transpose() * local;
                photo.camera.project(&world)
            };
            if !view.is_inside(corner(0.0)?) {
                return None;
            }
            let pixel = corner(margin_m)?;
            for axis in 0..2 {
                low[axis] = low[axis].min(pixel[axis]);
                high[axis] = high[axis].max(pixel[axis]);
            }
        }
        let size = [view.camera.width, view.camera.height];
        let clip = |v: f64, axis: usize| v.clamp(0.0, f64::from(size[axis])) as u32;
        let first = [clip(low[0] - BORDER_PX, 0), clip(low[1] - BORDER_PX, 1)];
        let end = [
            clip(high[0] + BORDER_PX + 1.0, 0),
            clip(high[1] + BORDER_PX + 1.0, 1),
        ];
        Some((pixel_m, [first, end]))
    }
}

/// A chip as bytes.
fn cut(picture: &RgbImage, slot: u32, photo: u32, [first, end]: Corners) -> Option<Vec<u8>> {
    let end = [end[0].min(picture.width()), end[1].min(picture.height())];
    let (width, height) = (end[0].checked_sub(first[0])?, end[1].checked_sub(first[1])?);
    let mut record = Vec::with_capacity(HEADER + width as usize * height as usize);
    for number in [slot, photo, first[0], first[1], width, height] {
        record.extend(number.to_le_bytes());
    }
    for y in first[1]..end[1] {
        let start = y as usize * picture.width() as usize;
        let line = &picture.data()[start + first[0] as usize..start + end[0] as usize];
        record.extend(line.iter().map(grey));
    }
    Some(record)
}

/// Luma of ITU-R BT.601, as cameras weigh it.
fn grey([r, g, b]: &[u8; 3]) -> u8 {
    ((299 * u32::from(*r) + 587 * u32::from(*g) + 114 * u32::from(*b) + 500) / 1000) as u8
}

impl PhotoSource<Error> for DiskPhotos {
    fn photos(&self) -> &[Photo] {
        &self.photos
    }

    fn params(&self) -> &PhotoParams {
        &self.params
    }

    fn picture_px(&self) -> usize {
        track_side_px(self.counts.iter().sum()) as usize
    }

    fn load(&self, batch: usize) -> Result<Vec<Vec<Chip>>> {
        let mut chips = vec![Vec::new(); self.counts[batch]];
        let key = batch as u32;
        if !self.chips.keys().contains(&key) {
            return Ok(chips);
        }
        let bytes = self.chips.read(&key)?;
        let mut rest = bytes.as_slice();
        while rest.len() >= HEADER {
            let number = |k: usize| {
                u32::from_le_bytes([rest[4 * k], rest[4 * k + 1], rest[4 * k + 2], rest[4 * k + 3]])
            };
            let [slot, photo, x, y, width, height] = [0, 1, 2, 3, 4, 5].map(number);
            let end = HEADER + width as usize * height as usize;
            let Some(grey) = rest.get(HEADER..end) else { break };
            if let Some(of_pair) = chips.get_mut(slot as usize) {
                of_pair.push(Chip {
                    photo,
                    corner: [x, y],
                    width,
                    height,
                    grey: grey.to_vec(),
                });
            }
            rest = &rest[end..];
        }
        Ok(chips)
    }
}
