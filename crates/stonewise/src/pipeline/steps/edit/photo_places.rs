//! Edits drawn in photos, and boxes whose stones photos show, brought onto the wall.

use super::boxes::{Places, stones_in_boxes};
use crate::edits::{Edit, EditsFile, photo_named};
use crate::error::Result;
use crate::files::{read_json, write_json};
use crate::pipeline::context::Context;
use crate::pipeline::graph::Run;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::results::Facade;
use crate::storage::step::Key;
use nalgebra::{Point2, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::Epochs;
use stonewise_core::geometry::{Bounds, Camera, Plane, View, cell_of};
use stonewise_core::transfer::NoEffect;
use stonewise_segment::Weights;

/// Points of stones this far from the ray of a pixel say where the face is, metres: the neighbourhood in
/// which a stone's normal is found.
const REACH_M: f64 = 0.75;
/// Edge of the cubes of which only the first point counts, metres, so that dense clouds do not crowd out the
/// neighbourhood.
const THIN_M: f64 = 0.05;
/// Nearest points to which the face is fitted: about three stones.
const NEAREST: usize = 60;
/// Points further than this from a first plane are left out of the second, metres: the relief of stones.
const RELIEF_M: f64 = 0.1;

/// Where each edit lies on the unrolled wall: its own shape, the pixels of its photo carried along their rays
/// onto the stones that the photo's epoch shows there, or the stone that photos show in its box.
pub(super) fn photo_places(
    run: &Run,
    file: &EditsFile,
    wall: &Facade,
    labelled: &Epochs<Arc<Labelled>>,
) -> Result<Vec<Places>> {
    let context = run.context;
    let mut places: Vec<Places> = file
        .edits
        .iter()
        .map(|edit| Ok(edit.shape().iter().copied().map(Point2::from).collect()))
        .collect();

    for (id, labelled) in labelled.with_ids() {
        let name = &context.project.epochs[id].name;
        let is_here = |edit: &Edit| edit.epoch.as_ref().map_or(id.is_reference(), |e| e == name);
        let concerned = |edit: &Edit| context.project.epochs.iter().find(|e| edit.concerns(&e.name));
        let is_boxed_here = |edit: &Edit| concerned(edit).is_some_and(|e| e.name == *name);
        let (mut drawn, mut boxed) = (Vec::new(), Vec::new());
        for (index, edit) in file.edits.iter().enumerate() {
            match (edit.photo.is_some(), edit.corners.is_empty()) {
                (true, _) if is_here(edit) => drawn.push((index, edit)),
                (false, false) if is_boxed_here(edit) => boxed.push((index, edit)),
                _ => {}
            }
        }
        if drawn.is_empty() && boxed.is_empty() {
            continue;
        }
        let shapes: Vec<_> = drawn.iter().map(|(_, e)| (&e.photo, e.shape())).collect();
        let boxes: Vec<_> = boxed.iter().map(|(_, e)| e.shape()).collect();
        let segment = (!boxes.is_empty()).then_some(&context.project.settings.segment);
        let weights = match segment.map(|s| Weights::named(&s.model)) {
            Some(weights) => context.weights_digest(&weights)?,
            None => String::new(),
        };
        let inputs = [labelled.key.as_str(), weights.as_str()];
        let key = Key::new("edit-places", &(&shapes, &boxes, segment, wall), &inputs);
        let step = context.step(&format!("edit-places-{id}"), key, |step, _| {
            let mut found: Vec<Places> = Vec::new();
            let photos = run.posed(id)?;
            for (_, edit) in &drawn {
                found.push(carry(context, edit, wall, &photos, labelled)?);
            }
            if !boxes.is_empty() {
                found.extend(stones_in_boxes(context, &boxes, wall, &photos, labelled)?);
            }
            write_json(&step.file(PLACES), &found)
        })?;
        let found: Vec<Places> = read_json(&step.file(PLACES))?;
        for ((index, _), found) in drawn.into_iter().chain(boxed).zip(found) {
            places[index] = found;
        }
    }

    Ok(places)
}

/// What the step found.
const PLACES: &str = "places.json";

/// The pixels of one edit on the wall.
fn carry(
    context: &Context,
    edit: &Edit,
    wall: &Facade,
    photos: &Segmented,
    labelled: &Labelled,
) -> Result<Places> {
    let view = match view_of(edit, photos) {
        Ok(view) => view,
        Err(reason) => return Ok(Err(reason)),
    };
    let mut rays = Vec::new();
    for pixel in edit.shape() {
        match view.ray(*pixel).filter(|_| is_in_photo(&view.camera, *pixel)) {
            Some((centre, direction)) => rays.push(Ray::new(centre, direction)),
            None => return Ok(Err(nowhere(*pixel, "lies outside the photo"))),
        }
    }
    gather(context, &mut rays, labelled)?;
    let mut places = Vec::new();
    for (ray, pixel) in rays.iter().zip(edit.shape()) {
        match ray.hit() {
            Some(hit) => places.push(wall.place(&hit)),
            None => return Ok(Err(nowhere(*pixel, "shows no stone of the cloud within 0.75 m"))),
        }
    }
    Ok(Ok(places))
}

/// Whether a vertex was drawn in the photo or on its border.
fn is_in_photo(camera: &Camera, [x, y]: [f64; 2]) -> bool {
    (0.0..=f64::from(camera.width)).contains(&x) && (0.0..=f64::from(camera.height)).contains(&y)
}

fn nowhere(pixel: [f64; 2], what: &str) -> NoEffect {
    NoEffect::NoPlace(format!("pixel ({:.1}, {:.1}) {what}", pixel[0], pixel[1]))
}

/// The photo of an edit; a view only where no photo has this name.
fn view_of<'a>(edit: &Edit, photos: &'a Segmented) -> std::result::Result<&'a View, NoEffect> {
    let names: Vec<Vec<String>> = photos
        .views
        .iter()
        .zip(&photos.photos)
        .map(|(view, photo)| vec![view.name.clone(), photo.path.to_string_lossy().into_owned()])
        .collect();
    let name = edit.photo.as_deref().unwrap_or_default();
    let index = photo_named(name, &names[..photos.photo_count().min(names.len())])
        .or_else(|_| photo_named(name, &names))
        .map_err(NoEffect::NoPlace)?;
    Ok(&photos.views[index])
}

