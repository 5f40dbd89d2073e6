//! Photo crops of every stone, rectified to its face, and colours of the thinned cloud.

use super::thin::Candidate;
use super::window::Window;
use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::results::{Crop, StoneRow, crop_side_px, write_crops};
use crate::storage::epoch_tiles::KnownMotion;
use crate::texts::notices::PHOTO_NOT_SHOWN;
use nalgebra::Point3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::{View, signed_area, simplify_ring};
use stonewise_core::id::ImageId;
use stonewise_core::raster::{LabelImage, Raster, RgbImage, label_outlines};
use stonewise_core::statistics::upper_median;
use stonewise_io::image_io::read_rgb;

/// Vertices of a mask's outline closer than this to a line are left out, pixels of the crop.
const OUTLINE_PX: f64 = 0.8;
/// Pieces of a mask smaller than this are left out, square pixels of the crop.
const MIN_PIECE_PX: f64 = 12.0;
/// Samples of a photo along one pixel of a crop, at most.
const MAX_SAMPLES: usize = 4;

/// One crop to be cut.
struct Job<'a> {
    window: &'a Window,
    /// Which photo.
    photo: usize,
    /// Instances of the stone in that photo.
    instances: BTreeSet<u32>,
}

/// An epoch as the report shows it.
#[derive(Clone, Copy)]
pub struct ShownEpoch<'a> {
    /// Which one.
    pub epoch: EpochId,
    /// Its photos.
    pub photos: &'a Segmented,
    /// Its points and stones.
    pub labelled: &'a Labelled,
}

/// A photo with its masks.
struct OpenPhoto<'a> {
    name: &'a str,
    view: &'a View,
    picture: &'a RgbImage,
    /// `None` where no stones were looked for.
    labels: Option<&'a LabelImage>,
}

/// Cuts a crop of every stone out of the photo of this epoch that shows it largest, writes them, and colours
/// the points from the same photos.
///
/// `rows`: of a later epoch against the first. A stone without a partner is shown too, without the outline of
/// a mask. Photos that cannot be read any more are named in the warnings, and their crops left out.
pub fn write_epoch_crops(
    context: &Context,
    epoch: ShownEpoch,
    windows: &[Window],
    rows: Option<&[StoneRow]>,
    points: &mut [Candidate],
) -> Result<()> {
    let ShownEpoch {
        epoch: id,
        photos,
        labelled,
    } = epoch;
    let motion = labelled.ingested.tiles.motion.as_ref();
    let instances = instances_by_stone(labelled, windows, rows);
    let views = &photos.views[..photos.shown_count()];
    let jobs: Vec<Job> = windows
        .iter()
        .filter_map(|w| job(w, instances.get(&w.stone_id), views, motion))
        .collect();
    let natural = |j: &Job| natural_px(j.window, &views[j.photo], motion);
    let mut wanted: Vec<f64> = jobs.iter().map(natural).collect();
    let side_px = crop_side_px(jobs.len(), upper_median(&mut wanted).unwrap_or(0.0));
    let mut by_photo: BTreeMap<usize, Vec<&Job>> = (0..views.len()).map(|p| (p, Vec::new())).collect();
    for job in &jobs {
        by_photo.entry(job.photo).or_default().push(job);
    }
    assign_photos(points, views, labelled);
    context.progress.begin("photo crops", by_photo.len() as u64);
    let cut = by_photo
        .into_par_iter()
        .map(|(photo, jobs)| {
            context.progress.check()?;
            let picture = match read_rgb(&photos.photos[photo].path) {
                Ok(picture) => picture,
                Err(error) => {
                    let subject = photos.photos[photo].path.to_string_lossy();
                    let message = PHOTO_NOT_SHOWN.say(&[("error", error.to_string().into())]);
                    context.warnings.skipped("evidence", subject, message);
                    context.progress.advance(1);
                    return Ok((photo, Vec::new(), None));
                }
            };
            let labels = photos.labels(ImageId(photo as u32))?;
            let view = &photos.views[photo];
            let open = OpenPhoto {
                name: &photos.photos[photo].camera,
                view,
                picture: &picture,
                labels: labels.as_ref(),
            };
            let cut = |job: &&Job| cut(job, &open, motion, side_px);
            let crops: Vec<(Crop, Vec<[u8; 3]>)> = jobs.iter().map(cut).collect();
            context.progress.advance(1);
            Ok((photo, crops, Some(colours(points, photo, view, &picture))))
        })
        .collect::<Result<Vec<_>>>()?;
    let mut crops = Vec::new();
    for (_, cut, colours) in cut {
        crops.extend(cut);
        for (i, colour) in colours.into_iter().flatten() {
            points[i].point.colour = colour;
        }
    }
    crops.sort_by_key(|(crop, _)| crop.stone_id);
    let (crops, tiles): (Vec<Crop>, Vec<Vec<[u8; 3]>>) = crops.into_iter().unzip();
    write_crops(&context.out, id.number(), side_px, &crops, &tiles)
}

