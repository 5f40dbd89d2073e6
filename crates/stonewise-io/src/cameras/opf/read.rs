//! Joins the parts of a project to posed photos.

use super::super::pose::{FLIP, camera_at};
use super::super::{CameraError, CameraFile, Remark, malformed};
use super::frame::Frame;
use super::parts::{
    CalibratedCamera, CalibratedCameras, CalibratedSensor, CameraList, InputCameras, InputSensor, Internals,
    Perspective,
};
use super::project::{Item, Loaded, Project};
use super::uri::path_and_fragment;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use stonewise_core::geometry::{Camera, Distortion, View};
use stonewise_core::id::ImageId;

/// The only page of a photo that is read; pages count from 0.
const FIRST_PAGE: &str = "page=0";

/// Reads the calibration with the most cameras; views keep its order.
pub fn read(path: &Path) -> Result<CameraFile, CameraError> {
    let project = Project::open(path)?;
    let mut calibrations: Vec<(&Item, Loaded<CalibratedCameras>)> = Vec::new();
    for item in project.items.iter().filter(|item| item.kind == "calibration") {
        let files = project.load(item, "calibrated-cameras")?;
        calibrations.extend(files.into_iter().map(|file| (item, file)));
    }
    let size = |(index, (_, file)): &(usize, &(_, Loaded<CalibratedCameras>))| {
        (file.content.cameras.len(), Reverse(*index))
    };
    let Some((_, (item, calibration))) = calibrations.iter().enumerate().max_by_key(size) else {
        return Err(project.lacks("calibration"));
    };

    let frame = Frame::of(&project, item)?;
    let lists = project.load_all::<CameraList>("camera_list", "camera-list")?;
    let inputs = project.load_all::<InputCameras>("input_cameras", "input-cameras")?;
    let photos = lists.iter().flat_map(|list| &list.content.cameras);
    let parts = Parts {
        calibration,
        photos: photos.map(|photo| (photo.id, photo.uri.as_str())).collect(),
        input_sensors: by_id(inputs.iter().flat_map(|file| &file.content.sensors), |sensor| {
            sensor.id
        }),
        sensors: by_id(&calibration.content.sensors, |sensor| sensor.id),
        inputs: &inputs,
    };

    let mut file = CameraFile {
        crs: frame.crs.clone(),
        ..CameraFile::default()
    };
    for camera in &calibration.content.cameras {
        let (name, page) = parts.photo(camera)?;
        if let Some(page) = page.filter(|page| *page != FIRST_PAGE) {
            let reason = format!("{page} of its file, of which only the first page is read");
            file.skipped.push((name, Remark::NotPlaced(reason)));
            continue;
        }
        let (sensor, is_rolling) = parts.sensor(camera, &name)?;
        file.rolling_shutter |= is_rolling || camera.rolling_shutter.is_some();
        let turn = cam_from_world(camera.orientation_deg.0);
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            name,
            camera: sensor,
            cam_from_world: camera_at(frame.place(camera.position.0), &turn),
        });
    }

    file.skipped.extend(parts.unposed(&calibrations));
    if file.rolling_shutter {
        file.warnings.push(Remark::RollingShutter);
    }
    if calibrations.len() > 1 {
        file.warnings
            .push(Remark::SeveralReconstructions(calibrations.len()));
    }
    Ok(file)
}

fn by_id<'a, T>(all: impl IntoIterator<Item = &'a T>, id: fn(&T) -> u64) -> BTreeMap<u64, &'a T> {
    all.into_iter().map(|one| (id(one), one)).collect()
}

/// The calibration that is read, and what it refers to.
struct Parts<'a> {
    calibration: &'a Loaded<CalibratedCameras>,
    /// References to the photos, by camera.
    photos: BTreeMap<u64, &'a str>,
    input_sensors: BTreeMap<u64, &'a InputSensor>,
    sensors: BTreeMap<u64, &'a CalibratedSensor>,
    inputs: &'a [Loaded<InputCameras>],
}

