//! Stones in boxes that a person drew on the unrolled wall: the detector outlines them in the photos.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::results::Facade;
use nalgebra::{Point2, Point3};
use std::cmp::Reverse;
use std::collections::BTreeMap;
use stonewise_core::cloud::TileSource;
use stonewise_core::geometry::{OutlineParams, View, cell_of, outline};
use stonewise_core::statistics::upper_median;
use stonewise_core::transfer::NoEffect;
use stonewise_io::image_io::read_rgb;
use stonewise_segment::tiling::outline_boxes;
use stonewise_segment::{StoneFinder, Weights};

/// Part of a box's sides by which points are taken beyond each of them: a stone may stick out of its box.
const MARGIN: f64 = 0.15;
/// Points along the longer side of a box at most.
const POINTS_ALONG: f64 = 150.0;
/// Points further before or behind the middle one are no part of the face, metres: a reveal, a bush.
const DEPTH_M: f64 = 0.3;
/// Photos that outline a stone at most, those with most pixels of it first. More would only cost time: the
/// masks of one stone in several photos differ little.
const PHOTOS: usize = 4;
/// A photo in which a box is less than this across does not show the stone well enough, pixels.
const LEAST_PX: f64 = 12.0;

/// Where an edit lies on the wall, or why it lies nowhere.
pub(super) type Places = std::result::Result<Vec<Point2<f64>>, NoEffect>;

/// A box on the wall with the points of the cloud in and around it.
struct Boxed {
    low: Point2<f64>,
    high: Point2<f64>,
    /// The first in each small cube.
    points: BTreeMap<[i64; 3], (Point2<f64>, f64, Point3<f64>)>,
}

impl Boxed {
    fn new(corners: &[[f64; 2]]) -> Self {
        let ends = corners.iter().copied().map(Point2::from);
        let low = ends.clone().reduce(|a, b| a.inf(&b)).unwrap_or_default();
        let high = ends.reduce(|a, b| a.sup(&b)).unwrap_or_default();
        let points = BTreeMap::new();
        Self { low, high, points }
    }

    fn holds(&self, at: &Point2<f64>, margin: f64) -> bool {
        let beyond = margin * (self.high - self.low);
        (0..2).all(|k| at[k] >= self.low[k] - beyond[k] && at[k] <= self.high[k] + beyond[k])
    }

    fn add(&mut self, p: &Point3<f64>, at: Point2<f64>, out_m: f64) {
        if self.holds(&at, MARGIN) {
            let cell = (self.high - self.low).max() / POINTS_ALONG;
            self.points.entry(cell_of(p, cell)).or_insert((at, out_m, *p));
        }
    }

    /// Places and points of the face.
    fn face(&self) -> Vec<(Point2<f64>, Point3<f64>)> {
        let mut depths: Vec<f64> = self.points.values().map(|p| p.1).collect();
        let Some(middle) = upper_median(&mut depths) else {
            return Vec::new();
        };
        let near = self.points.values().filter(|p| (p.1 - middle).abs() <= DEPTH_M);
        near.map(|(at, _, p)| (*at, *p)).collect()
    }

    /// Left, top, right, bottom of the box in a photo that shows all of it from the front, pixels.
    fn in_photo(&self, view: &View, face: &[(Point2<f64>, Point3<f64>)], wall: &Facade) -> Option<[f64; 4]> {
        let mut bounds: Option<[f64; 4]> = None;
        for (_, p) in face.iter().filter(|(at, _)| self.holds(at, 0.0)) {
            let is_before = wall.frame_at(p).out.dot(&(view.centre() - p)) > 0.0;
            let [x, y] = view
                .project(p)
                .map(|seen| seen.pixel)
                .filter(|px| is_before && view.is_inside(*px))?;
            let [left, top, right, bottom] = bounds.unwrap_or([x, y, x, y]);
            bounds = Some([left.min(x), top.min(y), right.max(x), bottom.max(y)]);
        }
        bounds.filter(|b| across(b) >= LEAST_PX)
    }
}

