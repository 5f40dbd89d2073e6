//! Grids of geoids as GeoTIFF: PROJ's geodetic grids, and what GDAL makes of other grids.
//!
//! Format: OGC GeoTIFF 1.1 (19-008r4), and the items that PROJ's specification of Geodetic TIFF grids takes from GDAL:
//! scale, offset and description of a band (tag 42112), and the value of nodes without a height (tag 42113). The first
//! band of the first image counts.

use super::geoid::Geoid;
use crate::xml::{Element, parse};
use std::collections::BTreeMap;
use std::io::Cursor;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

const GDAL_METADATA: Tag = Tag::Unknown(42112);
/// GTModelTypeGeoKey, and its value for geographic coordinates.
const COORDINATES: (u16, u16) = (1024, 2);
/// GTRasterTypeGeoKey, and its value PixelIsPoint: coordinates refer to centres of pixels. Otherwise (PixelIsArea) they
/// refer to corners.
const POINTS: (u16, u16) = (1025, 2);
/// Most decoded bytes per byte of the file: deflate reaches about 1,032. It keeps a small damaged file from claiming much
/// memory.
const MOST_PACKED: usize = 1100;
/// Bytes of the largest grid that is read; EGM2008 has 0.93 GB at 1 minute.
const MOST_BYTES: usize = 1 << 30;

/// Whether a file starts as TIFF or BigTIFF does.
pub fn is_tiff(bytes: &[u8]) -> bool {
    [b"II*\0", b"II+\0", b"MM\0*", b"MM\0+"]
        .iter()
        .any(|head| bytes.starts_with(*head))
}

fn failed(error: TiffError) -> String {
    error.to_string()
}

/// Reads a grid, or says what it lacks.
pub fn read(bytes: &[u8]) -> Result<Geoid, String> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = bytes.len().saturating_mul(MOST_PACKED).min(MOST_BYTES);
    let mut file = Decoder::new(Cursor::new(bytes))
        .map_err(failed)?
        .with_limits(limits);

    let keys = file.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).map_err(failed)?;
    let has = |(key, value): (u16, u16)| keys.as_chunks::<4>().0.contains(&[key, 0, 1, value]);
    if !has(COORDINATES) {
        return Err("its coordinates are not latitudes and longitudes".to_owned());
    }
    let sizes = file.get_tag_f64_vec(Tag::ModelPixelScaleTag).map_err(failed)?;
    let tie = file.get_tag_f64_vec(Tag::ModelTiepointTag).map_err(failed)?;
    let ([east_step, north_step, ..], [column, row, _, east, north, ..]) = (&sizes[..], &tie[..]) else {
        return Err("it is not georeferenced".to_owned());
    };
    let (columns, rows) = file.dimensions().map_err(failed)?;
    let middle = if has(POINTS) { 0.0 } else { 0.5 };
    let corner = [
        north - (f64::from(rows) - 1.0 + middle - row) * north_step,
        east + (middle - column) * east_step,
    ];

    let band = Band::of(&mut file)?;
    let size = [rows, columns].map(|count| count as usize);
    let heights = match file.read_image().map_err(failed)? {
        DecodingResult::F32(values) => band.heights(&values, size[1]),
        DecodingResult::F64(values) => band.heights(&values, size[1]),
        DecodingResult::I16(values) => band.heights(&values, size[1]),
        DecodingResult::I32(values) => band.heights(&values, size[1]),
        _ => {
            return Err(
                "its values are neither floating-point numbers nor signed integers of 16 or 32 bits"
                    .to_owned(),
            );
        }
    };
    Geoid::of(corner, [*north_step, *east_step], size, heights)
        .ok_or_else(|| "its size or place is impossible".to_owned())
}

/// How values of the first band become heights.
struct Band {
    /// Samples per pixel in the decoded values: all bands where they are interleaved, else 1.
    together: usize,
    scale: f64,
    offset: f64,
    no_height: Option<f64>,
}

impl Band {
    fn of(file: &mut Decoder<Cursor<&[u8]>>) -> Result<Self, String> {
        let mut text = |tag: Tag| {
            let value = file.find_tag(tag).map_err(failed)?;
            value.map_or(Ok(String::new()), |value| value.into_string().map_err(failed))
        };
        let (metadata, no_height) = (text(GDAL_METADATA)?, text(Tag::GdalNodata)?);
        let items = items(&metadata)?;
        if let Some(what) = items.get("description").filter(|what| what.ends_with("_offset")) {
            return Err(format!("its first band is a {what}"));
        }
        let number = |role: &str, other: f64| match items.get(role) {
            Some(text) => text.parse().map_err(|_| format!("its {role} is not a number")),
            None => Ok(other),
        };
        let planes = file.find_tag_unsigned(Tag::PlanarConfiguration).map_err(failed)?;
        let together = match file.colortype().map_err(failed)? {
            ColorType::Gray(_) => 1,
            ColorType::Multiband { .. } if planes == Some(2_u16) => 1,
            ColorType::Multiband { num_samples, .. } => usize::from(num_samples),
            _ => return Err("it is a colour image".to_owned()),
        };
        Ok(Self {
            together,
            scale: number("scale", 1.0)?,
            offset: number("offset", 0.0)?,
            no_height: no_height.trim().parse().ok(),
        })
    }

    /// Heights with rows from south to north; the rows of `values` run from north to south.
    fn heights<T: Copy + Into<f64>>(&self, values: &[T], columns: usize) -> Vec<f32> {
        let rows = values.chunks(columns * self.together).rev();
        let of_first_band = rows.flat_map(|row| row.iter().step_by(self.together));
        of_first_band.map(|value| self.height((*value).into())).collect()
    }

    fn height(&self, value: f64) -> f32 {
        // The text may be rounded differently from the values.
        let is_none = |none: f64| (value - none).abs() <= 1e-6 * none.abs();
        if self.no_height.is_some_and(is_none) {
            return f32::NAN;
        }
        (self.offset + self.scale * value) as f32
    }
}

/// The metadata of the first band by their roles.
fn items(metadata: &str) -> Result<BTreeMap<String, String>, String> {
    if metadata.trim().is_empty() {
        return Ok(BTreeMap::new());
    }
    let document = parse(metadata).map_err(|e| format!("its metadata are broken: {}", e.problem))?;
    let of_band = Element::root(&document)
        .children()
        .filter(|item| item.attribute("sample") == Some("0"));
    Ok(of_band
        .filter_map(|item| Some((item.attribute("role")?.to_owned(), item.text().trim().to_owned())))
        .collect())
}
