//! What is in a cloud file.

use std::path::Path;

use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

use super::{CloudError, CloudFormat, e57_file, las, read_cloud};

/// Points per chunk of a pass that only looks.
const CHUNK_POINTS: usize = 100_000;

/// Description of a cloud file.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudInfo {
    /// Family of the file.
    pub format: CloudFormat,
    /// Number of records, points without a position included.
    pub records: u64,
    /// Box around the points, world frame; `None` without points. LAS: as the header says.
    pub bounds: Option<Bounds>,
    /// Coordinate system, where the file names one: WKT, or a code such as `EPSG:25832`.
    pub crs: Option<String>,
    /// Scans of an E57 file; empty for the others.
    pub scans: Vec<Scan>,
}

/// One scan of an E57 file.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Its name, or its number where it has none.
    pub name: String,
    /// Number of records.
    pub records: u64,
    /// Position of the scanner in the world frame, where the file has a pose.
    pub origin: Option<Point3<f64>>,
}

/// Describes a cloud file.
///
/// Cost: LAS, LAZ and COPC need their header only; the other formats are read once from end to end.
///
/// # Errors
/// As [`read_cloud`].
pub fn cloud_info(path: &Path) -> Result<CloudInfo, CloudError> {
    let format = CloudFormat::of(path)?;
    if format == CloudFormat::Las {
        return las_info(path);
    }
    let mut bounds: Option<Bounds> = None;
    let summary = read_cloud(path, CHUNK_POINTS, |chunk| {
        if let Some(new) = Bounds::of(chunk.positions.iter().copied()) {
            bounds = Some(bounds.map_or(new, |b| b.union(&new)));
        }
        Ok::<(), CloudError>(())
    })?;
    let (scans, crs) = match format {
        CloudFormat::E57 => e57_file::scans(path)?,
        _ => Default::default(),
    };
    Ok(CloudInfo {
        format,
        records: summary.records,
        bounds,
        crs,
        scans,
    })
}

fn las_info(path: &Path) -> Result<CloudInfo, CloudError> {
    let layout = las::Layout::open(path)?;
    let records = layout.header.number_of_points();
    let ::las::Bounds { min, max } = layout.header.bounds();
    let bounds = Bounds {
        min: Point3::new(min.x, min.y, min.z),
        max: Point3::new(max.x, max.y, max.z),
    };
    Ok(CloudInfo {
        format: CloudFormat::Las,
        records,
        bounds: (records > 0).then_some(bounds),
        crs: layout.crs(),
        scans: Vec::new(),
    })
}