impl Parts<'_> {
    fn bad(&self, place: String, problem: impl Into<String>) -> CameraError {
        malformed(&self.calibration.path, place, problem)
    }

    /// Name and page of a camera's photo.
    fn photo(&self, camera: &CalibratedCamera) -> Result<(String, Option<&str>), CameraError> {
        let uri = self.photos.get(&camera.id);
        let uri =
            uri.ok_or_else(|| self.bad(format!("camera {}", camera.id), "no camera_list names its photo"))?;
        Ok(path_and_fragment(uri))
    }

    /// The sensor of a camera, and whether its shutter is rolling.
    fn sensor(&self, camera: &CalibratedCamera, photo: &str) -> Result<(Camera, bool), CameraError> {
        let id = camera.sensor_id;
        let place = || format!("photo {photo}");
        let (Some(input), Some(calibrated)) = (self.input_sensors.get(&id), self.sensors.get(&id)) else {
            let problem = format!("sensor {id} is not among both the input and the calibrated sensors");
            return Err(self.bad(place(), problem));
        };

        let lens = match &calibrated.internals {
            Internals::Perspective(lens) => lens,
            Internals::Fisheye {} => return Err(self.unsupported("fisheye (Pix4D's polynomial)", photo)),
            Internals::Spherical {} => return Err(self.unsupported("spherical", photo)),
        };
        if lens.focal_length_px <= 0.0 {
            return Err(self.bad(
                place(),
                format!("the focal length of sensor {id} must be positive"),
            ));
        }
        let is_side = |side: &f64| *side >= 1.0 && *side <= f64::from(u32::MAX) && side.fract() == 0.0;
        let [width, height] = input.image_size_px.0;
        if ![width, height].iter().all(is_side) {
            return Err(self.bad(
                place(),
                format!("sensor {id} has an impossible image size {width}x{height}"),
            ));
        }
        Ok((
            camera_of(lens, [width as u32, height as u32]),
            input.shutter_type == "rolling",
        ))
    }

    fn unsupported(&self, model: &str, photo: &str) -> CameraError {
        CameraError::UnsupportedModel {
            path: self.calibration.path.clone(),
            model: model.to_owned(),
            photo: photo.to_owned(),
        }
    }

    /// Photos that were to be calibrated and are not in the calibration that is read.
    fn unposed(&self, calibrations: &[(&Item, Loaded<CalibratedCameras>)]) -> Vec<(String, Remark)> {
        let ids = |file: &Loaded<CalibratedCameras>| -> BTreeSet<u64> {
            file.content.cameras.iter().map(|camera| camera.id).collect()
        };
        let posed = ids(self.calibration);
        let elsewhere: BTreeSet<u64> = calibrations.iter().flat_map(|(_, file)| ids(file)).collect();
        let captures = self.inputs.iter().flat_map(|file| &file.content.captures);
        let cameras = captures.flat_map(|capture| &capture.cameras);
        let unposed = cameras.filter(|camera| !posed.contains(&camera.id));
        let named = unposed.filter_map(|camera| Some((camera.id, self.photos.get(&camera.id)?)));
        let remark = |id| match elsewhere.contains(&id) {
            true => Remark::SmallerReconstruction,
            false => Remark::NotAligned,
        };
        named
            .map(|(id, uri)| (path_and_fragment(uri).0, remark(id)))
            .collect()
    }
}

/// Pix4D's perspective lens is OpenCV's; its principal point counts from the corner of the photo.
fn camera_of(lens: &Perspective, [width, height]: [u32; 2]) -> Camera {
    let [k1, k2, k3] = lens.radial_distortion.0;
    Camera {
        width,
        height,
        focal_px: [lens.focal_length_px; 2],
        center_px: lens.principal_point_px.0,
        skew_px: 0.0,
        distortion: Distortion::brown([k1, k2, k3, 0.0], [0.0; 3], lens.tangential_distortion.0),
        near: None,
    }
}

/// The inverse of Rx(omega) Ry(phi) Rz(kappa), which takes the camera's axes right, up and back to the world.
fn cam_from_world(degrees: [f64; 3]) -> UnitQuaternion<f64> {
    let [omega, phi, kappa] = degrees.map(f64::to_radians);
    let world_from_cam = Rotation3::from_axis_angle(&Vector3::x_axis(), omega)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), phi)
        * Rotation3::from_axis_angle(&Vector3::z_axis(), kappa)
        * Rotation3::from_matrix_unchecked(FLIP);
    UnitQuaternion::from(world_from_cam).inverse()
}
