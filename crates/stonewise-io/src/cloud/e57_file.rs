//! E57 files: several scans, each with its pose.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use e57::{CartesianCoordinate, E57Reader, Point, PointCloud, RecordDataType, RecordName};
use nalgebra::{Point3, Quaternion};
use stonewise_core::geometry::rotation_of;

use super::chunk::{Chunker, PointRecord, Visit};
use super::guard::guarded;
use super::scan::Scan;
use super::{CloudError, ReadSummary, Remark};

/// Points decoded between two checks for an interruption.
const STEP_POINTS: usize = 8192;

type Reader = E57Reader<BufReader<File>>;

/// Passes the points of all scans to `visit`, scan after scan, in the world frame.
pub fn read<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    visit: Visit<'_, E>,
) -> Result<ReadSummary, E> {
    let mut reader = open(path)?;
    let mut chunker = Chunker::new(chunk_points, false, false, visit);
    for (number, scan) in posed(path, &reader)?.iter().enumerate() {
        let has = |name| scan.prototype.iter().any(|record| record.name == name);
        chunker.begin_scan(number, has(RecordName::ColorRed), has(RecordName::Intensity))?;
        read_scan(path, &mut reader, scan, &mut chunker)?;
    }
    chunker.finish()
}

/// The scans and the coordinate system of a file.
pub fn scans(path: &Path) -> Result<(Vec<Scan>, Option<String>), CloudError> {
    let reader = open(path)?;
    let scans = reader.pointclouds();
    let describe = |(number, scan): (usize, &PointCloud)| Scan {
        name: name_of(number, scan),
        records: scan.records,
        origin: scan.transform.as_ref().map(|pose| {
            let t = &pose.translation;
            Point3::new(t.x, t.y, t.z)
        }),
        sensor: {
            let parts = [&scan.sensor_vendor, &scan.sensor_model, &scan.sensor_serial];
            let parts: Vec<&str> = parts.into_iter().flatten().map(|p| p.trim()).collect();
            Some(parts.join(" ").trim().to_owned()).filter(|s| !s.is_empty())
        },
        begun_s: scan.acquisition_start.as_ref().map(|t| t.gps_time),
    };
    let crs = reader.coordinate_metadata().map(str::trim);
    let crs = crs.filter(|text| !text.is_empty()).map(str::to_owned);
    Ok((scans.iter().enumerate().map(describe).collect(), crs))
}

/// Scans whose pose has no rotation in it.
pub fn remarks(path: &Path) -> Result<Vec<Remark>, CloudError> {
    let reader = open(path)?;
    posed(path, &reader)?;
    let scans = reader.pointclouds().into_iter().enumerate();
    let unturned = scans.filter(|(_, scan)| {
        scan.transform
            .as_ref()
            .is_some_and(|t| is_zero(&quaternion(&t.rotation)))
    });
    let remark = |(number, scan): (usize, PointCloud)| {
        let name = name_of(number, &scan);
        Remark::note(format!(
            "the rotation of {name} is zero, which is none: read as not turned"
        ))
    };
    Ok(unturned.map(remark).collect())
}

/// When a file was written, seconds of GPS time.
pub fn created_s(path: &Path) -> Result<Option<f64>, CloudError> {
    Ok(open(path)?.creation().map(|t| t.gps_time))
}

fn open(path: &Path) -> Result<Reader, CloudError> {
    let file = File::open(path).map_err(|e| CloudError::read(path, e))?;
    guarded(path, || {
        E57Reader::new(BufReader::with_capacity(1 << 20, file)).map_err(|e| e57_error(path, &e))
    })
}

fn name_of(number: usize, scan: &PointCloud) -> String {
    scan.name
        .clone()
        .unwrap_or_else(|| format!("scan {}", number + 1))
}

