//! Days of the Gregorian calendar, to count with.

use chrono::{DateTime, Datelike, NaiveDate, NaiveDateTime, NaiveTime, TimeDelta, Timelike};

/// Days of a mean year.
pub const DAYS_A_YEAR: f64 = 365.25;

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;
/// Seconds from 1970-01-01 to 1980-01-06, where GPS time begins.
const GPS_BEGIN_S: f64 = 315_964_800.0;

/// The day of an ISO 8601 date, with a time or without, since 1970-01-01. `None` for text that is no date.
pub fn day_of(date: &str) -> Option<f64> {
    day_in_form(date, "%Y-%m-%d")
}

/// As [`day_of`], of a date in a table: ISO 8601, or 10.04.2026 as spreadsheets in German write it.
pub fn day_of_cell(date: &str) -> Option<f64> {
    day_of(date).or_else(|| day_in_form(date, "%d.%m.%Y"))
}

/// Text of ten characters in a form of date, and behind it a time or nothing.
fn day_in_form(text: &str, form: &str) -> Option<f64> {
    let (date, time) = match text.trim().split_once(['T', ' ']) {
        Some((date, time)) => (date, Some(time)),
        None => (text.trim(), None),
    };
    let day = NaiveDate::parse_from_str(date, form)
        .ok()
        .filter(|_| date.len() == 10)?;
    Some(f64::from(day.to_epoch_days()) + time.map_or(Some(0.0), part_of_day)?)
}

/// The part of a day of a time `HH:MM` or `HH:MM:SS`; a zone is left out of account.
fn part_of_day(time: &str) -> Option<f64> {
    let clock = time.split(['Z', '+', '-']).next()?.trim();
    let time = ["%H:%M:%S%.f", "%H:%M"]
        .iter()
        .find_map(|form| NaiveTime::parse_from_str(clock, form).ok())?;
    Some((f64::from(time.num_seconds_from_midnight()) + 1e-9 * f64::from(time.nanosecond())) / DAY_S)
}

/// The ISO 8601 date of a day since 1970-01-01; a part of a day does not count. `None` far beyond all surveys.
pub fn date_of(day: f64) -> Option<String> {
    Some(moment(day.floor() * DAY_S)?.date().to_string())
}

/// Day and time of GPS time (18 s ahead of UTC since 2017), counted in seconds since 1980-01-06, to the second.
/// `None` beyond the years that surveys can be from.
pub fn date_of_gps(seconds: f64) -> Option<String> {
    let is_sound = (0.0..4e9).contains(&seconds);
    Some(moment(GPS_BEGIN_S + seconds).filter(|_| is_sound)?.to_string())
}

/// The year of an ISO 8601 date with the part of it that has passed, whatever the time of the day.
pub fn year_of(date: &str) -> Option<f64> {
    let day = NaiveDate::parse_from_str(date.get(..10)?, "%Y-%m-%d").ok()?;
    let length = if day.leap_year() { 366.0 } else { 365.0 };
    Some(f64::from(day.year()) + f64::from(day.ordinal0()) / length)
}

/// A moment in seconds since 1970, without the part of a second.
fn moment(seconds: f64) -> Option<NaiveDateTime> {
    let seconds = TimeDelta::try_seconds(seconds.floor() as i64)?;
    DateTime::UNIX_EPOCH.naive_utc().checked_add_signed(seconds)
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
        ] {
            assert_eq!(
                (day_of(date), date_of(day + 0.9)),
                (Some(day), Some(date.to_owned())),
                "{date}"
            );
        }
        for time in ["T12:00:00Z", " 12:00", "T12:00:00.0+02:00"] {
            assert_eq!(day_of(&format!("2026-04-10{time}")), Some(20_553.5), "{time}");
        }
        for text in [
            "",
            "2026",
            "2025-02-29",
            "10.04.2026",
            "2026-13-01",
            "2026-4-1",
            "2026-04-10T25:00",
            "2026-04-10T",
            "\u{e9}",
        ] {
            assert_eq!(day_of(text), None, "{text}");
        }
    }

    #[test]
    fn tables_may_hold_dates_as_spreadsheets_write_them() {
        for (german, iso) in [
            ("29.02.2024", "2024-02-29"),
            ("10.04.2026 18:00", "2026-04-10T18:00:00"),
        ] {
            assert_eq!(day_of_cell(german), day_of(iso), "{german}");
            assert_eq!(day_of_cell(iso), day_of(iso), "{iso}");
        }
        for text in [
            "29.02.2025",
            "04/10/2026",
            "10.04.26",
            "10.4.",
            "10.04.2026 25:00",
        ] {
            assert_eq!(day_of_cell(text), None, "{text}");
        }
    }

    #[test]
    fn years_have_their_own_length() {
        assert_eq!(
            [year_of("2024-07-02T08:00"), year_of("soon")],
            [Some(2024.5), None]
        );
        assert_eq!(year_of("2023-01-01"), Some(2023.0));
        assert_eq!(year_of("2023-12-31"), Some(2023.0 + 364.0 / 365.0));
    }

    #[test]
    fn gps_time_is_that_of_the_calendar() {
        let week = 7.0 * DAY_S;
        for (seconds, date) in [
            (0.0, "1980-01-06 00:00:00"),
            // 10^9 s of GPS time ended on 14 September 2011, 01:46:40.
            (1e9, "2011-09-14 01:46:40"),
            // Rollovers of the week's number, after 1024 and 2048 weeks.
            (1024.0 * week, "1999-08-22 00:00:00"),
            (2048.0 * week - 0.5, "2019-04-06 23:59:59"),
        ] {
            assert_eq!(date_of_gps(seconds).as_deref(), Some(date));
        }
        for seconds in [-1.0, 5e9, f64::INFINITY, f64::NAN] {
            assert_eq!(date_of_gps(seconds), None);
        }
    }
}
