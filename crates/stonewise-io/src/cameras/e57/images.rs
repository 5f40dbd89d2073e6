//! The images of an E57 file, and their camera models and poses.

use super::super::pose::{FLIP, rotation};
use super::super::{CameraError, malformed};
use super::left_out::LeftOut;
use super::panorama::Panorama;
use crate::wall::behind_wall;
use e57::{Blob, E57Reader, Image, PinholeImageProperties, Projection, Transform};
use nalgebra::{Point3, Quaternion, UnitQuaternion};
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};
use stonewise_core::geometry::{Camera, Distortion, rotation_of};

/// An open E57 file.
pub struct E57Images {
    path: PathBuf,
    reader: E57Reader<BufReader<File>>,
    images: Vec<Image>,
}

/// An image that photos can be made of.
pub struct Placed {
    /// Its bytes in the file.
    pub blob: Blob,
    /// Width and height as the file says, pixels.
    pub size: [u32; 2],
    /// How it was taken.
    pub taken: Taken,
    /// Where, in the frame of the file.
    pub centre: Point3<f64>,
    /// From the frame of the file to that of the photo, or of the panorama.
    pub from_world: UnitQuaternion<f64>,
    /// Whether the file says that parts of it show nothing.
    pub is_masked: bool,
}

/// How an image was taken.
pub enum Taken {
    /// As a photo.
    Photo(Camera),
    /// As a panorama.
    Panorama(Panorama),
}

impl E57Images {
    /// Opens a file and reads the descriptions of its images.
    pub fn open(path: &Path) -> Result<Self, CameraError> {
        let read = |source| CameraError::Read {
            path: path.to_owned(),
            source,
        };
        let mut file = File::open(path).map_err(read)?;
        let mut start = Vec::new();
        (&mut file).take(8).read_to_end(&mut start).map_err(read)?;
        if start != *b"ASTM-E57" {
            return Err(CameraError::NoImages {
                files: path.display().to_string(),
                problem: "not an E57 file; photos are read from E57 files only".to_owned(),
            });
        }
        file.rewind().map_err(read)?;
        let reader = guarded(path, "its header", || E57Reader::new(BufReader::new(file)))?;
        Ok(Self {
            path: path.to_owned(),
            images: reader.images(),
            reader,
        })
    }

    /// How many images there are.
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// The name that the file gives an image.
    pub fn name(&self, index: usize) -> &str {
        self.images[index].name.as_deref().unwrap_or_default()
    }

    /// "This image has this problem."
    pub fn malformed(&self, index: usize, problem: impl Into<String>) -> CameraError {
        malformed(&self.path, self.place(index), problem)
    }

    /// How an image was taken and where, or why it is no photo.
    pub fn placed(&self, index: usize) -> Result<Placed, LeftOut> {
        let image = &self.images[index];
        let (taken, size, blob, mask) = match &image.projection {
            None => return Err(LeftOut::NoProjection),
            Some(Projection::Cylindrical(_)) => return Err(LeftOut::Cylindrical),
            Some(Projection::Pinhole(photo)) => {
                let lens = &photo.properties;
                let camera = camera(lens).ok_or(LeftOut::WrongLens)?;
                let size = [lens.width, lens.height];
                (Taken::Photo(camera), size, &photo.blob, &photo.mask)
            }
            Some(Projection::Spherical(image)) => {
                let lens = &image.properties;
                let size = [lens.width, lens.height];
                let pixel_rad = [lens.pixel_width, lens.pixel_height];
                let panorama = Panorama { size, pixel_rad };
                if !panorama.is_full_circle() {
                    return Err(LeftOut::NotTheCircle);
                }
                if panorama.camera().width == 0 {
                    return Err(LeftOut::WrongLens);
                }
                (Taken::Panorama(panorama), size, &image.blob, &image.mask)
            }
        };
        let pose = image.transform.as_ref().ok_or(LeftOut::NoPose)?;
        let (centre, local_from_world) = pose_of(pose).ok_or(LeftOut::WrongPose)?;
        let from_world = match &taken {
            Taken::Panorama(_) => local_from_world,
            // ASTM E2807-11: a pinhole camera looks along its -z, with +x to the right and +y up in the image.
            Taken::Photo(_) => {
                let turn = FLIP * local_from_world.to_rotation_matrix().matrix();
                rotation(&turn).ok_or(LeftOut::WrongPose)?
            }
        };
        Ok(Placed {
            blob: blob.data.clone(),
            size,
            taken,
            centre,
            from_world,
            is_masked: mask.is_some(),
        })
    }

    /// The bytes of an image.
    pub fn bytes(&mut self, index: usize, blob: &Blob) -> Result<Vec<u8>, CameraError> {
        let mut bytes = Vec::new();
        let place = self.place(index);
        guarded(&self.path, &place, || self.reader.blob(blob, &mut bytes))?;
        if bytes.len() as u64 != blob.length {
            let problem = format!(
                "the image has {} of {} bytes: copy or export the file again",
                bytes.len(),
                blob.length
            );
            return Err(self.malformed(index, problem));
        }
        Ok(bytes)
    }

    fn place(&self, index: usize) -> String {
        let number = format!("image {} of {}", index + 1, self.images.len());
        match self.name(index).trim() {
            "" => number,
            name => format!("{number}, {name:?}"),
        }
    }
}

/// The camera of a pinhole image; `None` where its numbers cannot be.
///
/// Focal length and pixels are in metres, the principal point in pixels. Pixels count from the corner of the image, as
/// those of this crate: the faces of a cube of 4096 pixels have their principal points at 2048.
fn camera(lens: &PinholeImageProperties) -> Option<Camera> {
    let focal_px = [lens.pixel_width, lens.pixel_height].map(|pixel| lens.focal_length / pixel);
    let center_px = [lens.principal_x, lens.principal_y];
    let is_possible = focal_px.iter().all(|f| f.is_finite() && *f > 0.0)
        && center_px.iter().all(|c| c.is_finite())
        && lens.width.min(lens.height) > 0;
    is_possible.then_some(Camera {
        width: lens.width,
        height: lens.height,
        focal_px,
        center_px,
        skew_px: 0.0,
        distortion: Distortion::None,
        near: None,
    })
}

/// Place, and rotation from the frame of the file to the local one. The file gives the motion the other way.
fn pose_of(pose: &Transform) -> Option<(Point3<f64>, UnitQuaternion<f64>)> {
    let (t, r) = (&pose.translation, &pose.rotation);
    let centre = Point3::new(t.x, t.y, t.z);
    let turn =
        rotation_of(Quaternion::new(r.w, r.x, r.y, r.z)).filter(|_| centre.iter().all(|c| c.is_finite()))?;
    Some((centre, turn.inverse()))
}

/// Runs a step of the library; its error, or its panic, becomes one that names file and place.
fn guarded<T>(path: &Path, place: &str, step: impl FnOnce() -> e57::Result<T>) -> Result<T, CameraError> {
    let problem = match behind_wall(step) {
        Some(Ok(value)) => return Ok(value),
        Some(Err(error)) => format!("{error}: copy or export the file again"),
        None => "the file is damaged: copy or export it again".to_owned(),
    };
    Err(malformed(path, place, problem))
}
