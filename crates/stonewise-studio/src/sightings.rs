//! Where the photos of an epoch show a stone.

use crate::place::Place;
use image::ImageFormat;
use image::imageops::FilterType;
use schemars::JsonSchema;
use serde::Serialize;
use std::io::Cursor;
use std::path::PathBuf;
use stonewise::results::StoneOutline;
use stonewise::{Epoch, Result};
use stonewise_core::geometry::View;

/// Longer edge of a piece of a photo, pixels.
const EDGE: u32 = 360;
/// Edges of a piece, in those of the stone in it.
const AROUND: f64 = 1.8;
/// A photo that looks along a face shows nothing of it: least cosine between the face's normal and the ray.
const LEAST_COSINE: f64 = 0.17;

/// A photo that shows a stone.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Sighting {
    /// File name of the photo.
    pub photo: String,
    /// The stone's outline in the first epoch, in shares of the width and the height of the piece.
    pub outline: Vec<[f64; 2]>,
    /// Width of the piece over its height.
    pub aspect: f64,
}

/// A piece of a photo: left, top, width and height, pixels.
type Piece = [u32; 4];

/// The photos of an epoch that show a stone whole, in the order of the camera file. Whether something stands in
/// front of it is not looked at.
///
/// # Errors
/// The cameras or the folder of the photos cannot be read.
pub fn sightings(epoch: &Epoch, stone: &StoneOutline, place: &Place) -> Result<Vec<Sighting>> {
    let found = pieces(epoch, stone, place)?;
    Ok(found.into_iter().map(|(sighting, ..)| sighting).collect())
}

/// The piece of the photo with this place in the list of [`sightings`], as JPEG; `None` where there is none.
///
/// # Errors
/// As [`sightings`].
pub fn sighting(
    epoch: &Epoch,
    stone: &StoneOutline,
    place: &Place,
    number: usize,
) -> Result<Option<Vec<u8>>> {
    let found = pieces(epoch, stone, place)?;
    Ok(found
        .into_iter()
        .nth(number)
        .and_then(|(_, path, piece)| jpeg(path, piece)))
}

fn pieces(epoch: &Epoch, stone: &StoneOutline, place: &Place) -> Result<Vec<(Sighting, PathBuf, Piece)>> {
    let photos = epoch.posed_photos()?;
    let confined = photos.into_iter().filter(|(_, path)| place.holds(path));
    Ok(confined
        .filter_map(|(view, path)| {
            let (piece, outline) = piece(&view, stone)?;
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let sighting = Sighting {
                photo: name,
                outline,
                aspect: f64::from(piece[2]) / f64::from(piece[3]),
            };
            Some((sighting, path, piece))
        })
        .collect())
}

/// The piece of a photo around a stone that it shows whole, and the outline in it.
fn piece(view: &View, stone: &StoneOutline) -> Option<(Piece, Vec<[f64; 2]>)> {
    let ray = view.centre() - stone.ring.first()?;
    if ray.normalize().dot(&stone.normal) < LEAST_COSINE {
        return None;
    }
    let pixel = |p| view.project(p).map(|p| p.pixel).filter(|p| view.is_inside(*p));
    let ring: Vec<[f64; 2]> = stone.ring.iter().map(pixel).collect::<Option<_>>()?;
    let (width, height) = (view.camera.width, view.camera.height);
    let span = |axis: usize, size: u32| {
        let low = ring.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        let high = ring.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        let margin = (high - low) * (AROUND - 1.0) / 2.0;
        let first = (low - margin).floor().max(0.0);
        let last = (high + margin).ceil().min(f64::from(size));
        (last - first >= 1.0).then_some([first, last - first])
    };
    let ([left, wide], [top, high]) = (span(0, width)?, span(1, height)?);
    let outline = ring.iter().map(|[x, y]| [(x - left) / wide, (y - top) / high]);
    Some(([left, top, wide, high].map(|edge| edge as u32), outline.collect()))
}

fn jpeg(path: PathBuf, [left, top, width, height]: Piece) -> Option<Vec<u8>> {
    let photo = image::open(path).ok()?;
    let piece = photo.crop_imm(left, top, width, height);
    let small = match width.max(height) > EDGE {
        true => piece.resize(EDGE, EDGE, FilterType::Triangle),
        false => piece,
    };
    let mut jpeg = Cursor::new(Vec::new());
    small.to_rgb8().write_to(&mut jpeg, ImageFormat::Jpeg).ok()?;
    Some(jpeg.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise::nalgebra::{Point3, Vector3};
    use stonewise_core::geometry::{Camera, Rigid3};
    use stonewise_core::id::ImageId;

    /// A square of 20 cm at this place, 5 m before the camera.
    fn square(x: f64, y: f64) -> StoneOutline {
        let corner = |[right, down]: [f64; 2]| Point3::new(x + 0.1 * right, y + 0.1 * down, 5.0);
        StoneOutline {
            stone_id: 1,
            normal: -Vector3::z(),
            ring: [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]
                .map(corner)
                .into(),
        }
    }

    #[test]
    fn a_photo_shows_a_stone_where_a_pinhole_camera_does() {
        let view = View {
            image: ImageId(0),
            name: String::new(),
            camera: Camera::pinhole(1000, 800, 1000.0),
            cam_from_world: Rigid3::identity(),
        };
        // 40 pixels wide about (600, 400), with 16 pixels on each side.
        let (found, outline) = piece(&view, &square(0.5, 0.0)).unwrap();
        assert_eq!(found, [564, 364, 72, 72]);
        let expected = [[16.0, 56.0], [56.0, 56.0], [56.0, 16.0], [16.0, 16.0]];
        for (at, expected) in outline.iter().zip(expected) {
            for axis in 0..2 {
                assert!((72.0 * at[axis] - expected[axis]).abs() < 1e-9, "{outline:?}");
            }
        }
        // At the border of the photo the piece ends with it; a stone that is cut off is not shown.
        assert_eq!(piece(&view, &square(2.375, 0.0)).unwrap().0, [939, 364, 61, 72]);
        assert_eq!(piece(&view, &square(2.45, 0.0)), None);
        // Faces that look away, or along the ray, are not seen.
        for normal in [Vector3::z(), Vector3::x()] {
            let away = StoneOutline {
                normal,
                ..square(0.0, 0.0)
            };
            assert_eq!(piece(&view, &away), None);
        }
    }
}
