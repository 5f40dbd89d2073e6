//! What is in a cloud file.

use std::path::Path;

use stonewise_core::geometry::Bounds;

use super::gathered::{CHUNK_POINTS, Created};
use super::scan::Scan;
use super::{CloudError, CloudFormat, ReadSummary, Remark, e57_file, las, ply, ptx, read_cloud, text};
use crate::crs::Units;

/// Description of a cloud file.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudInfo {
    /// Family of the file.
    pub format: CloudFormat,
    /// Number of records, points without a position included.
    pub records: u64,
    /// Box around the points, world frame, metres; `None` without points. LAS: as the header says.
    pub bounds: Option<Bounds>,
    /// Coordinate system, where the file names one, in metres: see [`cloud_crs`].
    pub crs: Option<String>,
    /// Units of the file's coordinates; LAS alone states them.
    pub units: Units,
    /// Scans, where the file keeps them apart.
    pub scans: Vec<Scan>,
    /// What is odd about the file, and how it was read all the same.
    pub remarks: Vec<Remark>,
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
    let (summary, bounds) = measure_cloud(path)?;
    Ok(CloudInfo {
        format,
        records: summary.records,
        bounds,
        crs: cloud_crs(path)?,
        units: Units::METRES,
        scans: cloud_scans(path)?,
        remarks: cloud_remarks(path)?,
    })
}

/// The scans that a file keeps apart, with the places of their scanners; LAS has none.
///
/// Cost: PTX and PTS are read from end to end, and nothing but the heads of the others.
///
/// # Errors
/// The file cannot be read, or what says where its scans end is damaged.
pub fn cloud_scans(path: &Path) -> Result<Vec<Scan>, CloudError> {
    match CloudFormat::of(path)? {
        CloudFormat::E57 => Ok(e57_file::scans(path)?.0),
        CloudFormat::Ptx => ptx::scans(path),
        CloudFormat::Text => text::scans(path),
        CloudFormat::Las | CloudFormat::Ply => Ok(Vec::new()),
    }
}

/// Reads all points of a file, and gives the box around them.
///
/// # Errors
/// As [`read_cloud`].
pub fn measure_cloud(path: &Path) -> Result<(ReadSummary, Option<Bounds>), CloudError> {
    let mut bounds: Option<Bounds> = None;
    let summary = read_cloud(path, CHUNK_POINTS, |chunk| {
        if let Some(new) = Bounds::of(chunk.positions.iter().copied()) {
            bounds = Some(bounds.map_or(new, |b| b.union(&new)));
        }
        Ok::<(), CloudError>(())
    })?;
    Ok((summary, bounds))
}

/// The coordinate system of a file's points as they are read, from its head alone: WKT, or a code such as `EPSG:25832`.
///
/// Positions are read in metres, so a system in other units comes as the same projection in metres.
///
/// # Errors
/// The file cannot be read, or its head is damaged.
pub fn cloud_crs(path: &Path) -> Result<Option<String>, CloudError> {
    match CloudFormat::of(path)? {
        CloudFormat::Las => Ok(las::Layout::open(path)?.crs()),
        CloudFormat::E57 => Ok(e57_file::scans(path)?.1),
        CloudFormat::Ptx | CloudFormat::Ply | CloudFormat::Text => Ok(None),
    }
}

/// What is odd about a file, and how it is read all the same, from its head and for text its first point.
///
/// # Errors
/// The file cannot be read, or its head is damaged.
pub fn cloud_remarks(path: &Path) -> Result<Vec<Remark>, CloudError> {
    match CloudFormat::of(path)? {
        CloudFormat::Las => Ok(las::Layout::open(path)?.remarks),
        CloudFormat::E57 => e57_file::remarks(path),
        CloudFormat::Text => text::remarks(path),
        CloudFormat::Ply | CloudFormat::Ptx => Ok(Vec::new()),
    }
}

/// When the first scan of a file began, else when the file was written, from its head alone; `None` for formats that do
/// not say it.
///
/// # Errors
/// The file cannot be read, or its head is damaged.
pub fn cloud_date(path: &Path) -> Result<Option<Created>, CloudError> {
    match CloudFormat::of(path)? {
        CloudFormat::Las => {
            let written = las::Layout::open(path)?.header.date();
            Ok(written.map(|date| Created::Day(date.to_string())))
        }
        CloudFormat::E57 => {
            let scans = e57_file::scans(path)?.0;
            match scans.iter().filter_map(|s| s.begun_s).reduce(f64::min) {
                Some(begun_s) => Ok(Some(Created::Gps(begun_s))),
                None => Ok(e57_file::created_s(path)?.map(Created::Gps)),
            }
        }
        CloudFormat::Ptx | CloudFormat::Ply | CloudFormat::Text => Ok(None),
    }
}

/// How many records a file claims to have, from its head alone; `None` for text and PTX, whose heads claim
/// nothing or only the first scan.
///
/// # Errors
/// The file cannot be read, or its head is damaged.
pub fn claimed_records(path: &Path) -> Result<Option<u64>, CloudError> {
    match CloudFormat::of(path)? {
        CloudFormat::Las => Ok(Some(las::Layout::open(path)?.header.number_of_points())),
        CloudFormat::E57 => Ok(Some(e57_file::scans(path)?.0.iter().map(|s| s.records).sum())),
        CloudFormat::Ply => Ok(Some(ply::vertex_count(path)?)),
        CloudFormat::Ptx | CloudFormat::Text => Ok(None),
    }
}

fn las_info(path: &Path) -> Result<CloudInfo, CloudError> {
    let layout = las::Layout::open(path)?;
    Ok(CloudInfo {
        format: CloudFormat::Las,
        records: layout.header.number_of_points(),
        bounds: layout.bounds(),
        crs: layout.crs(),
        units: layout.system.units,
        scans: Vec::new(),
        remarks: layout.remarks,
    })
}
