//! Photos out of E57 files, with a camera file for them.

use super::super::camera_file::MAX_PIXELS;
use super::super::pose::camera_at;
use super::super::{CameraError, read_cameras, write_colmap};
use super::images::{E57Images, Placed, Taken};
use super::left_out::LeftOut;
use super::names::{FileNames, safe_stem};
use super::panorama::{HEADINGS, Panorama, cam_from_local};
use crate::image_io::{self, decode_rgb, head_of, write_jpeg, write_png_rgb};
use image::{ImageError, ImageFormat};
use nalgebra::UnitQuaternion;
use std::collections::BTreeMap;
use std::fs;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use stonewise_core::geometry::{Camera, View};
use stonewise_core::id::ImageId;
use stonewise_core::progress::{Interrupted, Progress};
use stonewise_core::raster::RgbImage;

/// Where the photos lie in the folder that they are unpacked into.
pub const E57_IMAGES_DIR: &str = "images";
/// Where their cameras lie, as a COLMAP model.
pub const E57_CAMERAS_DIR: &str = "colmap";
/// Of the photos that are cut from a JPEG.
const JPEG_QUALITY: u8 = 95;
/// The widest photo that is cut from a panorama, pixels.
const MOST_SIDE: u32 = 16_384;

/// How many images E57 files hold.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct E57ImageCounts {
    /// Photos.
    pub photos: usize,
    /// Panoramas of a full circle.
    pub panoramas: usize,
    /// Images that cannot be used, by reason.
    pub left_out: BTreeMap<LeftOut, usize>,
    /// Files without any image.
    pub without: Vec<PathBuf>,
}

impl E57ImageCounts {
    /// Images of all kinds.
    pub fn total(&self) -> usize {
        self.photos + self.panoramas + self.left_out.values().sum::<usize>()
    }
}

/// What was unpacked.
#[derive(Clone, Debug, Default)]
pub struct E57Photos {
    /// The photos, named as their files in `images`, in the frame of the E57 files.
    pub views: Vec<View>,
    /// How many panoramas were cut into photos, four each.
    pub panoramas: usize,
    /// How many images have masks of parts that show nothing, which are not applied.
    pub masked: usize,
    /// Images that were left out, by reason.
    pub left_out: BTreeMap<LeftOut, usize>,
}

/// Counts the images of E57 files, from their headers alone.
///
/// # Errors
/// A file cannot be read or is no E57 file.
pub fn count_e57_images(paths: &[PathBuf]) -> Result<E57ImageCounts, CameraError> {
    let mut counts = E57ImageCounts::default();
    for path in paths {
        let images = E57Images::open(path)?;
        for index in 0..images.len() {
            match images.placed(index).map(|placed| placed.taken) {
                Ok(Taken::Photo(_)) => counts.photos += 1,
                Ok(Taken::Panorama(_)) => counts.panoramas += 1,
                Err(reason) => *counts.left_out.entry(reason).or_default() += 1,
            }
        }
        if images.len() == 0 {
            counts.without.push(path.clone());
        }
    }
    Ok(counts)
}

/// Counts the images of E57 files, as [`count_e57_images`], of which at least one must be a photo or a panorama.
///
/// # Errors
/// A file cannot be read or is no E57 file; none of their images can be used.
pub fn require_e57_photos(paths: &[PathBuf]) -> Result<E57ImageCounts, CameraError> {
    let counts = count_e57_images(paths)?;
    match counts.photos + counts.panoramas {
        0 => Err(no_photos(paths, &counts.left_out)),
        _ => Ok(counts),
    }
}

/// Unpacks the photos of E57 files into `out/images`, and writes their cameras into `out/colmap`.
///
/// Pinhole images are written as they are in the file. Panoramas in spherical projection are cut into four photos
/// around the horizon, of 90 degrees in both directions, with a quarter of the panorama's width. Other images are left
/// out. The cameras come last, so that a camera file has all of its photos; those of an earlier call are removed first,
/// with their photos.
///
/// Cost: one image at a time is in memory.
///
/// # Errors
/// A file cannot be read or is damaged, none of the images can be used, a photo or the cameras cannot be written, or
/// the caller stops the work.
pub fn unpack_e57_photos<E: From<CameraError> + From<Interrupted>>(
    paths: &[PathBuf],
    out: &Path,
    progress: &dyn Progress,
) -> Result<E57Photos, E> {
    let counts = require_e57_photos(paths)?;
    let (folder, cameras) = (out.join(E57_IMAGES_DIR), out.join(E57_CAMERAS_DIR));
    remove_earlier(&cameras, &folder)?;
    fs::create_dir_all(&folder).map_err(|source| CameraError::Write {
        path: folder.clone(),
        source,
    })?;
    let mut unpacker = Unpacker {
        folder,
        names: FileNames::default(),
        photos: E57Photos::default(),
    };
    progress.begin("photos in the scans", counts.total() as u64);
    for path in paths {
        let mut images = E57Images::open(path)?;
        for index in 0..images.len() {
            progress.check()?;
            if let Err(reason) = unpacker.unpack(&mut images, index)? {
                *unpacker.photos.left_out.entry(reason).or_default() += 1;
            }
            progress.advance(1);
        }
    }
    let photos = unpacker.photos;
    if photos.views.is_empty() {
        return Err(no_photos(paths, &photos.left_out).into());
    }
    write_colmap(&cameras, &photos.views)?;
    Ok(photos)
}

