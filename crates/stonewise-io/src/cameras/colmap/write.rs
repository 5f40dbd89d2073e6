//! Writing of COLMAP's text files.

use super::super::CameraError;
use crate::atomic::write_atomically;
use std::fmt::Write as _;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, View};

/// Writes cameras.txt, images.txt and an empty points3D.txt into a folder, which is made if need be.
///
/// One camera per distinct interior orientation, in the simplest model that holds it exactly.
///
/// # Errors
/// A file cannot be written, or a camera has skew, an eighth-order radial term (Metashape's b2, k4) or a
/// fisheye with tangential terms, which COLMAP's models do not hold.
pub fn write_colmap(folder: &Path, views: &[View]) -> Result<(), CameraError> {
    let mut cameras: Vec<&Camera> = Vec::new();
    let mut camera_lines = String::from("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n");
    let mut image_lines =
        String::from("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then POINTS2D[] as (X Y POINT3D_ID)\n");

    for (index, view) in views.iter().enumerate() {
        let known = cameras.iter().position(|&c| *c == view.camera);
        let camera = match known {
            Some(camera) => camera,
            None => {
                cameras.push(&view.camera);
                let line = camera_line(&view.camera).map_err(|model| CameraError::UnsupportedModel {
                    path: folder.to_owned(),
                    model: model.to_owned(),
                    photo: view.name.clone(),
                })?;
                let _ = writeln!(camera_lines, "{} {line}", cameras.len());
                cameras.len() - 1
            }
        };
        let q = view.cam_from_world.rotation;
        let t = view.cam_from_world.translation;
        let _ = writeln!(
            image_lines,
            "{} {:.16e} {:.16e} {:.16e} {:.16e} {:.16e} {:.16e} {:.16e} {} {}\n",
            index + 1,
            q.w,
            q.i,
            q.j,
            q.k,
            t.x,
            t.y,
            t.z,
            camera + 1,
            view.name
        );
    }

    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        write_atomically(&path, |partial| std::fs::write(partial, text))
            .map_err(|source| CameraError::Write { path, source })
    };
    std::fs::create_dir_all(folder).map_err(|source| CameraError::Write {
        path: folder.to_owned(),
        source,
    })?;
    write("cameras.txt", &camera_lines)?;
    write("images.txt", &image_lines)?;
    write("points3D.txt", "# 3D point list (empty)\n")
}

/// "MODEL WIDTH HEIGHT PARAMS", or why no model fits.
fn camera_line(camera: &Camera) -> Result<String, &'static str> {
    if camera.skew_px != 0.0 {
        return Err("with skew (b2)");
    }
    let (model, terms) = match &camera.distortion {
        Distortion::None => ("PINHOLE", Vec::new()),
        Distortion::Brown(brown) => {
            let [k1, k2, k3, k4] = brown.radial();
            let [p1, p2] = brown.tangential();
            let rational = brown.rational();
            if k4 != 0.0 {
                return Err("with an eighth-order radial term (k4)");
            }
            if k3 == 0.0 && rational == [0.0; 3] {
                ("OPENCV", vec![k1, k2, p1, p2])
            } else {
                let [d1, d2, d3] = rational;
                ("FULL_OPENCV", vec![k1, k2, p1, p2, k3, d1, d2, d3])
            }
        }
        Distortion::Fisheye(brown) if brown.tangential() != [0.0; 2] => {
            return Err("fisheye with tangential terms (p1, p2)");
        }
        Distortion::Fisheye(brown) => ("OPENCV_FISHEYE", brown.radial().to_vec()),
    };

    let mut line = format!("{model} {} {}", camera.width, camera.height);
    for value in camera.focal_px.into_iter().chain(camera.center_px).chain(terms) {
        let _ = write!(line, " {value}");
    }
    Ok(line)
}
