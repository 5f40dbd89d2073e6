//! New point files.

use std::path::Path;

use las::{GpsTimeType, Transform, Vector};
use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

use super::CloudError;
use super::extra_bytes::{Dimension, ExtraType, describe_all};
use super::las::{Export, LazWriter, crs_record, export_header, transforms_for};
use super::whole::write_whole;

/// Finest step of coordinates, metres; large extents get a coarser one.
const FINEST_M: f64 = 1e-6;
/// Finest step of coordinates in clouds to look at, metres.
const SHOWN_M: f64 = 1e-4;
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
/// `positions` are in the world frame, metres; the step of the coordinates is 1 micrometre, coarser only
/// where the extent is above 4 km, about an offset in the middle. `crs`: the coordinate system, where it is
/// known: WKT, or `EPSG:` and a code.
///
/// # Errors
/// A position is not finite, a column has another length, a name or a description of a dimension does not
/// fit, or the file cannot be written; `path` then stays as it was.
pub fn write_points_laz(
    path: &Path,
    crs: Option<&str>,
    positions: &[Point3<f64>],
    columns: &[(Dimension<'_>, ExtraColumn<'_>)],
) -> Result<(), CloudError> {
    let origin = Point3::origin();
    let finite = positions
        .iter()
        .copied()
        .filter(|p| p.iter().all(|c| c.is_finite()));
    let bounds = Bounds::of(finite).unwrap_or(Bounds {
        min: origin,
        max: origin,
    });
    let kinds: Vec<(Dimension<'_>, ExtraType)> = columns.iter().map(|(d, c)| (*d, c.kind())).collect();
    let values: Vec<ExtraColumn<'_>> = columns.iter().map(|(_, c)| *c).collect();
    stream_points_laz(path, crs, &bounds, &kinds, |sink| sink.append(positions, &values))
}

/// Writes points that come piece by piece, as [`write_points_laz`] does; none of them needs to stay in
/// memory.
///
/// `bounds`: a box that holds all points; the step of the coordinates follows from it. `columns`: the extra
/// dimensions with their types, in the order in which `write` gives their values.
///
/// # Errors
/// As [`write_points_laz`], a point outside the box, or what `write` returns; `path` then stays as it was.
pub fn stream_points_laz<E: From<CloudError>>(
    path: &Path,
    crs: Option<&str>,
    bounds: &Bounds,
    columns: &[(Dimension<'_>, ExtraType)],
    write: impl FnOnce(&mut PointSink<'_>) -> Result<(), E>,
) -> Result<(), E> {
    stream(path, crs, bounds, columns, Kind::Points, write)
}

/// Where and when points were measured, as a scanner's software notes it.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// `point_source_id` of each point: its station or strip.
    pub sources: &'a [u16],
    /// `gps_time` of each point: adjusted standard GPS time (LAS 1.4), seconds.
    pub times: &'a [f64],
}

/// Writes points with their sources and times ([`PointSink::append_observed`]), else as
/// [`stream_points_laz`]; the header says that times are adjusted standard GPS times.
///
/// # Errors
/// As [`stream_points_laz`].
pub fn stream_scan_laz<E: From<CloudError>>(
    path: &Path,
    bounds: &Bounds,
    columns: &[(Dimension<'_>, ExtraType)],
    write: impl FnOnce(&mut PointSink<'_>) -> Result<(), E>,
) -> Result<(), E> {
    stream(path, None, bounds, columns, Kind::Scan, write)
}

/// Writes points with their colours ([`PointSink::append_coloured`]), else as [`stream_points_laz`], but in point
/// format 7 and with a step of 0.1 mm.
///
/// # Errors
/// As [`stream_points_laz`].
pub fn stream_coloured_laz<E: From<CloudError>>(
    path: &Path,
    crs: Option<&str>,
    bounds: &Bounds,
    columns: &[(Dimension<'_>, ExtraType)],
    write: impl FnOnce(&mut PointSink<'_>) -> Result<(), E>,
) -> Result<(), E> {
    stream(path, crs, bounds, columns, Kind::Coloured, write)
}

/// What a new file holds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Points alone.
    Points,
    /// Points with sources and adjusted standard GPS times.
    Scan,
    /// Points with colours.
    Coloured,
}

fn stream<E: From<CloudError>>(
    path: &Path,
    crs: Option<&str>,
    bounds: &Bounds,
    columns: &[(Dimension<'_>, ExtraType)],
    kind: Kind,
    write: impl FnOnce(&mut PointSink<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let descriptors = describe_all(path, columns.iter().copied())?;
    let extra_bytes = columns.iter().map(|(_, kind)| kind.size()).sum();
    let has_color = kind == Kind::Coloured;
    let transforms = transforms_for(bounds, if has_color { SHOWN_M } else { FINEST_M })
        .ok_or_else(|| CloudError::unwritable(path, format!("too large for LAS: {bounds:?}")))?;
    write_whole(path, |partial| {
        let mut header = export_header(has_color, transforms, extra_bytes, descriptors);
        if kind == Kind::Scan {
            header.gps_time_type = GpsTimeType::Standard;
        }
        header.vlrs.extend(crs.and_then(crs_record));
        let mut sink = PointSink {
            path,
            columns,
            has_color,
            bounds: *bounds,
            transforms,
            writer: LazWriter::create(partial, path, header)?,
        };
        write(&mut sink)?;
        Ok(sink.writer.finish()?)
    })
}

/// A LAZ file that takes points.
pub struct PointSink<'a> {
    path: &'a Path,
    columns: &'a [(Dimension<'a>, ExtraType)],
    has_color: bool,
    bounds: Bounds,
    transforms: Vector<Transform>,
    writer: LazWriter,
}

impl PointSink<'_> {
    /// Appends points with the values of their extra dimensions.
    ///
    /// # Errors
    /// A position is not finite or outside the box, a column is missing or has another type or length, or the
    /// file cannot be written.
    pub fn append(
        &mut self,
        positions: &[Point3<f64>],
        columns: &[ExtraColumn<'_>],
    ) -> Result<(), CloudError> {
        self.append_records(positions, None, None, columns)
    }

    /// Appends points with the sRGB colour of each, to a file of [`stream_coloured_laz`].
    ///
    /// # Errors
    /// As [`Self::append`], and colours of another length.
    pub fn append_coloured(
        &mut self,
        positions: &[Point3<f64>],
        colours: &[[u8; 3]],
        columns: &[ExtraColumn<'_>],
    ) -> Result<(), CloudError> {
        if colours.len() != positions.len() {
            let reason = format!("{} colours for {} points", colours.len(), positions.len());
            return Err(CloudError::unwritable(self.path, reason));
        }
        self.append_records(positions, None, Some(colours), columns)
    }

    /// Appends points with the source and the time of each.
    ///
    /// # Errors
    /// As [`Self::append`], and sources or times of another length.
    pub fn append_observed(
        &mut self,
        positions: &[Point3<f64>],
        observed: Observed<'_>,
        columns: &[ExtraColumn<'_>],
    ) -> Result<(), CloudError> {
        let (sources, times) = (observed.sources.len(), observed.times.len());
        if sources != positions.len() || times != positions.len() {
            let reason = format!(
                "{sources} sources and {times} times for {} points",
                positions.len()
            );
            return Err(CloudError::unwritable(self.path, reason));
        }
        self.append_records(positions, Some(observed), None, columns)
    }

    fn append_records(
        &mut self,
        positions: &[Point3<f64>],
        observed: Option<Observed<'_>>,
        colours: Option<&[[u8; 3]]>,
        columns: &[ExtraColumn<'_>],
    ) -> Result<(), CloudError> {
        if colours.is_some() != self.has_color {
            let reason = "a file has colours for all of its points or for none";
            return Err(CloudError::unwritable(self.path, reason));
        }
        self.check(positions, columns)?;
        for start in (0..positions.len()).step_by(CHUNK_POINTS) {
            let mut out = Vec::new();
            for (i, position) in positions.iter().enumerate().skip(start).take(CHUNK_POINTS) {
                let record = Export {
                    position: *position,
                    intensity: 0,
                    color: colours.map(|all| all[i].map(|c| u16::from(c) * 257)),
                    source: observed.map_or(0, |o| o.sources[i]),
                    gps_time: observed.map_or(0.0, |o| o.times[i]),
                };
                record.append(&self.transforms, &mut out);
                columns.iter().for_each(|c| c.append(i, &mut out));
            }
            self.writer.write(out)?;
        }
        Ok(())
    }

    fn check(&self, positions: &[Point3<f64>], columns: &[ExtraColumn<'_>]) -> Result<(), CloudError> {
        let fail = |reason: String| Err(CloudError::unwritable(self.path, reason));
        let finite = |p: &Point3<f64>| p.iter().all(|c| c.is_finite());
        if let Some(i) = positions.iter().position(|p| !finite(p)) {
            return fail(format!("point {i} has no position"));
        }
        if let Some(p) = positions.iter().find(|p| !self.bounds.contains(p)) {
            return fail(format!("point {p:?} lies outside {:?}", self.bounds));
        }
        let kinds = columns.iter().map(ExtraColumn::kind);
        if columns.len() != self.columns.len() || !kinds.eq(self.columns.iter().map(|(_, kind)| *kind)) {
            return fail("other dimensions than the file has".to_owned());
        }
        for ((dimension, _), column) in self.columns.iter().zip(columns) {
            if column.len() != positions.len() {
                return fail(format!(
                    "{} values of {:?} for {} points",
                    column.len(),
                    dimension.name,
                    positions.len()
                ));
            }
        }
        Ok(())
    }
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
