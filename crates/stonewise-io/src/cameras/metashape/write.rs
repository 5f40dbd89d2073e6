//! Writing of Metashape's camera XML.

use super::super::CameraError;
use super::sensor::NEAR_PLANE;
use crate::atomic::write_atomically;
use crate::xml::escape;
use std::fmt::Write as _;
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, NearPlane, View};

/// Writes views as a chunk in local coordinates whose frame is the world, one sensor per distinct camera.
///
/// `crs`: WKT of a Cartesian system; without one, Metashape's local coordinates in metres. Numbers carry 17
/// significant digits, so that poses come back as they were.
///
/// # Errors
/// The file cannot be written, or a camera has denominator terms, which the format does not have.
pub fn write_metashape(path: &Path, views: &[View], crs: Option<&str>) -> Result<(), CameraError> {
    let mut sensors: Vec<&Camera> = Vec::new();
    let mut cameras = String::new();
    for (id, view) in views.iter().enumerate() {
        let sensor = sensors
            .iter()
            .position(|&c| *c == view.camera)
            .unwrap_or_else(|| {
                sensors.push(&view.camera);
                sensors.len() - 1
            });
        let matrix = view.cam_from_world.inverse().to_homogeneous();
        let numbers: Vec<String> = matrix.transpose().iter().map(|v| format!("{v:.16e}")).collect();
        let _ = writeln!(
            cameras,
            "      <camera id=\"{id}\" sensor_id=\"{sensor}\" component_id=\"0\" label=\"{}\">\n        \
             <transform>{}</transform>\n        <orientation>1</orientation>\n      </camera>",
            escape(&view.name),
            numbers.join(" "),
        );
    }

    let mut text = String::from(concat!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\">\n",
        "  <chunk label=\"Chunk 1\" enabled=\"true\">\n",
    ));
    let _ = writeln!(text, "    <sensors next_id=\"{}\">", sensors.len());
    for (id, camera) in sensors.iter().enumerate() {
        text.push_str(&sensor(id, camera, path)?);
    }
    text.push_str(concat!(
        "    </sensors>\n    <components next_id=\"1\" active_id=\"0\">\n",
        "      <component id=\"0\" label=\"Component 1\">\n        <transform>\n",
        "          <rotation locked=\"false\">1 0 0 0 1 0 0 0 1</rotation>\n",
        "          <translation locked=\"false\">0 0 0</translation>\n",
        "          <scale locked=\"false\">1</scale>\n        </transform>\n      </component>\n    </components>\n",
    ));

    let _ = writeln!(
        text,
        "    <cameras next_id=\"{}\" next_group_id=\"0\">",
        views.len()
    );
    text.push_str(&cameras);
    let crs = escape(crs.unwrap_or(LOCAL_CS));
    let _ = writeln!(
        text,
        "    </cameras>\n    <reference>{crs}</reference>\n  </chunk>\n</document>"
    );

    write_atomically(path, |partial| std::fs::write(partial, text)).map_err(|source| CameraError::Write {
        path: path.to_owned(),
        source,
    })
}

const LOCAL_CS: &str = r#"LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1,AUTHORITY["EPSG","9001"]]]"#;

fn sensor(id: usize, camera: &Camera, path: &Path) -> Result<String, CameraError> {
    let (kind, radial, tangential) = match &camera.distortion {
        Distortion::None => ("frame", [0.0; 4], [0.0; 2]),
        Distortion::Brown(brown) if brown.rational() != [0.0; 3] => {
            return Err(CameraError::UnsupportedModel {
                path: path.to_owned(),
                model: "FULL_OPENCV with k4, k5, k6".to_owned(),
                photo: format!("of sensor {id}"),
            });
        }
        Distortion::Brown(brown) => ("frame", brown.radial(), brown.tangential()),
        Distortion::Fisheye(brown) => ("fisheye", brown.radial(), brown.tangential()),
    };
    let [fx, fy] = camera.focal_px;
    let size = [f64::from(camera.width), f64::from(camera.height)];

    let values = [
        ("f", fy),
        ("cx", camera.center_px[0] - size[0] / 2.0),
        ("cy", camera.center_px[1] - size[1] / 2.0),
        ("b1", fx - fy),
        ("b2", camera.skew_px),
        ("k1", radial[0]),
        ("k2", radial[1]),
        ("k3", radial[2]),
        ("k4", radial[3]),
        ("p1", tangential[1]),
        ("p2", tangential[0]),
    ];
    let resolution = format!(
        "<resolution width=\"{}\" height=\"{}\"/>",
        camera.width, camera.height
    );

    let mut text = format!(
        "      <sensor id=\"{id}\" label=\"sensor {id}\" type=\"{kind}\">\n        {resolution}\n        \
         <calibration type=\"{kind}\" class=\"adjusted\">\n          {resolution}\n"
    );

    for (name, value) in values {
        if value != 0.0 {
            let _ = writeln!(text, "          <{name}>{value:.16e}</{name}>");
        }
    }

    text.push_str("        </calibration>\n");
    if let Some(NearPlane { normal, distance_m }) = &camera.near {
        let [x, y, z] = [normal.x, normal.y, normal.z].map(|v| format!("{v:.16e}"));
        let _ = writeln!(
            text,
            "        <property name=\"{NEAR_PLANE}\" value=\"{x} {y} {z} {distance_m:.16e}\"/>"
        );
    }

    text.push_str("      </sensor>\n");
    Ok(text)
}
