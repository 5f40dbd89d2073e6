//! A moment, to the millisecond, in UTC.

use chrono::{DateTime, SecondsFormat, TimeDelta, Utc};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

/// A moment in UTC, in files as `2026-04-30T12:00:00.000Z`: ISO 8601 in the form that the GeoPackage standard
/// prescribes (OGC 12-128, table of data types, DATETIME).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Timestamp(DateTime<Utc>);

impl Timestamp {
    /// Midnight of 1 January 1970.
    pub const EPOCH: Self = Self(DateTime::UNIX_EPOCH);

    /// The present moment.
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let ms = i64::try_from(since.as_millis()).unwrap_or(0);
        Self(DateTime::from_timestamp_millis(ms).unwrap_or_default())
    }

    /// The moment a millisecond later.
    #[must_use]
    pub fn next(self) -> Self {
        Self(self.0 + TimeDelta::milliseconds(1))
    }

    /// The minute, for people: `2026-04-30 12:00 UTC`.
    pub fn minute(&self) -> String {
        self.0.format("%Y-%m-%d %H:%M UTC").to_string()
    }
}

impl fmt::Display for Timestamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.to_rfc3339_opts(SecondsFormat::Millis, true))
    }
}

impl FromStr for Timestamp {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // RFC 3339 leaves a choice of forms; files have one.
        let parsed = DateTime::parse_from_rfc3339(text)
            .ok()
            .map(|moment| Self(moment.to_utc()));
        let moment = parsed.filter(|t| t.to_string() == text);
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
        let at = |seconds: i64| Timestamp(DateTime::from_timestamp(seconds, 0).unwrap());
        // Known instants: the epoch, a leap day, the billennium.
        assert_eq!(at(0).to_string(), "1970-01-01T00:00:00.000Z");
        assert_eq!(at(951_782_400).to_string(), "2000-02-29T00:00:00.000Z");
        assert_eq!(at(1_000_000_000).to_string(), "2001-09-09T01:46:40.000Z");
        assert_eq!(at(1_000_000_000).minute(), "2001-09-09 01:46 UTC");
    }

    #[test]
    fn a_time_reads_back_and_anything_else_is_refused() {
        for ms in (0..4_000_000_000_000).step_by(97_123_456_789) {
            let moment = Timestamp(DateTime::from_timestamp_millis(ms).unwrap());
            assert_eq!(moment.to_string().parse(), Ok(moment));
        }
        for text in [
            "",
            "2026-02-29T00:00:00.000Z",
            "2026-04-30 12:00 UTC",
            "2026-04-30T25:00:00.000Z",
            "2026-04-30T14:00:00.000+02:00",
            "2026-04-30T12:00:00Z",
            "\u{e9}",
        ] {
            assert!(text.parse::<Timestamp>().is_err(), "{text}");
        }
    }
}