/// Instances that make up each stone of the first epoch, by its id; of its partner in a later epoch.
fn instances_by_stone<'a>(
    labelled: &'a Labelled,
    windows: &[Window],
    rows: Option<&[StoneRow]>,
) -> BTreeMap<u32, &'a [(ImageId, stonewise_core::id::InstanceId)]> {
    let own: BTreeMap<u32, &[_]> = labelled
        .transfer
        .stones
        .iter()
        .map(|s| (s.stone.0, s.instances.as_slice()))
        .collect();
    match rows {
        None => windows
            .iter()
            .filter_map(|w| Some((w.stone_id, *own.get(&w.stone_id)?)))
            .collect(),
        Some(rows) => rows
            .iter()
            .filter_map(|r| Some((r.stone_id, *own.get(&r.matched_id?)?)))
            .collect(),
    }
}

/// The photo that shows the window largest: of those whose masks show the stone, else of all. `None` where
/// none does.
fn job<'a>(
    window: &'a Window,
    instances: Option<&&[(ImageId, stonewise_core::id::InstanceId)]>,
    views: &[View],
    motion: Option<&KnownMotion>,
) -> Option<Job<'a>> {
    let list = instances.map_or(&[][..], |i| *i);
    let of_photo = |photo: usize| {
        let own = list.iter().filter(|(p, _)| p.0 as usize == photo);
        own.map(|(_, i)| i.0).collect::<BTreeSet<u32>>()
    };
    let largest = |photos: &mut dyn Iterator<Item = usize>| {
        let sized = photos.filter_map(|p| Some((area_px(window, &views[p], motion)?, p)));
        sized.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
    };
    let voting: BTreeSet<usize> = list
        .iter()
        .map(|(p, _)| p.0 as usize)
        .filter(|p| *p < views.len())
        .collect();
    let (_, photo) = largest(&mut voting.into_iter()).or_else(|| largest(&mut (0..views.len())))?;
    Some(Job {
        window,
        photo,
        instances: of_photo(photo),
    })
}

/// Where a point of the moved cloud was when the photos were taken.
fn photographed(p: Point3<f64>, motion: Option<&KnownMotion>) -> Point3<f64> {
    motion.map_or(p, |motion| motion.before(&p))
}

/// Area of the window in a photo, square pixels; `None` where a corner lies outside or it is seen from
/// behind.
fn area_px(window: &Window, view: &View, motion: Option<&KnownMotion>) -> Option<f64> {
    let h = window.half_m;
    let mut corners = Vec::with_capacity(4);
    // Clockwise on the screen, where y points down.
    for (a, u) in [(-h, h), (h, h), (h, -h), (-h, -h)] {
        let projection = view.project(&photographed(window.at(a, u), motion))?;
        if !view.is_inside(projection.pixel) {
            return None;
        }
        corners.push(projection.pixel);
    }
    let area = signed_area(&corners);
    (area > 0.0).then_some(area)
}

/// Edge of a crop at the photo's own resolution, pixels.
fn natural_px(window: &Window, view: &View, motion: Option<&KnownMotion>) -> f64 {
    area_px(window, view, motion).unwrap_or(0.0).sqrt()
}

