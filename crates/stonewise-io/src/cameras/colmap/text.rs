//! COLMAP's text files.

use super::super::{CameraError, malformed, read_text};
use super::raw::{RawCamera, RawImage};
use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

/// cameras.txt: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[].
pub fn read_cameras(path: &Path) -> Result<BTreeMap<u32, RawCamera>, CameraError> {
    let text = read_text(path)?;
    let mut cameras = BTreeMap::new();
    for (number, line) in content_lines(&text) {
        let mut words = line.split_whitespace();
        let place = format!("line {number}");
        let id: u32 = word(&mut words, "camera id", &place, path)?;
        let model: String = word(&mut words, "model", &place, path)?;
        let width = word(&mut words, "width", &place, path)?;
        let height = word(&mut words, "height", &place, path)?;
        let mut params = Vec::new();
        for value in words {
            params.push(word(&mut std::iter::once(value), "parameter", &place, path)?);
        }
        cameras.insert(
            id,
            RawCamera {
                model,
                width,
                height,
                params,
                place,
            },
        );
    }
    Ok(cameras)
}

/// images.txt: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, each followed by a line of image points, which
/// may be empty.
pub fn read_images(path: &Path) -> Result<Vec<RawImage>, CameraError> {
    let text = read_text(path)?;
    let mut images = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((index, line)) = lines.next() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        images.push(image(line, format!("line {}", index + 1), path)?);
        if let Some((index, points)) = lines.next() {
            check_points(points, index + 1, path)?;
        }
    }
    Ok(images)
}

fn image(line: &str, place: String, path: &Path) -> Result<RawImage, CameraError> {
    let mut words = line.split_whitespace();
    let _id: u32 = word(&mut words, "image id", &place, path)?;
    let mut numbers = [0.0; 7];
    for number in &mut numbers {
        *number = word(&mut words, "rotation and translation", &place, path)?;
    }
    let [w, x, y, z, tx, ty, tz] = numbers;
    let camera_id = word(&mut words, "camera id", &place, path)?;
    // A name may contain spaces.
    let name = words.collect::<Vec<_>>().join(" ");
    if name.is_empty() {
        return Err(malformed(path, place, "photo name expected"));
    }
    Ok(RawImage {
        rotation_wxyz: [w, x, y, z],
        translation: [tx, ty, tz],
        camera_id,
        name,
        place,
    })
}

/// A file without the lines of image points would lose every second photo: refuse it.
fn check_points(line: &str, number: usize, path: &Path) -> Result<(), CameraError> {
    let mut words = line.split_whitespace();
    let is_valid = words.clone().count().is_multiple_of(3) && words.all(|w| w.parse::<f64>().is_ok());
    if is_valid {
        Ok(())
    } else {
        let problem = "a line of image points (X Y POINT3D_ID ..., or empty) must follow each photo";
        Err(malformed(path, format!("line {number}"), problem))
    }
}

fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn word<'a, T: FromStr>(
    words: &mut impl Iterator<Item = &'a str>,
    what: &str,
    place: &str,
    path: &Path,
) -> Result<T, CameraError> {
    let found = words.next().unwrap_or("the end of the line");
    found
        .parse()
        .map_err(|_| malformed(path, place, format!("{what} expected, found {found}")))
}
