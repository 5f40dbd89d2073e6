//! Days of dates, to count with.

use stonewise_results::calendar::{civil_from_days, days_from_civil};

/// Days of a mean year.
pub const DAYS_A_YEAR: f64 = 365.25;

/// The day of an ISO 8601 date, with a time or without, since 1970-01-01. `None` for text that is no date.
pub fn day_of(date: &str) -> Option<f64> {
    let (date, time) = match date.trim().split_once(['T', ' ']) {
        Some((date, time)) => (date, Some(time)),
        None => (date.trim(), None),
    };
    let mut parts = date.split('-');
    let (year, month, day) = (parts.next()?, parts.next()?, parts.next()?);
    if parts.next().is_some() || year.len() != 4 || month.len() != 2 || day.len() != 2 {
        return None;
    }
    let (year, month, day): (i64, i64, i64) = (year.parse().ok()?, month.parse().ok()?, day.parse().ok()?);
    let days = days_from_civil(year, month, day);
    // A day that its month does not have is one of another month.
    if civil_from_days(days) != (year, month, day) {
        return None;
    }
    Some(days as f64 + time.map_or(Some(0.0), part_of_day)?)
}

/// The part of a day of a time `HH:MM` or `HH:MM:SS`; a zone is left out of account.
fn part_of_day(time: &str) -> Option<f64> {
    let clock = time.split(['Z', '+', '-']).next()?;
    let mut parts = clock.split(':').map(|p| p.trim().parse::<f64>().ok());
    let (hours, minutes) = (parts.next()??, parts.next()??);
    let seconds = parts.next().unwrap_or(Some(0.0))?;
    let is_time =
        (0.0..24.0).contains(&hours) && (0.0..60.0).contains(&minutes) && (0.0..61.0).contains(&seconds);
    is_time.then_some((hours + minutes / 60.0 + seconds / 3600.0) / 24.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        // As `date -u -d DATE +%s` divided by 86400 has it.
        for (date, day) in [
            ("1970-01-01", 0.0),
            ("2000-02-29", 11_016.0),
            ("2026-04-10", 20_553.0),
            ("1900-03-01", -25_508.0),
            ("2026-04-10T12:00:00Z", 20_553.5),
            ("2026-04-10 18:00", 20_553.75),
        ] {
            assert_eq!(day_of(date), Some(day), "{date}");
        }
        for text in [
            "",
            "2026",
            "2025-02-29",
            "10.04.2026",
            "2026-13-01",
            "2026-4-1",
            "2026-04-10T25:00",
        ] {
            assert_eq!(day_of(text), None, "{text}");
        }
    }
}
