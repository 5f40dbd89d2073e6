//! COLMAP's binary files, little endian.

use super::super::{CameraError, malformed};
use super::model::MODELS;
use super::raw::{RawCamera, RawImage};
use std::collections::BTreeMap;
use std::path::Path;

/// cameras.bin: count u64; each: id u32, model i32, width u64, height u64, parameters f64.
pub fn read_cameras(path: &Path) -> Result<BTreeMap<u32, RawCamera>, CameraError> {
    let mut bytes = Bytes::open(path)?;
    let count = bytes.u64()?;
    let mut cameras = BTreeMap::new();
    for index in 0..count {
        let place = format!("camera {} of {count}", index + 1);
        let id = bytes.u32()?;
        let model_id = bytes.u32()?;
        let width = bytes.u64()?;
        let height = bytes.u64()?;
        let known = usize::try_from(model_id).ok().and_then(|id| MODELS.get(id));
        let Some(&(model, parameters)) = known else {
            let problem = format!("camera model number {model_id} is unknown");
            return Err(malformed(path, place, problem));
        };
        let params = (0..parameters).map(|_| bytes.f64()).collect::<Result<_, _>>()?;
        cameras.insert(
            id,
            RawCamera {
                model: model.to_owned(),
                width,
                height,
                params,
                place,
            },
        );
    }
    Ok(cameras)
}

/// images.bin: count u64; each: id u32, rotation 4 f64, translation 3 f64, camera u32, name ending in 0,
/// points.
pub fn read_images(path: &Path) -> Result<Vec<RawImage>, CameraError> {
    let mut bytes = Bytes::open(path)?;
    let count = bytes.u64()?;
    let mut images = Vec::new();
    for index in 0..count {
        let place = format!("image {} of {count}", index + 1);
        let _id = bytes.u32()?;
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = bytes.f64()?;
        }
        let [w, x, y, z, tx, ty, tz] = numbers;
        let camera_id = bytes.u32()?;
        let name = bytes.name()?;
        let points = bytes.u64()?;
        bytes.skip(points.saturating_mul(24))?;
        images.push(RawImage {
            rotation_wxyz: [w, x, y, z],
            translation: [tx, ty, tz],
            camera_id,
            name,
            place,
        });
    }
    Ok(images)
}

/// A file's bytes, taken from the front.
struct Bytes<'a> {
    path: &'a Path,
    data: Vec<u8>,
    offset: usize,
}

impl<'a> Bytes<'a> {
    fn open(path: &'a Path) -> Result<Self, CameraError> {
        let data = std::fs::read(path).map_err(|source| CameraError::Read {
            path: path.to_owned(),
            source,
        })?;
        Ok(Self {
            path,
            data,
            offset: 0,
        })
    }

    fn truncated(&self) -> CameraError {
        malformed(
            self.path,
            format!("byte {}", self.offset),
            "the file ends too early: is it complete?",
        )
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], CameraError> {
        let taken = self
            .data
            .get(self.offset..)
            .and_then(|rest| rest.first_chunk::<N>());
        let taken = *taken.ok_or_else(|| self.truncated())?;
        self.offset += N;
        Ok(taken)
    }

    fn u32(&mut self) -> Result<u32, CameraError> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, CameraError> {
        self.take().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, CameraError> {
        self.take().map(f64::from_le_bytes)
    }

    fn name(&mut self) -> Result<String, CameraError> {
        let rest = &self.data[self.offset..];
        let length = rest.iter().position(|&byte| byte == 0);
        let length = length.ok_or_else(|| self.truncated())?;
        let name = String::from_utf8_lossy(&rest[..length]).into_owned();
        self.offset += length + 1;
        Ok(name)
    }

    fn skip(&mut self, bytes: u64) -> Result<(), CameraError> {
        let left = (self.data.len() - self.offset) as u64;
        if bytes > left {
            return Err(self.truncated());
        }
        self.offset += bytes as usize;
        Ok(())
    }
}
