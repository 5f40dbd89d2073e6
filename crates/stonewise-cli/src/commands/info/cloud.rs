//! `info` of a cloud.

use super::described::Described;
use crate::counted::counted;
use anyhow::Result;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;
use stonewise::results::calendar::date_of_gps;
use stonewise_core::geometry::Bounds;
use stonewise_io::cameras::{E57ImageCounts, count_e57_images};
use stonewise_io::cloud::{Clock, CloudDetails, CloudFormat, Created, Rounding, SourcePoints, cloud_details};
use stonewise_io::crs::{Crs, UnitName, Units};

/// Difference of a header's box from that of the points from which on the header is wrong, metres: above all
/// roundings.
const WRONG_BOX_M: f64 = 0.02;
/// Sources that are listed for people.
const MOST_SOURCES: usize = 20;
/// Seconds between the beginning of GPS time and that of adjusted GPS times.
const ADJUSTED_S: f64 = 1e9;

/// Details of a cloud, as `info` prints them.
pub fn cloud(path: &Path) -> Result<Described> {
    let details = cloud_details(path)?;
    let images = match CloudFormat::of(path)? {
        CloudFormat::E57 => Some(count_e57_images(&[path.to_path_buf()])?),
        _ => None,
    };
    let mut described = Described {
        text: text(&details) + &images.as_ref().map_or(String::new(), |i| said_of(i, path)),
        json: json(&details),
    };
    described.json["images"] = json!(images.map(|i| {
        let others: usize = i.left_out.values().sum();
        json!({ "photos": i.photos, "panoramas": i.panoramas, "not_usable": others })
    }));
    Ok(described)
}

/// What images an E57 file holds, and the command that unpacks them.
fn said_of(images: &E57ImageCounts, path: &Path) -> String {
    let kinds = [(images.photos, "photo"), (images.panoramas, "panorama")];
    let kinds: Vec<String> = kinds
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, kind)| counted(count, kind))
        .collect();
    let mut text = String::new();
    if !kinds.is_empty() {
        let (kinds, path) = (kinds.join(" and "), path.display().to_string());
        let path = match path.contains(char::is_whitespace) {
            true => format!("\"{path}\""),
            false => path,
        };
        let _ = writeln!(
            text,
            "  contains {kinds}; to unpack them: stonewise info --unpack-photos {path}"
        );
    }
    for (reason, count) in &images.left_out {
        let _ = writeln!(text, "  {} {reason}", counted(count, "image"));
    }
    text
}

fn text(details: &CloudDetails) -> String {
    let mut text = format!(
        "  {}, {}\n",
        details.format,
        counted(details.summary.records, "point")
    );
    let mut line = |said: String| {
        let _ = writeln!(text, "  {said}");
    };
    if details.summary.skipped > 0 {
        line(format!("{} of them have no position", details.summary.skipped));
    }
    if details.summary.unused > 0 {
        line(format!(
            "{} of them are withheld or noise (classes 7 and 18), and are not used",
            details.summary.unused
        ));
    }
    for remark in &details.remarks {
        line(remark.text.clone());
    }
    if let Some(units) = units(&details.units) {
        line(units);
    }
    if let Some(bounds) = &details.bounds {
        line(extent(bounds));
    }

    if let Some(claimed) = wrong_box(details) {
        line(format!("its header is wrong: it says {}", extent(&claimed)));
    }
    if let Some(rounding) = rounding(&details.rounding) {
        line(rounding);
    }

    if let Some(spacing) = details.spacing_m {
        line(format!(
            "{:.1} mm to the nearest point, in the median",
            spacing * 1000.0
        ));
    }

    let fields = details.fields.iter().map(|field| match field.range {
        Some([low, high]) => format!("{} {} to {}", field.name, short(low), short(high)),
        None => field.name.clone(),
    });
    let fields: Vec<String> = fields.collect();
    if !fields.is_empty() {
        line(format!("fields: {}", fields.join(", ")));
    }

    for scan in &details.scans {
        let place = scan.origin.map_or(String::new(), |p| {
            format!(", scanner at ({:.3}, {:.3}, {:.3})", p.x, p.y, p.z)
        });
        let sensor = scan.sensor.as_ref().map_or(String::new(), |s| format!(", {s}"));
        let begun = scan.begun_s.and_then(date_of_gps);
        let begun = begun.map_or(String::new(), |date| format!(", begun {date} GPS time"));
        let points = counted(scan.records, "point");
        let name = scan.name.strip_prefix("scan ").unwrap_or(&scan.name);
        line(format!("scan {name}: {points}{place}{sensor}{begun}"));
    }

    if details.scans.is_empty() {
        for source in details.sources.iter().take(MOST_SOURCES) {
            let times = source.times.and_then(|t| period(details.clock, t));
            let times = times.map_or(String::new(), |t| format!(", {t}"));
            line(format!(
                "source {}: {}{times}",
                source.number,
                counted(source.points, "point")
            ));
        }
        if details.sources.len() > MOST_SOURCES {
            line(format!(
                "and {} more sources",
                details.sources.len() - MOST_SOURCES
            ));
        }
    }

    match (written(details), &details.software) {
        (Some(date), Some(software)) => line(format!("written {date} by {software}")),
        (Some(date), None) => line(format!("written {date}")),
        (None, Some(software)) => line(format!("written by {software}")),
        (None, None) => {}
    }

    line(match &details.crs {
        Some(crs) => format!("CRS {}", system(crs)),
        None => "no CRS".to_owned(),
    });
    text
}

