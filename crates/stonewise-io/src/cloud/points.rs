//! New point files.

use std::path::Path;

use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

use super::CloudError;
use super::las::{Export, ExtraType, LazWriter, describe, export_header, transforms_for};
use super::whole::write_whole;

/// Finest step of coordinates, metres; large extents get a coarser one.
const FINEST_M: f64 = 1e-6;
const CHUNK_POINTS: usize = 400_000;

/// Values of an extra dimension, one per point.
#[derive(Clone, Copy, Debug)]
pub enum ExtraColumn<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
    /// Integers from 0 to 65535; also flags, as some programs drop anything narrower.
    U16(&'a [u16]),
    /// Integers.
    U32(&'a [u32]),
}

/// Writes points with extra dimensions as LAZ (LAS 1.4, point format 6).
///
/// `positions` are in the world frame, metres; the step of the coordinates is 1 micrometre, coarser only where the
/// extent is above 4 km, about an offset in the middle. Names of dimensions are at most 32 ASCII characters.
///
/// # Errors
/// A position is not finite, a column has another length, a name does not fit, or the file cannot be written;
/// `path` then stays as it was.
pub fn write_points_laz(
    path: &Path,
    positions: &[Point3<f64>],
    columns: &[(&str, ExtraColumn<'_>)],
) -> Result<(), CloudError> {
    if let Some(i) = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(CloudError::unwritable(path, format!("point {i} has no position")));
    }
    let mut descriptors = Vec::new();
    for (name, column) in columns {
        if column.len() != positions.len() {
            let reason = format!(
                "{} values of {name:?} for {} points",
                column.len(),
                positions.len()
            );
            return Err(CloudError::unwritable(path, reason));
        }
        let reason = || CloudError::unwritable(path, format!("not a name of a dimension: {name:?}"));
        descriptors.extend(describe(name, column.kind(), "").ok_or_else(reason)?);
    }
    let extra_bytes = columns.iter().map(|(_, c)| c.kind().size()).sum();
    let bounds = Bounds::of(positions.iter().copied()).unwrap_or(Bounds {
        min: Point3::origin(),
        max: Point3::origin(),
    });
    let transforms = transforms_for(&bounds, FINEST_M)
        .ok_or_else(|| CloudError::unwritable(path, format!("too large for LAS: {bounds:?}")))?;
    write_whole(path, |partial| {
        let header = export_header(false, transforms, extra_bytes, descriptors);
        let mut writer = LazWriter::create(partial, path, header)?;
        for start in (0..positions.len()).step_by(CHUNK_POINTS) {
            let mut out = Vec::new();
            for (i, position) in positions.iter().enumerate().skip(start).take(CHUNK_POINTS) {
                let record = Export {
                    position: *position,
                    intensity: 0,
                    color: None,
                    source: 0,
                };
                record.append(&transforms, &mut out);
                columns.iter().for_each(|(_, c)| c.append(i, &mut out));
            }
            writer.write(out)?;
        }
        writer.finish()
    })
}

impl ExtraColumn<'_> {
    fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::U32(v) => v.len(),
        }
    }

    fn kind(&self) -> ExtraType {
        match self {
            Self::F32(_) => ExtraType::F32,
            Self::F64(_) => ExtraType::F64,
            Self::U16(_) => ExtraType::U16,
            Self::U32(_) => ExtraType::U32,
        }
    }

    fn append(&self, i: usize, out: &mut Vec<u8>) {
        match self {
            Self::F32(v) => out.extend(v[i].to_le_bytes()),
            Self::F64(v) => out.extend(v[i].to_le_bytes()),
            Self::U16(v) => out.extend(v[i].to_le_bytes()),
            Self::U32(v) => out.extend(v[i].to_le_bytes()),
        }
    }
}