fn across([left, top, right, bottom]: &[f64; 4]) -> f64 {
    ((right - left) * (bottom - top)).sqrt()
}

/// The outline of the stone in each box (two opposite corners, along and up, metres), or why there is none.
///
/// Points of the cloud belong to the stone where most of the photos say so. Cost: a pass over the cloud, and a
/// tile of the detector for each box in each of the photos chosen.
pub(super) fn stones_in_boxes(
    context: &Context,
    boxes: &[&[[f64; 2]]],
    wall: &Facade,
    photos: &Segmented,
    labelled: &Labelled,
) -> Result<Vec<Places>> {
    let mut boxes: Vec<Boxed> = boxes.iter().map(|corners| Boxed::new(corners)).collect();
    let tiles = &labelled.ingested.tiles.surveyed;
    for tile in 0..tiles.tile_count() {
        context.progress.check()?;
        let cloud = tiles.load(tile)?;
        for p in (0..cloud.len()).map(|i| cloud.world(i)) {
            let (at, out_m) = (wall.place(&p), wall.out_m(&p));
            boxes.iter_mut().for_each(|b| b.add(&p, at, out_m));
        }
    }

    let faces: Vec<_> = boxes.iter().map(Boxed::face).collect();
    let mut by_photo: BTreeMap<usize, Vec<(usize, [f64; 4])>> = BTreeMap::new();
    for (i, (boxed, face)) in boxes.iter().zip(&faces).enumerate() {
        let views = photos.views.iter().enumerate();
        let mut seen: Vec<_> = views
            .filter_map(|(photo, view)| Some((photo, boxed.in_photo(view, face, wall)?)))
            .collect();
        seen.sort_by_key(|(photo, pixels)| (Reverse(across(pixels) as u64), *photo));
        for (photo, pixels) in seen.into_iter().take(PHOTOS) {
            by_photo.entry(photo).or_default().push((i, pixels));
        }
    }

    let segment = &context.project.settings.segment;
    let finder = StoneFinder::open(&Weights::named(&segment.model), segment.tiling.min_score as f32)?;
    let mut votes: Vec<Vec<u32>> = faces.iter().map(|face| vec![0; face.len()]).collect();
    let mut photos_of = vec![0u32; boxes.len()];

    for (photo, shown) in &by_photo {
        let image = read_rgb(&photos.photos[*photo].path)?;
        let pixels: Vec<[f64; 4]> = shown.iter().map(|s| s.1).collect();
        let found = outline_boxes(&finder, &image, None, &pixels, &segment.tiling, context.progress)?;
        for ((i, _), label) in shown.iter().zip(1..) {
            photos_of[*i] += 1;
            let is_stone = |p: &Point3<f64>| {
                photos.views[*photo].project(p).is_some_and(|seen| {
                    let [x, y] = seen.pixel.map(|v| v.floor().max(0.0) as u32);
                    found.labels.get(x, y) == Some(&label)
                })
            };
            for (vote, (_, p)) in votes[*i].iter_mut().zip(&faces[*i]) {
                *vote += u32::from(is_stone(p));
            }
        }
    }

    let outlined = |i: usize| {
        if photos_of[i] == 0 {
            return Err(NoEffect::NoPlace("no photo shows the whole box".to_owned()));
        }
        let voted = faces[i]
            .iter()
            .zip(&votes[i])
            .filter(|(_, votes)| 2 * **votes > photos_of[i]);
        let stone: Vec<Point2<f64>> = voted.map(|((at, _), _)| *at).collect();
        let ring = outline(&stone, &OutlineParams::default());
        ring.ok_or_else(|| NoEffect::NoPlace("the detector could not outline a stone in the box".to_owned()))
    };

    Ok((0..boxes.len()).map(outlined).collect())
}
