//! A moment, to the millisecond, in UTC.

use crate::calendar::{civil_from_days, days_from_civil};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

const MS_PER_DAY: i64 = 86_400_000;

/// A moment in UTC, in files as `2026-04-30T12:00:00.000Z`: ISO 8601 in the form that the GeoPackage standard
/// prescribes (OGC 12-128, table of data types, DATETIME).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Timestamp {
    /// Milliseconds since 1970.
    ms: i64,
}

impl Timestamp {
    /// Midnight of 1 January 1970.
    pub const EPOCH: Self = Self { ms: 0 };

    /// The present moment.
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self {
            ms: i64::try_from(since.as_millis()).unwrap_or(0),
        }
    }

    /// The moment a millisecond later.
    #[must_use]
    pub fn next(self) -> Self {
        Self { ms: self.ms + 1 }
    }

    /// The minute, for people: `2026-04-30 12:00 UTC`.
    pub fn minute(&self) -> String {
        let text = self.to_string();
        format!("{} {} UTC", &text[..10], &text[11..16])
    }
}

impl fmt::Display for Timestamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (year, month, day) = civil_from_days(self.ms.div_euclid(MS_PER_DAY));
        let ms = self.ms.rem_euclid(MS_PER_DAY);
        let (hour, minute, second) = (ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60);
        write!(
            f,
            "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{:03}Z",
            ms % 1000
        )
    }
}

impl FromStr for Timestamp {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let part = |from: usize, to: usize| text.get(from..to)?.parse::<i64>().ok();
        let parsed = || {
            let (year, month, day) = (part(0, 4)?, part(5, 7)?, part(8, 10)?);
            let (hour, minute, second, ms) = (part(11, 13)?, part(14, 16)?, part(17, 19)?, part(20, 23)?);
            let in_day = ((hour * 60 + minute) * 60 + second) * 1000 + ms;
            Some(Self {
                ms: days_from_civil(year, month, day) * MS_PER_DAY + in_day,
            })
        };
        // Whatever is out of range or out of place is written differently.
        let moment = parsed().filter(|t| t.to_string() == text);
        moment.ok_or_else(|| format!("{text:?} is no time of the form 2026-04-30T12:00:00.000Z"))
    }
}

impl TryFrom<String> for Timestamp {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Timestamp> for String {
    fn from(moment: Timestamp) -> Self {
        moment.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_calendar() {
        let at = |seconds: i64| Timestamp { ms: seconds * 1000 };
        // Known instants: the epoch, a leap day, the billennium.
        assert_eq!(at(0).to_string(), "1970-01-01T00:00:00.000Z");
        assert_eq!(at(951_782_400).to_string(), "2000-02-29T00:00:00.000Z");
        assert_eq!(at(1_000_000_000).to_string(), "2001-09-09T01:46:40.000Z");
        assert_eq!(at(1_000_000_000).minute(), "2001-09-09 01:46 UTC");
    }

    #[test]
    fn a_time_reads_back_and_anything_else_is_refused() {
        for ms in (0..4_000_000_000_000).step_by(97_123_456_789) {
            let moment = Timestamp { ms };
            assert_eq!(moment.to_string().parse(), Ok(moment));
        }
        for text in [
            "",
            "2026-02-29T00:00:00.000Z",
            "2026-04-30 12:00 UTC",
            "2026-04-30T25:00:00.000Z",
            "\u{e9}",
        ] {
            assert!(text.parse::<Timestamp>().is_err(), "{text}");
        }
    }
}