fn json(details: &CloudDetails) -> serde_json::Value {
    let corners = |b: &Bounds| json!({ "min": b.min.coords.as_slice(), "max": b.max.coords.as_slice() });
    let named = details.crs.as_deref().and_then(Crs::parse);
    let scans = details.scans.iter().map(|scan| {
        let scanner = scan.origin.map(|p| [p.x, p.y, p.z]);
        let begun = scan.begun_s.and_then(date_of_gps);
        json!({
            "name": scan.name, "records": scan.records, "scanner": scanner, "sensor": scan.sensor, "begun": begun,
        })
    });
    let sources = details.sources.iter().map(|source: &SourcePoints| {
        let mut json = json!(source);
        json["dates"] = json!(source.times.and_then(|t| dates(details.clock, t)));
        json
    });

    json!({
        "kind": "cloud",
        "format": details.format,
        "points": details.summary.records,
        "without_position": details.summary.skipped,
        "withheld_or_noise": details.summary.unused,
        "bounds": details.bounds.as_ref().map(corners),
        "unit_m": details.units.plane_m,
        "height_unit_m": details.units.height_m,
        "remarks": details.remarks.iter().map(|r| &r.text).collect::<Vec<_>>(),
        "wrong_header_bounds": wrong_box(details).as_ref().map(corners),
        "rounding": match details.rounding {
            Rounding::Scaled { scale, offset } => json!({ "scale_m": scale, "offset_m": offset }),
            Rounding::Decimals(n) => json!({ "decimals": n }),
            Rounding::Single(step) => json!({ "single_precision_m": step }),
            Rounding::Double => json!(null),
        },
        "spacing_m": details.spacing_m,
        "fields": details.fields,
        "scans": scans.collect::<Vec<_>>(),
        "sources": sources.collect::<Vec<_>>(),
        "clock": details.clock,
        "written": written(details),
        "software": details.software,
        "crs": details.crs,
        "epsg": named.and_then(|crs| crs.epsg),
    })
}

/// Units other than metres.
fn units(units: &Units) -> Option<String> {
    let [plane, height] = [units.plane_m, units.height_m].map(UnitName);
    match units {
        units if units.are_metres() => None,
        units if units.is_geographic => Some(format!("degrees, with heights in {height}")),
        units if units.plane_m == units.height_m => {
            Some(format!("coordinates in {plane}, given here in metres"))
        }
        _ => Some(format!(
            "eastings and northings in {plane}, heights in {height}, given here in metres"
        )),
    }
}

/// When the file was written.
fn written(details: &CloudDetails) -> Option<String> {
    match details.created.as_ref()? {
        Created::Day(day) => Some(day.clone()),
        Created::Gps(seconds) => date_of_gps(*seconds).map(|date| format!("{date} GPS time")),
    }
}

fn wrong_box(details: &CloudDetails) -> Option<Bounds> {
    let (claimed, found) = (details.claimed_bounds?, details.bounds?);
    // The header's box is that of all records.
    if details.summary.unused > 0 {
        return None;
    }
    let error = (claimed.min - found.min)
        .amax()
        .max((claimed.max - found.max).amax());
    (error > WRONG_BOX_M).then_some(claimed)
}

fn extent(bounds: &Bounds) -> String {
    let [min, max] = [bounds.min, bounds.max];
    format!(
        "from {:.3?} to {:.3?} m",
        min.coords.as_slice(),
        max.coords.as_slice()
    )
}

fn rounding(rounding: &Rounding) -> Option<String> {
    match rounding {
        Rounding::Scaled { scale, offset } => {
            Some(format!("coordinates in steps of {scale:?} m from {offset:?} m"))
        }
        Rounding::Decimals(n) => Some(format!("coordinates have {} at most", counted(n, "decimal"))),
        Rounding::Single(step) => Some(format!(
            "coordinates have single precision: the largest are rounded to {} m",
            short(*step)
        )),
        Rounding::Double => None,
    }
}

/// First and last date, GPS time.
fn dates(clock: Clock, times: [f64; 2]) -> Option<[String; 2]> {
    match clock {
        Clock::AdjustedGps => {
            let [first, last] = times.map(|t| date_of_gps(t + ADJUSTED_S));
            Some([first?, last?])
        }
        Clock::GpsWeek | Clock::Unknown => None,
    }
}

fn period(clock: Clock, times: [f64; 2]) -> Option<String> {
    if times == [0.0; 2] {
        return None;
    }
    let of_week = || format!("second {:.0} to {:.0} of the GPS week", times[0], times[1]);
    match dates(clock, times) {
        Some([first, last]) => Some(format!("{first} to {last} GPS time")),
        None => (clock == Clock::GpsWeek).then(of_week),
    }
}

/// Name and code of a system, or what the file says of another.
fn system(text: &str) -> String {
    match Crs::parse(text) {
        Some(crs) if crs.wkt.is_empty() => text.to_owned(),
        Some(crs) => match crs.epsg {
            Some(code) => format!("{} (EPSG:{code})", crs.name),
            None => format!("{}, without a code", crs.name),
        },
        None => text.to_owned(),
    }
}

/// A number with six significant digits at most.
fn short(value: f64) -> String {
    let digits = 5 - value.abs().max(1e-6).log10().floor() as i32;
    let text = format!("{value:.*}", digits.clamp(0, 9) as usize);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_keep_what_counts() {
        let said = [0.0, 833.0, -2047.0, 65_535.0, 0.031_25, 1.5e-5, 413_591_802.75].map(short);
        assert_eq!(
            said,
            ["0", "833", "-2047", "65535", "0.03125", "0.000015", "413591803"]
        );
    }
}
