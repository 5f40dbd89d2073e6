//! Everything that the records of a LAS file hold.

use std::path::Path;

use las::{GpsTimeType, Transform};

use super::read::{LasSource, fill_chunk};
use crate::cloud::extra_bytes::existing;
use crate::cloud::gathered::{CHUNK_POINTS, Clock, Created, Gathered, Head, Rounding};
use crate::cloud::{CloudError, PointChunk, ReadSummary};

/// Gathers all points and returns what the header says of them.
pub fn details(path: &Path, gathered: &mut Gathered) -> Result<(ReadSummary, Head), CloudError> {
    let mut source = LasSource::open(path)?;
    let head = head(&source);
    let header = &source.layout.header;
    let format = *header.point_format();
    let extra = existing(
        header.vlrs().iter().chain(&source.layout.extended),
        format.extra_bytes,
    );
    let units = source.layout.system.units;
    let mut chunk = PointChunk::default();
    let mut summary = ReadSummary::default();
    while let Some((first, data)) = source.next(CHUNK_POINTS)? {
        summary += fill_chunk(&mut chunk, first, data, units);
        gathered.add(&chunk);
        let fields = &mut gathered.fields;
        fields.extend("return_number", data.return_number().map(f64::from));
        fields.extend("number_of_returns", data.number_of_returns().map(f64::from));
        fields.extend("classification", data.classification().map(f64::from));
        fields.extend("scan_angle_degrees", data.scan_angle_degrees().map(f64::from));
        fields.extend("user_data", data.user_data().map(f64::from));
        if let Some(nir) = data.nir() {
            fields.extend("nir", nir.map(f64::from));
        }
        let own = usize::from(format.len() - format.extra_bytes);
        for dimension in &extra {
            let name = String::from_utf8_lossy(dimension.name());
            let bytes = own + dimension.bytes.start..own + dimension.bytes.end;
            let records = data.raw_bytes().chunks_exact(data.record_len());
            match dimension.number() {
                Some(number) => fields.extend(&name, records.map(|r| number.of(&r[bytes.clone()]))),
                None => fields.extend(&name, std::iter::empty()),
            }
        }
    }
    Ok((summary, head))
}

fn head(source: &LasSource) -> Head {
    let header = &source.layout.header;
    let format = header.point_format();
    let records = || header.vlrs().iter().chain(&source.layout.extended);
    let family = if records().any(|r| r.user_id == "copc") {
        "COPC"
    } else if format.is_compressed || records().any(|r| r.user_id == "laszip encoded") {
        "LAZ"
    } else {
        "LAS"
    };
    let number = format.to_u8().unwrap_or_default() & 0x3f;
    let transforms = header.transforms();
    let axes = [transforms.x, transforms.y, transforms.z];
    let step_m: [f64; 3] = source.layout.system.units.step_m().into();
    let in_metres = |of: fn(&Transform) -> f64| std::array::from_fn(|k| of(&axes[k]) * step_m[k]);
    let software = header.generating_software().trim();
    Head {
        format: format!("{family} {}, point format {number}", header.version()),
        software: Some(software.to_owned()).filter(|s| !s.is_empty()),
        created: header.date().map(|date| Created::Day(date.to_string())),
        clock: match header.gps_time_type() {
            GpsTimeType::Week => Clock::GpsWeek,
            GpsTimeType::Standard => Clock::AdjustedGps,
        },
        rounding: Some(Rounding::Scaled {
            scale: in_metres(|t| t.scale),
            offset: in_metres(|t| t.offset),
        }),
        crs: source.layout.system.text.clone(),
        units: Some(source.layout.system.units),
        claimed_bounds: source.layout.bounds(),
        remarks: source.layout.remarks.clone(),
    }
}