/// The ray of a pixel and the points of stones around it.
struct Ray {
    centre: Point3<f64>,
    direction: Vector3<f64>,
    /// By cell: distance from the ray, and the point.
    near: BTreeMap<[i64; 3], (f64, Point3<f64>)>,
}

impl Ray {
    fn new(centre: Point3<f64>, direction: Vector3<f64>) -> Self {
        Self {
            centre,
            direction,
            near: BTreeMap::new(),
        }
    }

    /// Distance of a point from the ray; infinite behind the camera.
    fn distance(&self, p: &Point3<f64>) -> f64 {
        let d = p - self.centre;
        let depth = d.dot(&self.direction);
        match depth > 0.0 {
            true => (d - self.direction * depth).norm(),
            false => f64::INFINITY,
        }
    }

    fn may_see(&self, bounds: &Bounds) -> bool {
        let half = (bounds.max - bounds.min).norm() / 2.0;
        self.distance(&bounds.centre()) <= half + REACH_M
    }

    /// Where the ray meets the face of the stones around it.
    fn hit(&self) -> Option<Point3<f64>> {
        let mut nearest: Vec<&(f64, Point3<f64>)> = self.near.values().collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut points: Vec<Point3<f64>> = nearest.into_iter().take(NEAREST).map(|n| n.1).collect();
        let first = Plane::fit(&points)?;
        points.retain(|p| first.normal.dot(&(p - first.centroid)).abs() <= RELIEF_M);
        let face = Plane::fit(&points)?;
        let towards = face.normal.dot(&self.direction);
        let depth = face.normal.dot(&(face.centroid - self.centre)) / towards;
        (depth.is_finite() && depth > 0.0).then(|| self.centre + self.direction * depth)
    }
}

/// Finds the points of stones around the rays that face the camera. Cost: one pass over the tiles that the
/// rays meet.
fn gather(context: &Context, rays: &mut [Ray], labelled: &Labelled) -> Result<()> {
    let Some(ray) = rays.first() else { return Ok(()) };
    let centre = ray.centre;
    let facing: BTreeSet<u32> = labelled
        .stones
        .iter()
        .filter(|s| s.normal.dot(&(centre - s.centroid)) > 0.0)
        .map(|s| s.id.0)
        .collect();
    let tiles = &labelled.ingested.tiles.surveyed;

    for tile in 0..tiles.tile_count() {
        context.progress.check()?;
        let bounds = tiles.bounds(tile);
        if !rays.iter().any(|r| r.may_see(&bounds)) {
            continue;
        }
        let (cloud, labels) = (tiles.load(tile)?, labelled.labels(tile)?);
        for (i, _) in labels
            .stone
            .iter()
            .enumerate()
            .filter(|(_, s)| facing.contains(s))
        {
            let p = cloud.world(i);
            for ray in rays.iter_mut() {
                let distance = ray.distance(&p);
                if distance <= REACH_M {
                    ray.near.entry(cell_of(&p, THIN_M)).or_insert((distance, p));
                }
            }
        }
    }

    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::geometry::Distortion;

    #[test]
    fn the_border_of_a_photo_belongs_to_it() {
        let camera = Camera {
            width: 40,
            height: 30,
            focal_px: [50.0; 2],
            center_px: [20.0, 15.0],
            skew_px: 0.0,
            distortion: Distortion::None,
            near: None,
        };
        for inside in [[0.0, 0.0], [40.0, 30.0], [40.0, 0.0], [12.5, 30.0]] {
            assert!(is_in_photo(&camera, inside), "{inside:?}");
        }
        for outside in [[40.1, 30.0], [-0.1, 3.0], [3.0, 30.1], [f64::NAN, 3.0]] {
            assert!(!is_in_photo(&camera, outside), "{outside:?}");
        }
    }
}