/// The folder of the photos, and what lies in it so far.
struct Unpacker {
    folder: PathBuf,
    names: FileNames,
    photos: E57Photos,
}

impl Unpacker {
    /// Unpacks an image, or returns why it is left out.
    fn unpack(&mut self, images: &mut E57Images, index: usize) -> Result<Result<(), LeftOut>, CameraError> {
        let placed = match images.placed(index) {
            Ok(placed) => placed,
            Err(reason) => return Ok(Err(reason)),
        };
        let bytes = images.bytes(index, &placed.blob)?;
        let unreadable = |error| images.malformed(index, format!("the image cannot be read: {error}"));
        let (format, size) = head_of(&bytes).map_err(unreadable)?;
        let extension = match format {
            Some(ImageFormat::Jpeg) => "jpg",
            Some(ImageFormat::Png) => "png",
            _ => return Err(images.malformed(index, "the image is neither JPEG nor PNG")),
        };
        if size != placed.size {
            return Ok(Err(LeftOut::OtherSize));
        }
        let is_huge = match &placed.taken {
            Taken::Photo(_) => u64::from(size[0]) * u64::from(size[1]) > MAX_PIXELS,
            Taken::Panorama(panorama) => panorama.camera().width > MOST_SIDE,
        };
        if is_huge {
            let problem = format!(
                "the image has {} x {} pixels, more than any camera has",
                size[0], size[1]
            );
            return Err(images.malformed(index, problem));
        }

        let numbered = || format!("photo_{:03}", self.photos.views.len() + 1);
        let stem = safe_stem(images.name(index)).unwrap_or_else(numbered);
        let stem = self.names.unique(&stem);
        match &placed.taken {
            Taken::Photo(camera) => {
                let name = format!("{stem}.{extension}");
                image_io::write(&self.folder.join(&name), |file| {
                    file.write_all(&bytes).map_err(ImageError::IoError)
                })?;
                self.add(name, camera.clone(), &placed, placed.from_world);
            }
            Taken::Panorama(panorama) => {
                let picture = decode_rgb(&bytes).map_err(unreadable)?;
                drop(bytes);
                self.cut(&stem, extension, &placed, panorama, &picture)?;
            }
        }
        self.photos.masked += usize::from(placed.is_masked);
        Ok(Ok(()))
    }

    /// Cuts a panorama into photos.
    fn cut(
        &mut self,
        stem: &str,
        extension: &str,
        placed: &Placed,
        panorama: &Panorama,
        picture: &RgbImage,
    ) -> Result<(), CameraError> {
        let camera = panorama.camera();
        for (degrees, direction) in HEADINGS {
            let name = self.names.unique(&format!("{stem}_{degrees:03}"));
            let name = format!("{name}.{extension}");
            let turn = cam_from_local(direction);
            let photo = panorama.cut(picture, &camera, &turn);
            let path = self.folder.join(&name);
            match extension {
                "png" => write_png_rgb(&path, &photo)?,
                _ => write_jpeg(&path, &photo, JPEG_QUALITY)?,
            }
            self.add(name, camera.clone(), placed, turn * placed.from_world);
        }
        self.photos.panoramas += 1;
        Ok(())
    }

    fn add(&mut self, name: String, camera: Camera, placed: &Placed, cam_from_world: UnitQuaternion<f64>) {
        self.photos.views.push(View {
            image: ImageId(self.photos.views.len() as u32),
            name,
            camera,
            cam_from_world: camera_at(placed.centre, &cam_from_world),
        });
    }
}

/// Removes the list of photos of an earlier call, without which its cameras are no model, and the photos that it names.
fn remove_earlier(cameras: &Path, photos: &Path) -> Result<(), CameraError> {
    let earlier = read_cameras(cameras).map_or(Vec::new(), |file| file.views);
    let names = earlier.into_iter().map(|view| photos.join(view.name));
    for path in std::iter::once(cameras.join("images.txt")).chain(names) {
        match fs::remove_file(&path) {
            Err(source) if source.kind() != ErrorKind::NotFound => {
                return Err(CameraError::Write { path, source });
            }
            _ => {}
        }
    }
    Ok(())
}

fn no_photos(paths: &[PathBuf], left_out: &BTreeMap<LeftOut, usize>) -> CameraError {
    let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let reasons: Vec<String> = left_out.iter().map(|(why, n)| format!("{n} {why}")).collect();
    let problem = match reasons.as_slice() {
        [] => "no images inside: export the scans with their photos".to_owned(),
        reasons => format!(
            "none of the images is a photo with a camera model and a pose ({}): export the scans with such photos",
            reasons.join(", ")
        ),
    };
    CameraError::NoImages {
        files: files.join(", "),
        problem,
    }
}
