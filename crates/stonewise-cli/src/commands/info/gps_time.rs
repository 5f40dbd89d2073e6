//! Dates of GPS times.

use stonewise::results::calendar::civil_from_days;

/// Days from 1 January 1970 to 6 January 1980, where GPS time begins.
const GPS_BEGIN: i64 = 3657;
const DAY_S: f64 = 86_400.0;

/// Day and time of day, GPS time (18 s ahead of UTC since 2017), of seconds since 6 January 1980; `None` beyond
/// the years that surveys can be from.
pub fn date_of(seconds: f64) -> Option<String> {
    if !(0.0..4e9).contains(&seconds) {
        return None;
    }
    let (year, month, day) = civil_from_days(GPS_BEGIN + (seconds / DAY_S).floor() as i64);
    let second = (seconds % DAY_S) as i64;
    let [hour, minute, second] = [second / 3600, second / 60 % 60, second % 60];
    Some(format!(
        "{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let at = |seconds| date_of(seconds).unwrap();
        assert_eq!(at(0.0), "1980-01-06 00:00:00");
        // 10^9 s of GPS time ended on 14 September 2011, 01:46:40.
        assert_eq!(at(1e9), "2011-09-14 01:46:40");
        // Rollovers of the week's number, after 1024 and 2048 weeks.
        assert_eq!(at(1024.0 * 7.0 * DAY_S), "1999-08-22 00:00:00");
        assert_eq!(at(2048.0 * 7.0 * DAY_S - 1.0), "2019-04-06 23:59:59");
        assert_eq!(date_of(-1.0), None);
    }
}
