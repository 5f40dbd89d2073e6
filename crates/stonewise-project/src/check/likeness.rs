//! Do photos show the same where they see the same points of the cloud?
//!
//! Grey values of two photos at the same points of the cloud are alike if each photo shows what its camera sees.
//! A photo under another's name, or one that is turned by 180 degrees, has nothing in common with the others.

use super::alignment::reduced;
use super::edges::{Map, box_mean};
use super::finding::{Finding, Verdict};
use super::photos::{PosedPhoto, some};
use super::sample::Sample;
use crate::Epoch;
use nalgebra::Point3;
use rayon::prelude::*;
use stonewise_base::error::Result;
use stonewise_base::messages::Said;
use stonewise_base::messages::findings::{FLAT_PHOTOS, PHOTOS, UNLIKE_ALL, UNLIKE_PHOTOS};
use stonewise_core::geometry::View;
use stonewise_core::progress::Progress;
use stonewise_core::raster::RgbImage;
use stonewise_core::statistics::upper_median;
use stonewise_io::image_io::read_rgb;

/// Points at which photos are compared.
const POINTS: usize = 50_000;
/// Pixels of the median photo that one pixel of the reduced photos is as wide as: poses may be wrong by one
/// or two.
const PIXEL: f64 = 2.5;
/// Half width of the window whose mean and contrast are taken away, pixels of the reduced photo.
const WINDOW: usize = 8;
/// Grey values that count as noise in the contrast of a window.
const NOISE: f32 = 2.0;
/// Standard deviation of the grey values below which a photo is of one colour.
const FLAT: f64 = 2.0;
/// Fewer common points show nothing.
const COMMON: usize = 500;
/// Photos that show the same have a correlation above the first, photos that do not have one below the second.
/// In sound surveys every photo reached 0.77 or more with at least one other; exchanged and turned photos 0.02
/// at most.
const ALIKE: f64 = 0.4;
const UNLIKE: f64 = 0.2;

/// A photo as the points of the cloud see it.
struct Seen {
    name: String,
    /// Whether its grey values hardly differ.
    is_flat: bool,
    /// Normalised grey value at every point, NaN where the photo does not see it.
    values: Vec<f32>,
}

/// Sizes on the wall.
#[derive(Clone, Copy)]
struct Scale {
    /// Width of a pixel of the reduced photos on the wall, metres.
    pixel_m: f64,
    /// Width of the cells of which the nearest point hides those behind it, metres.
    cell_m: f64,
}

