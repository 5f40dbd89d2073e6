//! Photos and pictures as files.
//!
//! Rotation flags in a photo's EXIF are not applied: cameras refer to the pixels as they are stored.

use crate::atomic::write_atomically;
use crate::folder::files_below;
pub use crate::photo_name::is_photo;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageDecoder, ImageEncoder, ImageError, ImageFormat, ImageReader, Limits};
use std::fs::File;
use std::io::{BufWriter, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use stonewise_core::raster::{Raster, RgbImage};

/// Memory that a photo may take while it is read: 300 megapixels of three 16-bit values.
const MOST_BYTES: u64 = 2 << 30;

/// First bytes of a TIFF with 64-bit offsets, which the library reads, but does not guess.
const BIG_TIFF: [[u8; 4]; 2] = [[b'I', b'I', 43, 0], [b'M', b'M', 0, 43]];

/// Why a picture could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageIoError {
    /// The file cannot be read or is no intact JPEG, PNG or TIFF.
    #[error("{}: cannot read the image: {source}", path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// What the decoder said.
        source: ImageError,
    },
    /// A JPEG without its end.
    #[error("{}: the photo is cut off: copy it again from the camera", path.display())]
    Truncated {
        /// File.
        path: PathBuf,
    },
    /// The file cannot be written.
    #[error("{}: cannot write the image: {source}", path.display())]
    Write {
        /// File.
        path: PathBuf,
        /// What the encoder said.
        source: ImageError,
    },
}

/// Reads a JPEG, PNG or TIFF as 8-bit RGB, 16-bit values rounded; the content gives the format, not the name. Of
/// several pages of a TIFF the first is read.
///
/// # Errors
/// The file is missing, truncated or in another format.
pub fn read_rgb(path: &Path) -> Result<RgbImage, ImageIoError> {
    let bytes = std::fs::read(path).map_err(|e| read_error(path, ImageError::IoError(e)))?;
    if is_cut_off(&bytes) {
        return Err(ImageIoError::Truncated {
            path: path.to_owned(),
        });
    }
    decode_rgb(&bytes).map_err(|source| read_error(path, source))
}

/// As [`read_rgb`], of bytes.
pub(crate) fn decode_rgb(bytes: &[u8]) -> Result<RgbImage, ImageError> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    if BIG_TIFF.iter().any(|start| bytes.starts_with(start)) {
        reader.set_format(ImageFormat::Tiff);
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let decoded = reader.decode()?.into_rgb8();
    let (width, height) = decoded.dimensions();
    let pixels = decoded.pixels().map(|p| p.0).collect();
    Ok(Raster::from_vec(width, height, pixels).unwrap_or_else(|| Raster::filled(0, 0, [0; 3])))
}

/// Format, width and height, pixels, from the head of the bytes alone.
pub(crate) fn head_of(bytes: &[u8]) -> Result<(Option<ImageFormat>, [u32; 2]), ImageError> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let format = reader.format();
    let (width, height) = reader.into_dimensions()?;
    Ok((format, [width, height]))
}

/// Photos in a folder and below, sorted; hidden files and folders are left out.
///
/// # Errors
/// A folder cannot be read.
pub fn photos_in(folder: &Path) -> Result<Vec<PathBuf>, ImageIoError> {
    let mut photos = files_below(folder, &is_photo)
        .map_err(|(path, error)| read_error(&path, ImageError::IoError(error)))?;
    photos.sort();
    Ok(photos)
}

/// What the head of a picture says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureHead {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// A greyscale PNG, as label images are.
    pub is_label: bool,
}

/// Reads the head of a JPEG, PNG or TIFF alone.
///
/// # Errors
/// The file is missing or in another format.
pub fn picture_head(path: &Path) -> Result<PictureHead, ImageIoError> {
    let read = || -> Result<PictureHead, ImageError> {
        let reader = ImageReader::open(path)?.with_guessed_format()?;
        let is_png = reader.format() == Some(ImageFormat::Png);
        let decoder = reader.into_decoder()?;
        let (width, height) = decoder.dimensions();
        let is_grey = matches!(
            decoder.original_color_type(),
            ExtendedColorType::L8 | ExtendedColorType::L16
        );
        Ok(PictureHead {
            width,
            height,
            is_label: is_png && is_grey,
        })
    };
    read().map_err(|source| read_error(path, source))
}

