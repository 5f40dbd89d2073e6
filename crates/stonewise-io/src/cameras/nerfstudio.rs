//! `transforms.json` of nerfstudio and instant-ngp.
//!
//! Poses take camera to world, in the axes of OpenGL: x right, y up, z against the view. What nerfstudio did to
//! the world (`applied_transform`) is undone, so that cameras come back to the frame of the model they were
//! made from (nerfstudio documentation, "Data conventions").

use super::pose::{FLIP, camera_at, rotation};
use super::{CameraError, CameraFile, malformed, read_text};
use nalgebra::{Matrix3, Matrix4, Point3};
use serde::Deserialize;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, Rigid3, View};
use stonewise_core::id::ImageId;

#[derive(Deserialize)]
struct Transforms {
    #[serde(flatten)]
    shared: RawCamera,
    applied_transform: Option<Vec<Vec<f64>>>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    own: RawCamera,
}

/// The camera of all photos, or of one.
#[derive(Default, Deserialize)]
struct RawCamera {
    camera_model: Option<String>,
    camera_angle_x: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// Whether a JSON text is an object with frames.
pub fn is_transforms(text: &str) -> bool {
    text.trim_start().starts_with('{') && text.contains("\"transform_matrix\"")
}

/// Reads the file; views keep its order.
pub fn read(path: &Path) -> Result<CameraFile, CameraError> {
    let transforms: Transforms = serde_json::from_str(&read_text(path)?).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        malformed(path, place, format!("not a transforms.json ({e})"))
    })?;
    let bad = |place: &str, problem: &str| malformed(path, place, problem);
    let applied = match &transforms.applied_transform {
        Some(rows) => {
            matrix(rows).ok_or_else(|| bad("applied_transform", "expected 3 or 4 rows of 4 numbers"))?
        }
        None => Matrix4::identity(),
    };
    let undo = applied
        .try_inverse()
        .ok_or_else(|| bad("applied_transform", "the matrix has no inverse"))?;

    let mut file = CameraFile::default();
    for frame in &transforms.frames {
        let place = format!("frame {}", frame.file_path);
        let pose = matrix(&frame.transform_matrix)
            .ok_or_else(|| bad(&place, "transform_matrix needs 4 rows of 4 numbers"))?;
        let world_from_cam = undo * pose;
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            name: frame.file_path.trim_start_matches("./").to_owned(),
            camera: camera(frame, &transforms.shared, path)?,
            cam_from_world: pose_of(&world_from_cam)
                .ok_or_else(|| bad(&place, "transform_matrix holds no rotation"))?,
        });
    }

    Ok(file)
}

fn matrix(rows: &[Vec<f64>]) -> Option<Matrix4<f64>> {
    let is_sound = |row: &Vec<f64>| row.len() == 4 && row.iter().all(|v| v.is_finite());
    if !(3..=4).contains(&rows.len()) || !rows.iter().all(is_sound) {
        return None;
    }
    let mut matrix = Matrix4::identity();
    for (r, row) in rows.iter().take(3).enumerate() {
        for (c, value) in row.iter().enumerate() {
            matrix[(r, c)] = *value;
        }
    }
    Some(matrix)
}

/// World to camera with y down and z along the view; `None` where the matrix is no rigid motion.
fn pose_of(world_from_cam: &Matrix4<f64>) -> Option<Rigid3> {
    let turn: Matrix3<f64> = world_from_cam.fixed_view::<3, 3>(0, 0).into_owned();
    let centre = Point3::from(world_from_cam.fixed_view::<3, 1>(0, 3).into_owned());
    Some(camera_at(centre, &rotation(&(FLIP * turn.transpose()))?))
}

fn camera(frame: &Frame, shared: &RawCamera, path: &Path) -> Result<Camera, CameraError> {
    let photo = &frame.file_path;
    let of =
        |value: fn(&RawCamera) -> Option<f64>| value(&frame.own).or(value(shared)).filter(|v| v.is_finite());
    let or_zero = |value: fn(&RawCamera) -> Option<f64>| of(value).unwrap_or(0.0);

    let needed = |value: fn(&RawCamera) -> Option<f64>, name: &str| {
        of(value).filter(|v| *v > 0.0).ok_or_else(|| {
            malformed(
                path,
                format!("frame {photo}"),
                format!("a positive {name} is missing"),
            )
        })
    };

    let (width, height) = (needed(|c| c.w, "w")?, needed(|c| c.h, "h")?);
    if width.max(height) > f64::from(u32::MAX) {
        let problem = format!("impossible image size {width}x{height}");
        return Err(malformed(path, format!("frame {photo}"), problem));
    }

    let by_angle = of(|c| c.camera_angle_x).map(|angle| width / 2.0 / (angle / 2.0).tan());
    let fx = match by_angle {
        Some(focal) if of(|c| c.fl_x).is_none() && focal > 0.0 => focal,
        _ => needed(|c| c.fl_x, "fl_x")?,
    };
    let radial = [
        or_zero(|c| c.k1),
        or_zero(|c| c.k2),
        or_zero(|c| c.k3),
        or_zero(|c| c.k4),
    ];
    let tangential = [or_zero(|c| c.p1), or_zero(|c| c.p2)];
    let model = frame.own.camera_model.as_ref().or(shared.camera_model.as_ref());
    let [k1, k2, k3, _] = radial;

    let distortion = match model.map(String::as_str) {
        None | Some("OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL") => {
            Distortion::brown([k1, k2, k3, 0.0], [0.0; 3], tangential)
        }
        Some("OPENCV_FISHEYE") => Distortion::fisheye(radial, [0.0; 2]),
        Some(other) => {
            return Err(CameraError::UnsupportedModel {
                path: path.to_owned(),
                model: other.to_owned(),
                photo: photo.clone(),
            });
        }
    };

    Ok(Camera {
        width: width as u32,
        height: height as u32,
        focal_px: [fx, of(|c| c.fl_y).filter(|f| *f > 0.0).unwrap_or(fx)],
        center_px: [
            of(|c| c.cx).unwrap_or(width / 2.0),
            of(|c| c.cy).unwrap_or(height / 2.0),
        ],
        skew_px: 0.0,
        distortion,
        near: None,
    })
}
