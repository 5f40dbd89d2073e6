//! Greyscale PNGs whose values are instances.

use super::{InstanceInfo, LabelledPhoto, MaskError};
use crate::folder::files_below;
use crate::image_io;
use crate::photo_name::PhotoName;
use image::codecs::png::{PngDecoder, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use stonewise_core::raster::{LabelImage, Raster, connected_components};

/// Bytes of pixels for each byte of a PNG, at most: deflate packs 258 bytes into two bits (RFC 1951, section
/// 3.2.5).
const MAX_PACKING: u64 = 1032;

/// A folder of label images, each named after its photo: NAME.png, NAME_ids.png, NAME_mask.png or NAME.jpg.png.
#[derive(Clone, Debug)]
pub struct LabelFolder {
    folder: PathBuf,
    files: Vec<PathBuf>,
}

impl LabelFolder {
    /// Lists the PNGs of a folder and of those below it.
    ///
    /// # Errors
    /// The folder cannot be read or holds no PNG.
    pub fn open(folder: &Path) -> Result<Self, MaskError> {
        let mut files =
            files_below(folder, &is_png).map_err(|(path, source)| MaskError::Read { path, source })?;
        if files.is_empty() {
            return Err(MaskError::Empty {
                path: folder.to_owned(),
                expected: "the folder holds no label PNG",
            });
        }
        files.sort();
        Ok(Self {
            folder: folder.to_owned(),
            files,
        })
    }

    /// The labels of a photo, see [`super::MaskSource::labels_for`].
    ///
    /// # Errors
    /// As [`super::MaskSource::labels_for`].
    pub fn labels_for(
        &self,
        photo_name: &str,
        width: u32,
        height: u32,
    ) -> Result<Option<LabelledPhoto>, MaskError> {
        let Some(path) = self.find(photo_name)? else {
            return Ok(None);
        };
        let decoder = label_decoder(path)?;
        MaskError::check_size(path, photo_name, decoder.dimensions(), (width, height))?;
        let mut labels = decode_labels(decoder, path)?;
        let ids = |labels: &LabelImage| -> BTreeSet<u32> {
            labels.data().iter().copied().filter(|&id| id != 0).collect()
        };
        let mut instances = ids(&labels);
        let mut warnings = Vec::new();

        // 1, or white of 8 or 16 bits: stone or not, whichever stone it is.
        if let Some(value) = instances
            .first()
            .filter(|id| instances.len() == 1 && [1, 255, 65535].contains(*id))
        {
            let (parts, found) = connected_components(&labels);
            if found.len() > 1 || *value != 1 {
                warnings.push(format!(
                    "{} has one value for all stones, {value}: each part of it that hangs together is taken as a stone ({})",
                    path.display(),
                    found.len()
                ));
            }
            instances = ids(&parts);
            labels = parts;
        }

        let info = |id| InstanceInfo {
            id,
            score: 1.0,
            stone_ref: None,
        };
        Ok(Some(LabelledPhoto {
            instances: instances.into_iter().map(info).collect(),
            labels,
            warnings,
        }))
    }

    fn find(&self, photo_name: &str) -> Result<Option<&PathBuf>, MaskError> {
        let wanted = PhotoName::new(photo_name);
        let named = ["", "_ids", "_mask"].map(|ending| format!("{}{ending}.png", wanted.stem()));
        // That of one of two photos that differ in their extensions alone.
        let whole = format!("{}.png", wanted.file());
        let candidates: Vec<PhotoName> = { named.into_iter().chain([whole]) }
            .map(|file| wanted.with_file(file))
            .collect();
        let mut fitting: Vec<(usize, &PathBuf)> = Vec::new();
        for file in &self.files {
            let name = PhotoName::new(&file.strip_prefix(&self.folder).unwrap_or(file).to_string_lossy());
            let shared = candidates
                .iter()
                .filter_map(|c| c.fit(&name))
                .filter(|fit| fit.0 == 2);
            if let Some((_, shared)) = shared.max() {
                fitting.push((shared, file));
            }
        }
        let best = fitting.iter().map(|f| f.0).max();
        let mut best = fitting.into_iter().filter(|f| Some(f.0) == best).map(|f| f.1);
        match (best.next(), best.next()) {
            (Some(first), Some(second)) => Err(MaskError::Ambiguous {
                path: self.folder.clone(),
                photo: photo_name.to_owned(),
                first: first.display().to_string(),
                second: second.display().to_string(),
            }),
            (first, _) => Ok(first),
        }
    }
}

/// Reads an 8-bit or 16-bit greyscale PNG as labels.
///
/// # Errors
/// The file is missing, broken, or has colours, transparency or another depth.
pub fn read_label_png(path: &Path) -> Result<LabelImage, MaskError> {
    decode_labels(label_decoder(path)?, path)
}

type LabelDecoder = PngDecoder<BufReader<File>>;

/// Reads the head of a label image.
fn label_decoder(path: &Path) -> Result<LabelDecoder, MaskError> {
    let file = File::open(path).map_err(|source| unreadable(path, source))?;
    let broken = |e| image_io::read_error(path, e);
    let decoder = PngDecoder::new(BufReader::new(file)).map_err(broken)?;
    let found = decoder.original_color_type();
    if !matches!(found, ExtendedColorType::L8 | ExtendedColorType::L16) {
        return Err(MaskError::NotGrey {
            path: path.to_owned(),
            found: format!("{found:?}"),
        });
    }
    Ok(decoder)
}

/// Decodes the pixels, unless the file is too short for their number.
fn decode_labels(decoder: LabelDecoder, path: &Path) -> Result<LabelImage, MaskError> {
    let (width, height) = decoder.dimensions();
    let length = std::fs::metadata(path)
        .map_err(|source| unreadable(path, source))?
        .len();
    if decoder.total_bytes() / MAX_PACKING > length {
        return Err(MaskError::TooManyPixels {
            path: path.to_owned(),
            claimed: (width, height),
            length,
        });
    }
    let broken = |e| image_io::read_error(path, e);
    let values: Vec<u32> = match DynamicImage::from_decoder(decoder).map_err(broken)? {
        DynamicImage::ImageLuma8(grey) => grey.into_raw().into_iter().map(u32::from).collect(),
        other => other
            .into_luma16()
            .into_raw()
            .into_iter()
            .map(u32::from)
            .collect(),
    };
    Raster::from_vec(width, height, values).ok_or_else(|| MaskError::NotGrey {
        path: path.to_owned(),
        found: "incomplete".to_owned(),
    })
}

/// Writes labels as a 16-bit greyscale PNG.
///
/// # Errors
/// A label is above 65535, or the file cannot be written.
pub fn write_label_png(path: &Path, labels: &LabelImage) -> Result<(), MaskError> {
    let mut bytes = Vec::with_capacity(labels.data().len() * 2);
    for &label in labels.data() {
        let value = u16::try_from(label).map_err(|_| MaskError::LabelTooLarge {
            path: path.to_owned(),
            label,
        })?;
        bytes.extend(value.to_ne_bytes());
    }
    image_io::write(path, |file| {
        PngEncoder::new(file).write_image(&bytes, labels.width(), labels.height(), ExtendedColorType::L16)
    })?;
    Ok(())
}

fn unreadable(path: &Path, source: std::io::Error) -> MaskError {
    MaskError::Read {
        path: path.to_owned(),
        source,
    }
}

fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"))
}
