//! Dates of GPS times.

/// Days from 1 January 1970 to 6 January 1980, where GPS time begins.
const GPS_BEGIN: i64 = 3657;
const DAY_S: f64 = 86_400.0;

/// Day and time of day, GPS time (18 s ahead of UTC since 2017), of seconds since 6 January 1980; `None` beyond
/// the years that surveys can be from.
pub fn date_of(seconds: f64) -> Option<String> {
    if !(0.0..4e9).contains(&seconds) {
        return None;
    }
    let (year, month, day) = civil(GPS_BEGIN + (seconds / DAY_S).floor() as i64);
    let second = (seconds % DAY_S) as i64;
    let [hour, minute, second] = [second / 3600, second / 60 % 60, second % 60];
    Some(format!(
        "{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}"
    ))
}

/// Year, month and day of a day counted from 1 January 1970, in the Gregorian calendar (Richards 2013,
/// "Calendars", algorithm 4).
fn civil(day: i64) -> (i64, i64, i64) {
    let j = day + 2_440_588;
    let f = j + 1401 + (4 * j + 274_277) / 146_097 * 3 / 4 - 38;
    let e = 4 * f + 3;
    let g = e % 1461 / 4;
    let h = 5 * g + 2;
    let (d, m) = (h % 153 / 5 + 1, (h / 153 + 2) % 12 + 1);
    (e / 1461 - 4716 + (14 - m) / 12, m, d)
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
