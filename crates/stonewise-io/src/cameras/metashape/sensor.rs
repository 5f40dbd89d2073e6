//! Interior orientation of a Metashape sensor.

use super::super::{CameraError, malformed};
use super::numbers::{child_number, parse_numbers};
use crate::xml::Element;
use nalgebra::Vector3;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, NearPlane};

/// The property of a sensor that holds its near plane: the normal and the distance, metres.
pub(super) const NEAR_PLANE: &str = "near_plane";

/// The camera of a `<sensor>`: its adjusted calibration, else the initial one, else the nominal focal length.
///
/// With r the radius of (x, y) = (X/Z, Y/Z): x' = x (1 + k1 r^2 + .. + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y,
/// and y' likewise; u = w/2 + cx + x' f + x' b1 + y' b2, v = h/2 + cy + y' f. Metashape's p1 is OpenCV's p2
/// and the other way round.
pub fn camera(sensor: Element<'_>, photo: &str, path: &Path) -> Result<Camera, CameraError> {
    let of_class = |class: Option<&'static str>| {
        sensor
            .all("calibration")
            .find(move |c| c.attribute("class") == class)
    };
    let calibration = of_class(Some("adjusted"))
        .or_else(|| of_class(Some("initial")))
        .or_else(|| sensor.child("calibration"));
    let (width, height) = resolution(sensor, calibration, path)?;
    let Some(calibration) = calibration else {
        check_model(sensor, sensor.attribute("type"), photo, path)?;
        return Ok(Camera::pinhole(width, height, nominal_focal(sensor, path)?));
    };
    let model = calibration.attribute("type").or(sensor.attribute("type"));
    let is_fisheye = check_model(sensor, model, photo, path)?;
    let value = |name: &str| child_number(calibration, name, path).map(|v| v.unwrap_or(0.0));
    for name in ["fx", "fy", "p3", "p4"] {
        if value(name)? != 0.0 {
            let problem = format!(
                "coefficient {name} of old versions is not supported: export from Metashape 1.6 or newer"
            );
            return Err(malformed(path, calibration.place(), problem));
        }
    }
    let focal = match child_number(calibration, "f", path)? {
        Some(f) => f,
        None => nominal_focal(sensor, path)?,
    };
    if !(focal.is_finite() && focal > 0.0) {
        return Err(malformed(
            path,
            calibration.place(),
            "focal length f must be positive",
        ));
    }
    let radial = [value("k1")?, value("k2")?, value("k3")?, value("k4")?];
    let tangential = [value("p2")?, value("p1")?];
    Ok(Camera {
        width,
        height,
        focal_px: [focal + value("b1")?, focal],
        center_px: [
            f64::from(width) / 2.0 + value("cx")?,
            f64::from(height) / 2.0 + value("cy")?,
        ],
        skew_px: value("b2")?,
        distortion: if is_fisheye {
            Distortion::fisheye(radial, tangential)
        } else {
            Distortion::brown(radial, [0.0; 3], tangential)
        },
        near: near_plane(sensor, path)?,
    })
}

/// The near plane of a view of a cloud; cameras of photos have none.
fn near_plane(sensor: Element<'_>, path: &Path) -> Result<Option<NearPlane>, CameraError> {
    let found = property::<4>(sensor, NEAR_PLANE, path)?;
    Ok(found.map(|[x, y, z, distance_m]| NearPlane {
        normal: Vector3::new(x, y, z),
        distance_m,
    }))
}

/// The numbers of a property of a sensor.
fn property<const N: usize>(
    sensor: Element<'_>,
    name: &str,
    path: &Path,
) -> Result<Option<[f64; N]>, CameraError> {
    let element = sensor.all("property").find(|p| p.attribute("name") == Some(name));
    let Some(element) = element else {
        return Ok(None);
    };
    let text = element
        .attribute("value")
        .map_or_else(|| element.text(), str::to_owned);
    Ok(Some(parse_numbers::<N>(&text, element, path)?))
}

/// Whether the model is a fisheye; an error where it is neither that nor a frame camera.
fn check_model(
    sensor: Element<'_>,
    model: Option<&str>,
    photo: &str,
    path: &Path,
) -> Result<bool, CameraError> {
    match model.unwrap_or("frame") {
        "frame" => Ok(false),
        "fisheye" | "equidistant_fisheye" => Ok(true),
        other => Err(CameraError::UnsupportedModel {
            path: path.to_owned(),
            model: format!(
                "{other} (sensor {})",
                sensor.attribute("label").unwrap_or("without label")
            ),
            photo: photo.to_owned(),
        }),
    }
}

fn resolution(
    sensor: Element<'_>,
    calibration: Option<Element<'_>>,
    path: &Path,
) -> Result<(u32, u32), CameraError> {
    let read = |parent: Element<'_>| -> Result<Option<(u32, u32)>, CameraError> {
        let Some(element) = parent.child("resolution") else {
            return Ok(None);
        };
        let side = |name: &str| {
            let value = element.attribute(name).and_then(|v| v.parse::<u32>().ok());
            value.filter(|&v| v > 0).ok_or_else(|| {
                malformed(
                    path,
                    element.place(),
                    format!("{name} must be a positive whole number"),
                )
            })
        };
        Ok(Some((side("width")?, side("height")?)))
    };
    let own = read(sensor)?;
    let calibrated = calibration.map(read).transpose()?.flatten();
    match (own, calibrated) {
        (Some(a), Some(b)) if a != b => {
            let problem = format!(
                "sensor of {}x{} px has a calibration for {}x{} px",
                a.0, a.1, b.0, b.1
            );
            Err(malformed(path, sensor.place(), problem))
        }
        (Some(size), _) | (None, Some(size)) => Ok(size),
        (None, None) => Err(malformed(path, sensor.place(), "resolution is missing")),
    }
}

/// Focal length in pixels from the nominal one in millimetres.
fn nominal_focal(sensor: Element<'_>, path: &Path) -> Result<f64, CameraError> {
    let number = |name: &str| property::<1>(sensor, name, path);
    match (number("focal_length")?, number("pixel_width")?) {
        (Some([focal]), Some([pixel])) if focal > 0.0 && pixel > 0.0 => Ok(focal / pixel),
        _ => Err(malformed(
            path,
            sensor.place(),
            "neither a calibration with f nor focal_length and pixel_width",
        )),
    }
}