/// Compares the photos of an epoch that have the size of their cameras with each other.
///
/// # Errors
/// The caller stopped it.
pub(super) fn look(
    epoch: &Epoch,
    photos: &[PosedPhoto],
    survey: &Sample,
    progress: &dyn Progress,
) -> Result<Vec<Finding>> {
    let step = (survey.points.len() / POINTS).max(1);
    let points: Vec<Point3<f64>> = survey.points.iter().step_by(step).copied().collect();
    let views: Vec<&View> = photos.iter().map(|(view, _)| *view).collect();
    let Some(pixel_m) = pixel(&points, &views) else {
        return Ok(Vec::new());
    };
    let spacing_m = survey.spacing_m.unwrap_or(0.0) * (step as f64).sqrt();
    let scale = Scale {
        pixel_m,
        cell_m: (3.0 * pixel_m).max(2.0 * spacing_m),
    };
    let photos = photos
        .par_iter()
        .map(|(view, path)| {
            progress.check()?;
            // One that cannot be read is named elsewhere.
            let photo = read_rgb(path).ok();
            let photo = photo.filter(|p| (p.width(), p.height()) == (view.camera.width, view.camera.height));
            Ok(photo.and_then(|photo| seen(&points, view, &photo, scale)))
        })
        .collect::<Result<Vec<_>>>()?;

    let (flat, photos): (Vec<Seen>, Vec<Seen>) = photos.into_iter().flatten().partition(|seen| seen.is_flat);
    let doubt = |text| Finding::new(&epoch.name, &PHOTOS, Verdict::Doubt, text);
    let names = |photos: &[&Seen]| some(&photos.iter().map(|p| p.name.clone()).collect::<Vec<_>>());
    let mut found = Vec::new();

    if !flat.is_empty() {
        let flat: Vec<&Seen> = flat.iter().collect();
        found.push(doubt(FLAT_PHOTOS.say(&[("photos", names(&flat).into())])));
    }

    let likenesses = likenesses(&photos);
    let best: Vec<Option<f64>> = (0..photos.len())
        .map(|i| {
            others(&likenesses, i)
                .map(|(_, likeness)| likeness)
                .max_by(f64::total_cmp)
        })
        .collect();
    let least = best.iter().copied().flatten().min_by(f64::total_cmp);

    match (judge(&likenesses), least) {
        (Judgement::Sound, None) => {}
        (Judgement::Sound, Some(least)) if least < UNLIKE => {
            let unlike = photos.iter().zip(&best);
            let unlike = unlike.filter(|(_, best)| best.is_some_and(|best| best < UNLIKE));
            let unlike: Vec<&Seen> = unlike.map(|(photo, _)| photo).collect();
            let text = format!(
                "unlike the few photos that see the same points (correlation {least:.2}), which may be wrong themselves: {}",
                names(&unlike)
            );
            found.push(Finding::new(&epoch.name, &PHOTOS, Verdict::Note, text));
        }
        (Judgement::Sound, Some(least)) => {
            let text = format!("each shows the same as another (correlation {least:.2} or more)");
            found.push(Finding::new(&epoch.name, &PHOTOS, Verdict::Fine, text));
        }
        (Judgement::AllUnlike, _) => found.push(doubt(UNLIKE_ALL.say(&[]))),
        (Judgement::Outliers(which), _) => {
            let most = which.iter().filter_map(|i| best[*i]).max_by(f64::total_cmp);
            let most = Said::numbers(format!("{:.2}", most.unwrap_or(0.0)));
            let which: Vec<&Seen> = which.into_iter().map(|i| &photos[i]).collect();
            let values = [("photos", names(&which).into()), ("most", most)];
            found.push(doubt(UNLIKE_PHOTOS.say(&values)));
        }
    }

    Ok(found)
}

/// Width of a pixel of the reduced photos on the wall, metres; `None` where no photo sees a point.
fn pixel(points: &[Point3<f64>], views: &[&View]) -> Option<f64> {
    let sampling = |view: &&View| Some(view.gsd_m(depth(points, view)?));
    let mut widths: Vec<f64> = views.iter().filter_map(sampling).collect();
    Some(PIXEL * upper_median(&mut widths)?)
}

/// Median depth of the points that a photo sees, metres.
fn depth(points: &[Point3<f64>], view: &View) -> Option<f64> {
    let depths = points.iter().step_by(20).filter_map(|p| view.project(p));
    let inside = depths.filter(|seen| view.is_inside(seen.pixel));
    let mut depths: Vec<f64> = inside.map(|seen| seen.depth_m).collect();
    upper_median(&mut depths)
}

/// The grey values of a photo at the points that it sees, less the mean around them and relative to the
/// contrast there, so that light and exposure do not matter.
fn seen(points: &[Point3<f64>], view: &View, photo: &RgbImage, scale: Scale) -> Option<Seen> {
    let gsd_m = view.gsd_m(depth(points, view)?);
    let by = (scale.pixel_m / gsd_m).round().max(1.0) as u32;
    let size = [photo.width() / by, photo.height() / by];
    let (grey, deviation) = normalised(&reduced(photo, size.map(|side| side as usize), by));
    let cell = (scale.cell_m / gsd_m).max(1.0);
    let columns = (f64::from(photo.width()) / cell) as usize + 1;
    let rows = (f64::from(photo.height()) / cell) as usize + 1;
    let mut nearest = vec![f64::INFINITY; columns * rows];
    let projected: Vec<Option<(usize, usize, f64)>> = points
        .iter()
        .map(|p| {
            let seen = view.project(p).filter(|seen| view.is_inside(seen.pixel))?;
            let [x, y] = seen.pixel.map(|pixel| pixel.max(0.0));
            let at = (y / cell) as usize * columns + (x / cell) as usize;
            let [px, py] = [x, y].map(|pixel| (pixel / f64::from(by)) as usize);
            let pixel = (px < grey.width && py < grey.height).then_some(py * grey.width + px)?;
            let near = nearest.get_mut(at)?;
            *near = near.min(seen.depth_m);
            Some((at, pixel, seen.depth_m))
        })
        .collect();

    let value = |seen: Option<(usize, usize, f64)>| match seen {
        Some((at, pixel, depth_m)) if depth_m < nearest[at] + 2.0 * scale.cell_m => grey.values[pixel],
        _ => f32::NAN,
    };
    Some(Seen {
        name: view.name.clone(),
        is_flat: deviation < FLAT,
        values: projected.into_iter().map(value).collect(),
    })
}

