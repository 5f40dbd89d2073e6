//! `run.json`: what was run, on what, how, and how long it took.

use crate::error::{Error, Result};
use crate::files::write_readable_json;
use crate::pipeline::context::Context;
use crate::pipeline::crs::coordinate_system;
use crate::pipeline::label::Labelled;
use crate::pipeline::photos::Segmented;
use serde_json::{Value, json};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// Writes `run.json`.
pub fn write_run_record(context: &Context, photos: &[Segmented], labelled: &[Labelled]) -> Result<()> {
    let project = context.project;
    let epochs = project
        .epochs
        .iter()
        .zip(photos.iter().zip(labelled))
        .map(|(epoch, (photos, labelled))| {
            let clouds = epoch
                .clouds
                .iter()
                .map(|c| input(context, c))
                .collect::<Result<Vec<_>>>()?;
            Ok(json!({
                "name": epoch.name,
                "clouds": clouds,
                "cameras": input(context, &epoch.cameras)?,
                "masks": epoch.masks.as_deref().map(|m| input(context, m)).transpose()?,
                "images": epoch.images,
                "motion": epoch.motion,
                "points": labelled.tiled.tiles.surveyed.point_count(),
                "photos": photos.photos.len(),
                "stones": labelled.stones.len(),
            }))
        })
        .collect::<Result<Vec<Value>>>()?;
    let crs = coordinate_system(project)?;
    let record = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "finished_at": utc(SystemTime::now()),
        "crs": crs.map(|c| json!({ "epsg": c.epsg, "name": c.name, "wkt": c.wkt })),
        "project": { "name": project.name, "file": project.path },
        "parameters": project.settings,
        "part": project.part,
        "epochs": epochs,
        "steps": context.times(),
        "warnings": context.warnings.sorted(),
    });
    write_readable_json(&context.out.join("run.json"), &record)
}

fn input(context: &Context, path: &Path) -> Result<Value> {
    let size = std::fs::metadata(path).map_err(Error::io("reading", path))?.len();
    Ok(json!({ "path": path, "bytes": size, "blake3": context.digest(path)? }))
}

/// A time as ISO 8601 in UTC, to the minute. Days to dates after Howard Hinnant, "chrono-compatible low-level date
/// algorithms" (2013), `civil_from_days`.
fn utc(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()) as i64;
    let days = seconds.div_euclid(86_400) + 719_468;
    let (era, day_of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march + 2) / 5 + 1;
    let month = if march < 10 { march + 3 } else { march - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    let (hour, minute) = (seconds.rem_euclid(86_400) / 3600, seconds.rem_euclid(3600) / 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn times_are_those_of_the_calendar() {
        let at = |seconds| utc(UNIX_EPOCH + Duration::from_secs(seconds));
        // Known instants: the epoch, a leap day, the billennium.
        assert_eq!(at(0), "1970-01-01 00:00 UTC");
        assert_eq!(at(951_782_400), "2000-02-29 00:00 UTC");
        assert_eq!(at(1_000_000_000), "2001-09-09 01:46 UTC");
    }
}