/// The scans with rotations of unit length; a quaternion of zeros turns nothing.
fn posed(path: &Path, reader: &Reader) -> Result<Vec<PointCloud>, CloudError> {
    let mut scans = reader.pointclouds();
    for (number, scan) in scans.iter_mut().enumerate() {
        let Some(pose) = &mut scan.transform else {
            continue;
        };
        let stated = quaternion(&pose.rotation);
        if is_zero(&stated) {
            pose.rotation = e57::Quaternion::default();
        } else if let Some(turn) = rotation_of(stated) {
            let [x, y, z, w] = turn.coords.into();
            pose.rotation = e57::Quaternion { w, x, y, z };
        } else {
            let reason = format!(
                "the rotation of {} is a quaternion of length {}, which must be 1: export it again",
                name_of(number, scan),
                stated.norm()
            );
            return Err(CloudError::malformed(path, reason));
        }
    }
    Ok(scans)
}

fn quaternion(q: &e57::Quaternion) -> Quaternion<f64> {
    Quaternion::new(q.w, q.x, q.y, q.z)
}

fn is_zero(quaternion: &Quaternion<f64>) -> bool {
    quaternion.norm() == 0.0
}

fn read_scan<E: From<CloudError>>(
    path: &Path,
    reader: &mut Reader,
    scan: &PointCloud,
    chunker: &mut Chunker<'_, E>,
) -> Result<(), E> {
    if scan.records > 0 && scan.prototype.iter().all(|record| is_constant(&record.data_type)) {
        // Points without a bit of data have no end.
        let name = scan.name.as_deref().unwrap_or("without a name");
        let reason =
            format!("all values of scan {name} are constants, so that nothing tells its points apart");
        return Err(CloudError::malformed(path, reason).into());
    }
    let mut points = guarded(path, || {
        reader.pointcloud_simple(scan).map_err(|e| e57_error(path, &e))
    })?;
    points.intensity_to_color(false);
    points.normalize_intensity(has_intensity_range(scan));
    loop {
        let step: Vec<Point> = guarded(path, || {
            let step = points.by_ref().take(STEP_POINTS).collect::<Result<_, _>>();
            step.map_err(|e| e57_error(path, &e))
        })?;
        if step.is_empty() {
            return Ok(());
        }
        for point in &step {
            chunker.push(record(point))?;
        }
    }
}

/// Whether a scan says between which values its intensities lie; the range of all floats is none.
fn has_intensity_range(scan: &PointCloud) -> bool {
    let limits = scan.intensity_limits.as_ref();
    let are_stated = limits.is_some_and(|l| l.intensity_min.is_some() && l.intensity_max.is_some());
    let field = scan
        .prototype
        .iter()
        .find(|record| record.name == RecordName::Intensity);
    are_stated
        || field.is_some_and(|field| match field.data_type {
            RecordDataType::Single { min, max } => min.is_some() && max.is_some(),
            RecordDataType::Double { min, max } => min.is_some() && max.is_some(),
            RecordDataType::Integer { .. } | RecordDataType::ScaledInteger { .. } => true,
        })
}

/// Whether values of a type take no bits.
fn is_constant(kind: &RecordDataType) -> bool {
    match kind {
        RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => min == max,
        RecordDataType::Single { .. } | RecordDataType::Double { .. } => false,
    }
}

fn record(point: &Point) -> PointRecord {
    let position = match point.cartesian {
        CartesianCoordinate::Valid { x, y, z } => Some(Point3::new(x, y, z)),
        CartesianCoordinate::Direction { .. } | CartesianCoordinate::Invalid => None,
    };
    let to_16_bit = |value: f32| (value * 65535.0).round() as u16;
    PointRecord {
        position,
        color: point
            .color
            .as_ref()
            .map(|c| [c.red, c.green, c.blue].map(to_16_bit)),
        // A constant intensity has no range to scale it by.
        intensity: point.intensity.filter(|i| i.is_finite()),
    }
}

fn e57_error(path: &Path, error: &e57::Error) -> CloudError {
    CloudError::malformed(path, error.to_string())
}
