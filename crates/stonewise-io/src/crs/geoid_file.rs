//! Files of geoids: NOAA's VDatum grid shift (GTX), GeoTIFF, GRAVSOFT text, and the files of EGM96 and EGM2008.
//!
//! GTX, as PROJ reads it: big-endian, corner in the south-west, steps, rows and columns, then single-precision heights
//! in metres from south to north.

use super::geoid::Geoid;
use super::{geoid_egm, geoid_gravsoft, geoid_tiff};
use std::fs;
use std::path::{Path, PathBuf};

const HEAD_BYTES: usize = 40;
/// Stands for a node without a height.
const NO_HEIGHT: f32 = -88.8888;

/// Why a grid cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct GeoidError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong, and the fix.
    pub reason: String,
}

impl Geoid {
    /// Reads a file of one of these formats; its content tells which.
    ///
    /// # Errors
    /// The file cannot be read, or is no such grid.
    pub fn read(path: &Path) -> Result<Self, GeoidError> {
        let failed = |reason: String| GeoidError {
            path: path.to_owned(),
            reason,
        };
        let bytes = fs::read(path).map_err(|e| failed(format!("cannot read the geoid: {e}")))?;
        let grid = if geoid_tiff::is_tiff(&bytes) {
            geoid_tiff::read(&bytes)
        } else if let Some(grid) = gtx(&bytes).or_else(|| geoid_egm::read(&bytes)) {
            Ok(grid)
        } else {
            let truncated = || Err("of no known format, or truncated".to_owned());
            geoid_gravsoft::read(&bytes).unwrap_or_else(truncated)
        };
        grid.map_err(|reason| {
            failed(format!(
                "not a grid of a geoid ({reason}): give a GTX file, a GeoTIFF such as those of PROJ, GRAVSOFT \
                 text, or a binary file of EGM96 or EGM2008, or convert it with gdal_translate -of GTX"
            ))
        })
    }
}

fn gtx(bytes: &[u8]) -> Option<Geoid> {
    let (head, body) = bytes.split_at_checked(HEAD_BYTES)?;
    let number = |place: usize| Some(f64::from_be_bytes(*head.get(8 * place..)?.first_chunk()?));
    let count = |place: usize| {
        let count = i32::from_be_bytes(*head.get(place..)?.first_chunk()?);
        usize::try_from(count).ok()
    };
    let heights = body.as_chunks::<4>();
    let height = |bytes: &[u8; 4]| {
        let height = f32::from_be_bytes(*bytes);
        if (height - NO_HEIGHT).abs() > 1e-4 {
            height
        } else {
            f32::NAN
        }
    };
    let (heights, []) = heights else {
        return None;
    };
    let (corner, step) = ([number(0)?, number(1)?], [number(2)?, number(3)?]);
    let size = [count(32)?, count(36)?];
    Geoid::of(corner, step, size, heights.iter().map(height).collect())
}