/// A map less its mean in a window and relative to its scatter there; the standard deviation of all of it.
fn normalised(grey: &Map) -> (Map, f64) {
    let (w, h) = (grey.width, grey.height);
    let count = grey.values.len().max(1) as f64;
    let mean = grey.values.iter().map(|v| f64::from(*v)).sum::<f64>() / count;
    let centred: Vec<f32> = grey.values.iter().map(|v| v - mean as f32).collect();
    let variance = centred.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / count;
    let local = box_mean(&centred, w, h, WINDOW);
    let rest: Vec<f32> = centred.iter().zip(local).map(|(v, mean)| v - mean).collect();
    let squares: Vec<f32> = rest.iter().map(|v| v * v).collect();
    let contrast = box_mean(&squares, w, h, WINDOW);
    let values = rest
        .iter()
        .zip(contrast)
        .map(|(v, c)| v / (c.max(0.0).sqrt() + NOISE));
    let map = Map {
        width: w,
        height: h,
        values: values.collect(),
    };
    (map, variance.sqrt())
}

/// Correlation of every two photos; `None` where they have too few points in common.
fn likenesses(photos: &[Seen]) -> Vec<Vec<Option<f64>>> {
    let row = |one: &Seen| {
        photos
            .iter()
            .map(|other| likeness(one, other))
            .collect::<Vec<_>>()
    };
    photos.par_iter().map(row).collect()
}

fn likeness(one: &Seen, other: &Seen) -> Option<f64> {
    let (mut count, mut product, mut own, mut others) = (0, 0.0, 0.0, 0.0);
    let values = one.values.iter().zip(&other.values);
    for (a, b) in values.filter(|(a, b)| a.is_finite() && b.is_finite()) {
        let (a, b) = (f64::from(*a), f64::from(*b));
        count += 1;
        product += a * b;
        own += a * a;
        others += b * b;
    }
    (count >= COMMON).then(|| product / (own * others).sqrt().max(1e-12))
}

#[derive(Debug, PartialEq)]
enum Judgement {
    Sound,
    /// No two photos show the same.
    AllUnlike,
    /// Photos that are like no other, while others that see the same points are alike.
    Outliers(Vec<usize>),
}

/// Other photos that a photo can be compared with, and its likeness to them.
fn others(likenesses: &[Vec<Option<f64>>], photo: usize) -> impl Iterator<Item = (usize, f64)> {
    let row = likenesses[photo].iter().enumerate();
    let known = row.filter_map(|(other, likeness)| Some((other, (*likeness)?)));
    known.filter(move |(other, _)| *other != photo)
}