/// Resamples a photo on the plane of a stone's face, and outlines its mask there.
fn cut(job: &Job, open: &OpenPhoto, motion: Option<&KnownMotion>, side_px: u32) -> (Crop, Vec<[u8; 3]>) {
    let OpenPhoto {
        name,
        view,
        picture,
        labels,
    } = *open;
    let step = 2.0 * job.window.half_m / f64::from(side_px);
    let samples =
        ((natural_px(job.window, view, motion) / f64::from(side_px)).ceil() as usize).clamp(1, MAX_SAMPLES);
    let pixel = |x: f64, y: f64| {
        let (along, up) = (x * step - job.window.half_m, job.window.half_m - y * step);
        let world = photographed(job.window.at(along, up), motion);
        Some(view.project(&world)?.pixel)
    };
    let mut tile = Vec::with_capacity((side_px * side_px) as usize);
    let mut mask = Raster::filled(side_px, side_px, 0u32);
    for y in 0..side_px {
        for x in 0..side_px {
            tile.push(mean_colour(samples, picture, |dx, dy| {
                pixel(f64::from(x) + dx, f64::from(y) + dy)
            }));
            let middle = pixel(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let instance = middle.and_then(|p| labels?.at(p)).copied().unwrap_or(0);
            if let Some(cell) = mask.get_mut(x, y) {
                *cell = u32::from(job.instances.contains(&instance));
            }
        }
    }
    let rings = label_outlines(&mask).remove(&1).unwrap_or_default();
    let large = rings.into_iter().filter(|r| signed_area(r).abs() >= MIN_PIECE_PX);
    let crop = Crop {
        stone_id: job.window.stone_id,
        photo: name.to_owned(),
        half_m: job.window.half_m,
        rings: large
            .map(|r| {
                simplify_ring(&r, OUTLINE_PX)
                    .iter()
                    .map(|v| v.map(|c| c as f32))
                    .collect()
            })
            .collect(),
    };
    (crop, tile)
}

/// Mean of samples squared within a pixel; grey where the photo does not show it.
fn mean_colour(samples: usize, picture: &RgbImage, pixel: impl Fn(f64, f64) -> Option<[f64; 2]>) -> [u8; 3] {
    let mut sum = [0u32; 3];
    let mut found = 0;
    for j in 0..samples {
        for i in 0..samples {
            let at = |k: usize| (k as f64 + 0.5) / samples as f64;
            if let Some(colour) = pixel(at(i), at(j)).and_then(|p| picture.at(p)) {
                sum = std::array::from_fn(|c| sum[c] + u32::from(colour[c]));
                found += 1;
            }
        }
    }
    if found == 0 {
        [128; 3]
    } else {
        sum.map(|s| (s / found) as u8)
    }
}

/// Gives every point the photo with the finest ground sampling distance; a stone's points only photos that
/// voted for it, where any did: none votes for a stone that was added by hand.
fn assign_photos(points: &mut [Candidate], views: &[View], labelled: &Labelled) {
    let voting: BTreeMap<u32, BTreeSet<usize>> = labelled
        .transfer
        .stones
        .iter()
        .map(|s| {
            (
                s.stone.0,
                s.instances
                    .iter()
                    .map(|(p, _)| p.0 as usize)
                    .filter(|p| *p < views.len())
                    .collect(),
            )
        })
        .collect();
    points.par_iter_mut().for_each(|candidate| {
        let own = voting.get(&candidate.point.stone);
        let allowed = |p: &usize| own.is_none_or(|photos| photos.is_empty() || photos.contains(p));
        let gsd = |p: usize| {
            let projection = views[p].project(&candidate.surveyed)?;
            views[p]
                .is_inside(projection.pixel)
                .then(|| (views[p].gsd_m(projection.depth_m), p))
        };
        let best = (0..views.len())
            .filter(allowed)
            .filter_map(gsd)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        candidate.photo = best.map(|(_, p)| p);
    });
}

/// Colours of the points that were given this photo, with their indices.
fn colours(points: &[Candidate], photo: usize, view: &View, picture: &RgbImage) -> Vec<(usize, [u8; 3])> {
    let own = points.iter().enumerate().filter(|(_, p)| p.photo == Some(photo));
    let colour = |(i, p): (usize, &Candidate)| Some((i, *picture.at(view.project(&p.surveyed)?.pixel)?));
    own.filter_map(colour).collect()
}
