//! What the files of a project hold, as far as it is read.

use serde::{Deserialize, Deserializer, de};

/// A list of exactly so many numbers.
#[derive(Clone, Copy)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Self, D::Error> {
        let values = Vec::<f64>::deserialize(json)?;
        let wrong = |values: Vec<f64>| format!("expected {N} numbers, found {}", values.len());
        let values = values
            .try_into()
            .map_err(|values| de::Error::custom(wrong(values)))?;
        Ok(Self(values))
    }
}

/// The photos of all cameras.
#[derive(Deserialize)]
pub struct CameraList {
    pub cameras: Vec<Photo>,
}

/// The photo of a camera.
#[derive(Deserialize)]
pub struct Photo {
    pub id: u64,
    pub uri: String,
}

/// What was known before the calibration.
#[derive(Deserialize)]
pub struct InputCameras {
    pub captures: Vec<Capture>,
    pub sensors: Vec<InputSensor>,
}

#[derive(Deserialize)]
pub struct Capture {
    pub cameras: Vec<InputCamera>,
}

#[derive(Deserialize)]
pub struct InputCamera {
    pub id: u64,
}

#[derive(Deserialize)]
pub struct InputSensor {
    pub id: u64,
    /// Width and height.
    pub image_size_px: Numbers<2>,
    pub shutter_type: String,
}

/// What the calibration found.
#[derive(Deserialize)]
pub struct CalibratedCameras {
    pub cameras: Vec<CalibratedCamera>,
    pub sensors: Vec<CalibratedSensor>,
}

#[derive(Deserialize)]
pub struct CalibratedCamera {
    pub id: u64,
    pub sensor_id: u64,
    /// Omega, phi and kappa.
    pub orientation_deg: Numbers<3>,
    /// In the translated canonical frame.
    pub position: Numbers<3>,
    pub rolling_shutter: Option<Numbers<3>>,
}

#[derive(Deserialize)]
pub struct CalibratedSensor {
    pub id: u64,
    pub internals: Internals,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Internals {
    Perspective(Perspective),
    Fisheye {},
    Spherical {},
}

#[derive(Deserialize)]
pub struct Perspective {
    pub principal_point_px: Numbers<2>,
    pub focal_length_px: f64,
    pub radial_distortion: Numbers<3>,
    pub tangential_distortion: Numbers<2>,
}

/// The coordinate system of the scene, and the way from it to the frame of positions.
#[derive(Deserialize)]
pub struct SceneReferenceFrame {
    pub crs: Crs,
    pub base_to_canonical: BaseToCanonical,
}

#[derive(Deserialize)]
pub struct Crs {
    /// WKT 2, or codes of authorities.
    pub definition: String,
}

#[derive(Deserialize)]
pub struct BaseToCanonical {
    /// Of each axis of the base system; applied first.
    pub scale: Numbers<3>,
    /// In the translated canonical frame; applied last.
    pub shift: Numbers<3>,
}
