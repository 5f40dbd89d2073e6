//! OpenSfM's reconstruction.json.
//!
//! Poses take world to camera, rotation as angle times axis. Focal lengths and principal points are in units
//! of the longer image side, the principal point counted from the image centre (OpenSfM documentation,
//! "Coordinate Systems").

use super::{CameraError, CameraFile, Remark, malformed, read_text};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, Rigid3, View};
use stonewise_core::id::ImageId;

#[derive(Deserialize)]
struct Reconstruction {
    cameras: BTreeMap<String, RawCamera>,
    shots: BTreeMap<String, Shot>,
}

#[derive(Deserialize)]
struct RawCamera {
    projection_type: String,
    width: u32,
    height: u32,
    #[serde(flatten)]
    other: BTreeMap<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct Shot {
    rotation: [f64; 3],
    translation: [f64; 3],
    camera: String,
}

/// Reads the reconstruction with most photos; views come sorted by name, as the order in JSON objects means
/// nothing.
pub fn read(path: &Path) -> Result<CameraFile, CameraError> {
    let text = read_text(path)?;
    let parts: Vec<Reconstruction> = serde_json::from_str(&text).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        malformed(path, place, format!("not an OpenSfM reconstruction ({e})"))
    })?;
    let mut file = CameraFile::default();
    let largest = (0..parts.len()).max_by_key(|&i| (parts[i].shots.len(), std::cmp::Reverse(i)));
    for (index, part) in parts.iter().enumerate() {
        if Some(index) == largest {
            read_part(part, path, &mut file)?;
        } else {
            let names = part
                .shots
                .keys()
                .map(|name| (name.clone(), Remark::SmallerReconstruction));
            file.skipped.extend(names);
        }
    }
    if parts.len() > 1 {
        file.warnings.push(Remark::SeveralReconstructions(parts.len()));
    }
    Ok(file)
}

fn read_part(part: &Reconstruction, path: &Path, file: &mut CameraFile) -> Result<(), CameraError> {
    for (name, shot) in &part.shots {
        let raw = part.cameras.get(&shot.camera).ok_or_else(|| {
            let problem = format!("camera {:?} is not listed", shot.camera);
            malformed(path, format!("shot {name}"), problem)
        })?;
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            name: name.clone(),
            camera: camera(raw, &shot.camera, name, path)?,
            cam_from_world: Rigid3::from_parts(
                Translation3::from(shot.translation),
                UnitQuaternion::from_scaled_axis(Vector3::from(shot.rotation)),
            ),
        });
    }
    Ok(())
}

fn camera(raw: &RawCamera, id: &str, photo: &str, path: &Path) -> Result<Camera, CameraError> {
    let number = |name: &str| raw.other.get(name).and_then(serde_json::Value::as_f64);
    let or_zero = |name: &str| number(name).unwrap_or(0.0);
    let [k1, k2, k3, k4] = ["k1", "k2", "k3", "k4"].map(or_zero);
    let tangential = ["p1", "p2"].map(or_zero);
    let brown = |radial, tangential| Distortion::brown(radial, [0.0; 3], tangential);
    let distortion = match raw.projection_type.as_str() {
        "perspective" | "radial" => brown([k1, k2, 0.0, 0.0], [0.0; 2]),
        "simple_radial" => brown([k1, 0.0, 0.0, 0.0], [0.0; 2]),
        "brown" => brown([k1, k2, k3, 0.0], tangential),
        "fisheye" => Distortion::fisheye([k1, k2, 0.0, 0.0], [0.0; 2]),
        "fisheye_opencv" => Distortion::fisheye([k1, k2, k3, k4], [0.0; 2]),
        other => {
            return Err(CameraError::UnsupportedModel {
                path: path.to_owned(),
                model: other.to_owned(),
                photo: photo.to_owned(),
            });
        }
    };

    let fx = number("focal_x").or_else(|| number("focal"));
    let fy = number("focal_y").or(fx);
    let (Some(fx), Some(fy)) = (fx.filter(|&f| f > 0.0), fy.filter(|&f| f > 0.0)) else {
        let problem = "a positive focal, or focal_x and focal_y, expected";
        return Err(malformed(path, format!("camera {id}"), problem));
    };
    let (width, height) = (f64::from(raw.width), f64::from(raw.height));

    if raw.width == 0 || raw.height == 0 {
        return Err(malformed(
            path,
            format!("camera {id}"),
            "width and height must be positive",
        ));
    }

    let unit = width.max(height);
    Ok(Camera {
        width: raw.width,
        height: raw.height,
        focal_px: [fx * unit, fy * unit],
        center_px: [
            width / 2.0 + or_zero("c_x") * unit,
            height / 2.0 + or_zero("c_y") * unit,
        ],
        skew_px: 0.0,
        distortion,
        near: None,
    })
}