fn judge(likenesses: &[Vec<Option<f64>>]) -> Judgement {
    let of = |a: usize| others(likenesses, a);
    let photos = 0..likenesses.len();
    let best = photos.clone().flat_map(|a| of(a).map(|(_, likeness)| likeness));
    if best.max_by(f64::total_cmp).is_some_and(|best| best < UNLIKE) {
        return Judgement::AllUnlike;
    }
    let is_outlier = |a: &usize| {
        let is_unlike = of(*a).all(|(_, likeness)| likeness < UNLIKE);
        // Two that see what this one should see, and agree.
        let agree = |b: usize, c: usize| likenesses[b][c].is_some_and(|likeness| likeness > ALIKE);
        is_unlike && of(*a).any(|(b, _)| of(*a).any(|(c, _)| b != c && agree(b, c)))
    };
    let outliers: Vec<usize> = photos.filter(is_outlier).collect();
    match outliers.is_empty() {
        true => Judgement::Sound,
        false => Judgement::Outliers(outliers),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use stonewise_core::geometry::{Camera, Rigid3};
    use stonewise_core::id::ImageId;
    use stonewise_core::raster::Raster;

    /// Grey value of a wall at a place, metres: patches of 6 cm.
    fn shade(x: f64, y: f64) -> f64 {
        let [i, j] = [x, y].map(|m| (m / 0.06).floor());
        ((12.9898 * i + 78.233 * j).sin() * 43_758.5).rem_euclid(1.0)
    }

    /// Photo of the wall from 5 m, at a place along it, in a light of its own.
    fn photo(number: u32, x: f64) -> (View, RgbImage) {
        let (width, height, f) = (400, 300, 500.0);
        let view = View {
            image: ImageId(number),
            name: number.to_string(),
            camera: Camera::pinhole(width, height, f),
            cam_from_world: Rigid3::new(Vector3::new(-x, 0.0, 0.0), Vector3::zeros()),
        };
        let pixels = (0..width * height).map(|i| {
            let (u, v) = (f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
            let [along, down] = [x + (u - 200.0) * 5.0 / f, (v - 150.0) * 5.0 / f];
            let light = 40.0 + 20.0 * f64::from(number) + u / 20.0;
            [(light + 60.0 * shade(along, down)) as u8; 3]
        });
        let image = Raster::from_vec(width, height, pixels.collect()).unwrap();
        (view, image)
    }

    fn judged(photos: &[(View, RgbImage)]) -> Judgement {
        let grid = (0..200).flat_map(|i| (0..100).map(move |j| (f64::from(i), f64::from(j))));
        let points: Vec<Point3<f64>> = grid
            .map(|(i, j)| Point3::new(0.02 * i - 2.0, 0.02 * j - 1.0, 5.0))
            .collect();
        let views: Vec<&View> = photos.iter().map(|(view, _)| view).collect();
        let pixel_m = pixel(&points, &views).unwrap();
        let scale = Scale {
            pixel_m,
            cell_m: 3.0 * pixel_m,
        };
        let seen: Vec<Seen> = photos
            .iter()
            .map(|(view, photo)| seen(&points, view, photo, scale).unwrap())
            .collect();
        judge(&likenesses(&seen))
    }

    #[test]
    fn exchanged_and_turned_photos_are_found_among_others() {
        let sound: Vec<_> = (0..5).map(|i| photo(i, 0.3 * f64::from(i) - 0.6)).collect();
        assert_eq!(judged(&sound), Judgement::Sound);
        let mut exchanged = sound.clone();
        (exchanged[0].1, exchanged[1].1) = (sound[1].1.clone(), sound[0].1.clone());
        assert_eq!(judged(&exchanged), Judgement::Outliers(vec![0, 1]));
        let mut turned = sound.clone();
        let pixels = sound[3].1.data().iter().rev().copied().collect();
        turned[3].1 = Raster::from_vec(400, 300, pixels).unwrap();
        assert_eq!(judged(&turned), Judgement::Outliers(vec![3]));
        assert_eq!(judged(&exchanged[..2]), Judgement::AllUnlike);
    }

    #[test]
    fn photos_of_different_places_are_not_compared() {
        let apart = [photo(0, -2.5), photo(1, 2.5)];
        assert_eq!(judged(&apart), Judgement::Sound);
    }

    #[test]
    fn one_colour_is_flat_and_a_wall_is_not() {
        let (view, wall) = photo(0, 0.0);
        let points: Vec<Point3<f64>> = (0..100)
            .map(|i| Point3::new(0.01 * f64::from(i), 0.0, 5.0))
            .collect();
        let scale = Scale {
            pixel_m: 0.02,
            cell_m: 0.06,
        };
        let grey = Raster::filled(400, 300, [118; 3]);
        assert!(seen(&points, &view, &grey, scale).unwrap().is_flat);
        assert!(!seen(&points, &view, &wall, scale).unwrap().is_flat);
    }
}
