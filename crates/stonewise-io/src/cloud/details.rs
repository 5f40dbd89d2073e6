//! Details of a cloud file: format, fields, sources, spacing, scanners, dates.

use std::path::Path;

use stonewise_core::geometry::Bounds;

use super::gathered::{CHUNK_POINTS, Clock, Created, FieldRange, Gathered, Head, Rounding, SourcePoints};
use super::{
    CloudError, CloudFormat, ReadSummary, Remark, Scan, cloud_crs, cloud_remarks, cloud_scans, e57_file, las,
    read_cloud,
};
use crate::crs::Units;

/// A cloud file, read from end to end.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudDetails {
    /// Family, version and kind of points.
    pub format: String,
    /// Program that wrote the file, where it says so.
    pub software: Option<String>,
    /// Records, and those without a position.
    pub summary: ReadSummary,
    /// Box around the points.
    pub bounds: Option<Bounds>,
    /// Box that the header claims, where it claims one.
    pub claimed_bounds: Option<Bounds>,
    /// Coordinate system as the file names it: WKT, or a code such as `EPSG:25832`.
    pub crs: Option<String>,
    /// Units of the file's coordinates; everything here is in metres.
    pub units: Units,
    /// Values of the points other than their positions.
    pub fields: Vec<FieldRange>,
    /// Scans that the file keeps apart.
    pub scans: Vec<Scan>,
    /// Stations or strips, by point source ID or scan.
    pub sources: Vec<SourcePoints>,
    /// Median distance from a point to the nearest other one, metres, of a sample.
    pub spacing_m: Option<f64>,
    /// What coordinates are rounded to, metres.
    pub rounding: Rounding,
    /// When the file was written.
    pub created: Option<Created>,
    /// What times count from.
    pub clock: Clock,
    /// What is odd about the file, and how it was read all the same.
    pub remarks: Vec<Remark>,
}

/// Reads a cloud from end to end.
///
/// # Errors
/// As [`read_cloud`].
pub fn cloud_details(path: &Path) -> Result<CloudDetails, CloudError> {
    let format = CloudFormat::of(path)?;
    let mut gathered = Gathered::default();
    let (summary, head) = if format == CloudFormat::Las {
        las::details(path, &mut gathered)?
    } else {
        let summary = read_cloud(path, CHUNK_POINTS, |chunk| {
            gathered.add(chunk);
            Ok::<(), CloudError>(())
        })?;
        let created = match format {
            CloudFormat::E57 => e57_file::created_s(path)?.map(Created::Gps),
            _ => None,
        };
        let head = Head {
            format: format.to_string(),
            created,
            crs: cloud_crs(path)?,
            remarks: cloud_remarks(path)?,
            ..Head::default()
        };
        (summary, head)
    };

    Ok(CloudDetails {
        format: head.format,
        software: head.software,
        summary,
        bounds: gathered.bounds,
        claimed_bounds: head.claimed_bounds,
        crs: head.crs,
        units: head.units.unwrap_or(Units::METRES),
        fields: gathered.fields.list,
        scans: cloud_scans(path)?,
        sources: gathered.sources.into_values().collect(),
        spacing_m: gathered.spacing.median_m(),
        rounding: head.rounding.unwrap_or_else(|| gathered.steps.rounding()),
        created: head.created,
        clock: head.clock,
        remarks: head.remarks,
    })
}
