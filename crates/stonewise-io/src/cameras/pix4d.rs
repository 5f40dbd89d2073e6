//! Pix4D's `PROJECT_calibrated_camera_parameters.txt`.
//!
//! A pixel is K times the distorted place of R (X - t), by the polynomial that OpenCV has too (Pix4D
//! documentation, "How are the internal and external camera parameters defined?"). Places are relative to the
//! offset that `PROJECT_offset.xyz` names.

use super::pose::{camera_at, rotation};
use super::{CameraError, CameraFile, malformed, read_text};
use nalgebra::{Matrix3, Point3, Vector3};
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, View};
use stonewise_core::id::ImageId;

/// The end of the file's name.
const NAME: &str = "calibrated_camera_parameters.txt";
const OFFSET_NAME: &str = "offset.xyz";
/// Numbers of a photo, line by line: camera matrix, radial and tangential terms, place, rotation.
const LINES: [usize; 9] = [3, 3, 3, 3, 2, 3, 3, 3, 3];

/// Whether a file is of this format, by its name.
pub fn is_pix4d(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.to_ascii_lowercase().ends_with(NAME)
}

/// Reads the file; views keep its order.
pub fn read(path: &Path) -> Result<CameraFile, CameraError> {
    let text = read_text(path)?;
    let offset = offset(path)?;
    let mut lines = (1..)
        .zip(text.lines().map(str::trim))
        .filter(|(_, line)| !line.is_empty());
    let mut file = CameraFile::default();

    while let Some((number, line)) = lines.next() {
        // The description of the format comes first.
        let Some((name, width, height)) = photo(line) else {
            if file.views.is_empty() {
                continue;
            }
            let problem = "expected the name of a photo, its width and height";
            return Err(malformed(path, format!("line {number}"), problem));
        };
        let mut values: Vec<f64> = Vec::with_capacity(26);
        for count in LINES {
            let Some((number, line)) = lines.next() else {
                let problem = "the file ends before all parameters of this photo";
                return Err(malformed(path, format!("photo {name}"), problem));
            };
            let numbers: Option<Vec<f64>> = line.split_ascii_whitespace().map(|w| w.parse().ok()).collect();
            let numbers = numbers.filter(|all| all.len() == count && all.iter().all(|v| v.is_finite()));
            let problem = || {
                malformed(
                    path,
                    format!("line {number}"),
                    format!("expected {count} numbers"),
                )
            };
            values.extend(numbers.ok_or_else(problem)?);
        }
        let view = view(file.views.len(), name, [width, height], &values, &offset);
        let problem = "its focal lengths must be positive, and its rotation a rotation";
        file.views
            .push(view.ok_or_else(|| malformed(path, format!("photo {name}"), problem))?);
    }

    Ok(file)
}

/// Name, width and height, if a line is of these.
fn photo(line: &str) -> Option<(&str, u32, u32)> {
    let (rest, height) = line.rsplit_once(char::is_whitespace)?;
    let (name, width) = rest.trim_end().rsplit_once(char::is_whitespace)?;
    let side = |text: &str| text.parse().ok().filter(|&side| side > 0);
    Some((name.trim_end(), side(width)?, side(height)?))
}

fn view(
    index: usize,
    name: &str,
    [width, height]: [u32; 2],
    values: &[f64],
    offset: &Vector3<f64>,
) -> Option<View> {
    let calibration = Matrix3::from_row_slice(values.get(..9)?);
    let [k1, k2, k3, p1, p2, x, y, z] = *values.get(9..17)?.first_chunk()?;
    let turn = Matrix3::from_row_slice(values.get(17..26)?);
    let focal_px = [calibration[(0, 0)], calibration[(1, 1)]];
    if focal_px.iter().any(|f| *f <= 0.0) {
        return None;
    }
    let centre = Point3::new(x, y, z) + offset;
    Some(View {
        image: ImageId(index as u32),
        name: name.to_owned(),
        camera: Camera {
            width,
            height,
            focal_px,
            center_px: [calibration[(0, 2)], calibration[(1, 2)]],
            skew_px: calibration[(0, 1)],
            distortion: Distortion::brown([k1, k2, k3, 0.0], [0.0; 3], [p1, p2]),
            near: None,
        },
        cam_from_world: camera_at(centre, &rotation(&turn)?),
    })
}

/// What was taken off the places; nothing where the file of it is not there.
fn offset(path: &Path) -> Result<Vector3<f64>, CameraError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let project = &name[..name.len() - NAME.len()];
    let beside = path.with_file_name(format!("{project}{OFFSET_NAME}"));
    if !beside.is_file() {
        return Ok(Vector3::zeros());
    }
    let text = read_text(&beside)?;
    let numbers: Option<Vec<f64>> = text.split_ascii_whitespace().map(|w| w.parse().ok()).collect();
    match numbers.as_deref() {
        Some([x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok(Vector3::new(*x, *y, *z)),
        _ => Err(malformed(
            &beside,
            "line 1",
            "expected three numbers, the offset of the project",
        )),
    }
}
