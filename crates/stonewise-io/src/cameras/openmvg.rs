//! OpenMVG's `sfm_data.json`.
//!
//! Poses are a rotation from world to camera and the place of the camera; lenses have the polynomials that
//! OpenCV has too (OpenMVG documentation, "cameras" and "sfm").

use super::pose::{camera_at, rotation};
use super::{CameraError, CameraFile, Remark, malformed, read_text};
use nalgebra::{Matrix3, Point3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, Rigid3, View};
use stonewise_core::id::ImageId;

/// Whether a JSON text is of this format.
pub fn is_openmvg(text: &str) -> bool {
    text.contains("\"sfm_data_version\"")
}

/// Reads the file; views keep its order, and those without a pose or a camera are skipped.
pub fn read(path: &Path) -> Result<CameraFile, CameraError> {
    let all: Value = serde_json::from_str(&read_text(path)?).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        malformed(path, place, format!("not an sfm_data.json ({e})"))
    })?;
    let intrinsics = by_key(&all["intrinsics"]);
    let poses = by_key(&all["extrinsics"]);
    let mut file = CameraFile::default();
    for (_, view) in by_key(&all["views"]) {
        let view = data(view);
        let of = |name: &str| view[name].as_u64();
        let name = view["filename"].as_str().unwrap_or_default().to_owned();
        let place = format!("view {name}");
        let pose = of("id_pose").and_then(|id| poses.get(&id));
        let intrinsic = of("id_intrinsic").and_then(|id| intrinsics.get(&id));
        let (Some(pose), Some(intrinsic)) = (pose, intrinsic) else {
            file.skipped.push((name, Remark::NotAligned));
            continue;
        };
        let bad = |problem: &str| malformed(path, place.clone(), problem);
        let pose = pose_of(pose).ok_or_else(|| bad("its pose needs a rotation of 3 x 3 and a center"))?;
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            camera: camera(data(intrinsic), &name, path)?,
            name,
            cam_from_world: pose,
        });
    }
    Ok(file)
}

/// The values of a list of keys and values, by their keys.
fn by_key(list: &Value) -> BTreeMap<u64, &Value> {
    let pairs = list.as_array().into_iter().flatten();
    pairs
        .filter_map(|pair| Some((pair["key"].as_u64()?, &pair["value"])))
        .collect()
}

/// What a pointer points at.
fn data(value: &Value) -> &Value {
    &value["ptr_wrapper"]["data"]
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let values: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    values?.try_into().ok()
}

fn pose_of(value: &Value) -> Option<Rigid3> {
    let rows = value["rotation"].as_array()?;
    let rows: Option<Vec<[f64; 3]>> = rows.iter().map(numbers).collect();
    let rows: [[f64; 3]; 3] = rows?.try_into().ok()?;
    let turn = Matrix3::from_row_slice(rows.as_flattened());
    let centre = Point3::from(numbers::<3>(&value["center"])?);
    Some(camera_at(centre, &rotation(&turn)?))
}

/// A camera whose lens the names of its parameters tell; older files hold everything in one object.
fn camera(value: &Value, photo: &str, path: &Path) -> Result<Camera, CameraError> {
    let base = if value["value0"].is_object() {
        &value["value0"]
    } else {
        value
    };
    let bad = |problem: &str| malformed(path, format!("camera of view {photo}"), problem);
    let side = |name: &str| {
        base[name]
            .as_u64()
            .and_then(|s| u32::try_from(s).ok())
            .filter(|&s| s > 0)
    };
    let (Some(width), Some(height)) = (side("width"), side("height")) else {
        return Err(bad("a positive width and height are missing"));
    };
    let focal = base["focal_length"].as_f64().filter(|f| *f > 0.0);
    let focal = focal.ok_or_else(|| bad("a positive focal_length is missing"))?;
    let center_px =
        numbers(&base["principal_point"]).ok_or_else(|| bad("principal_point needs 2 numbers"))?;
    let brown = |radial, tangential| Distortion::brown(radial, [0.0; 3], tangential);
    let of_lens = |name: &str| value.get(name);
    let distortion = if let Some(lens) = of_lens("disto_k1") {
        numbers(lens).map(|[k1]| brown([k1, 0.0, 0.0, 0.0], [0.0; 2]))
    } else if let Some(lens) = of_lens("disto_k3") {
        numbers(lens).map(|[k1, k2, k3]| brown([k1, k2, k3, 0.0], [0.0; 2]))
    } else if let Some(lens) = of_lens("disto_t2") {
        numbers(lens).map(|[k1, k2, k3, p1, p2]| brown([k1, k2, k3, 0.0], [p1, p2]))
    } else if let Some(lens) = of_lens("fisheye") {
        numbers(lens).map(|radial| Distortion::fisheye(radial, [0.0; 2]))
    } else {
        Some(Distortion::None)
    };
    Ok(Camera {
        width,
        height,
        focal_px: [focal; 2],
        center_px,
        skew_px: 0.0,
        distortion: distortion.ok_or_else(|| bad("its lens has a wrong number of parameters"))?,
        near: None,
    })
}