/// Width and height, pixels, from the file's header alone.
///
/// # Errors
/// The file is missing or in another format.
pub fn image_size(path: &Path) -> Result<(u32, u32), ImageIoError> {
    picture_head(path).map(|head| (head.width, head.height))
}

/// Writes an RGB PNG.
///
/// # Errors
/// The file cannot be written.
pub fn write_png_rgb(path: &Path, picture: &RgbImage) -> Result<(), ImageIoError> {
    write(path, |file| {
        let (width, height) = (picture.width(), picture.height());
        PngEncoder::new(file).write_image(
            picture.data().as_flattened(),
            width,
            height,
            ExtendedColorType::Rgb8,
        )
    })
}

/// Writes a JPEG of this quality (1 to 100).
///
/// # Errors
/// The file cannot be written.
pub fn write_jpeg(path: &Path, picture: &RgbImage, quality: u8) -> Result<(), ImageIoError> {
    write(path, |file| {
        let (width, height) = (picture.width(), picture.height());
        let encoder = JpegEncoder::new_with_quality(file, quality.clamp(1, 100));
        encoder.write_image(
            picture.data().as_flattened(),
            width,
            height,
            ExtendedColorType::Rgb8,
        )
    })
}

/// The first two bytes of a JPEG, and the marker at its end.
const START: [u8; 2] = [0xff, 0xd8];
const END: [u8; 2] = [0xff, 0xd9];

/// Whether [`read_rgb`] refuses a photo as cut off; of a JPEG with nothing behind its end, only the ends are read.
///
/// # Errors
/// The file cannot be read.
pub fn photo_is_cut_off(path: &Path) -> Result<bool, ImageIoError> {
    let failed = |e| read_error(path, ImageError::IoError(e));
    let mut file = File::open(path).map_err(failed)?;
    let (mut start, mut end) = ([0; 2], [0; 2]);
    let read = file.read_exact(&mut start).and_then(|()| {
        file.seek(SeekFrom::End(-2))?;
        file.read_exact(&mut end)
    });
    match read {
        Ok(()) if start == START && end != END => Ok(is_cut_off(&std::fs::read(path).map_err(failed)?)),
        Ok(()) => Ok(false),
        // It has less than two bytes.
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(failed(e)),
    }
}

/// Whether a JPEG ends before its end-of-image marker; decoders paint the missing part grey without a word. Bytes behind
/// that marker do not matter.
fn is_cut_off(bytes: &[u8]) -> bool {
    bytes.starts_with(&START) && !bytes.ends_with(&END) && end_of_image(bytes).is_none()
}

/// Where a JPEG ends, from segment to segment (ITU-T T.81, annex B).
fn end_of_image(bytes: &[u8]) -> Option<usize> {
    let mut place = 2;
    loop {
        // A marker is a byte of ones and one that is neither 0, which stands for data, nor all ones, which fill. Before it
        // may come the data of a scan.
        place += bytes
            .get(place..)?
            .windows(2)
            .position(|pair| pair[0] == 0xff && !matches!(pair[1], 0 | 0xff))?;
        let marker = *bytes.get(place + 1)?;
        place += 2;
        match marker {
            0xd9 => return Some(place),
            // Restarts within a scan, a second start, and a marker for programs.
            0xd0..=0xd8 | 0x01 => {}
            _ => {
                let length = bytes.get(place..place + 2)?;
                place += usize::from(u16::from_be_bytes([length[0], length[1]]));
            }
        }
    }
}

/// Writes whole or not at all.
pub(crate) fn write(
    path: &Path,
    encode: impl FnOnce(&mut BufWriter<File>) -> Result<(), ImageError>,
) -> Result<(), ImageIoError> {
    let written = write_atomically(path, |partial| -> Result<(), Failure> {
        let mut file = BufWriter::new(File::create(partial)?);
        encode(&mut file).map_err(Failure)?;
        std::io::Write::flush(&mut file)?;
        Ok(())
    });
    written.map_err(|Failure(source)| ImageIoError::Write {
        path: path.to_owned(),
        source,
    })
}

/// Lets the file system's and the encoder's errors share a way out.
struct Failure(ImageError);

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self(ImageError::IoError(error))
    }
}

pub(crate) fn read_error(path: &Path, source: ImageError) -> ImageIoError {
    ImageIoError::Read {
        path: path.to_owned(),
        source,
    }
}
