//! The file of conditions: dates with levels, temperatures and what else was read.

use crate::dated_csv::DatedCsv;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_base::error::Result;
use stonewise_base::messages::Said;
use stonewise_base::messages::notices::{CONDITION_AFTER, CONDITION_BEFORE, CONDITION_BETWEEN};
use stonewise_results::calendar::day_of;

/// Readings by the name of their column.
#[derive(Clone, Debug)]
pub struct ConditionsFile {
    /// Where it lies.
    pub path: PathBuf,
    /// Readings of each column: day and value, ascending by day.
    columns: BTreeMap<String, Vec<(f64, f64)>>,
    /// Longest time between two readings that is interpolated, days.
    longest_gap_days: f64,
}

/// What the file says of a day.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConditionsAt {
    /// Values by column.
    pub values: BTreeMap<String, f64>,
    /// Columns without a value on that day, and why.
    pub gaps: Vec<(String, Said)>,
}

impl ConditionsFile {
    /// Reads a [CSV file](stonewise_io::table::CsvFile) whose first line names the columns, `date` first among equals,
    /// and whose cells are numbers or empty.
    ///
    /// # Errors
    /// With the line: no dates, a cell that is no number, dates that go back.
    pub fn read(path: &Path, longest_gap_days: f64) -> Result<Self> {
        let table = DatedCsv::read(path, "reading the file of conditions")?;
        let mut columns: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
        let mut before = f64::NEG_INFINITY;
        for row in table.rows() {
            let row = row?;
            if row.day < before {
                let message = format!("{} stands after a later date: sort the lines by date", row.date);
                return Err(row.error(message));
            }
            before = row.day;
            let head = table.file.head().iter().enumerate();
            for (column, name) in head.filter(|(column, _)| *column != table.of_date) {
                if let Some(value) = row.number(column)? {
                    columns.entry(name.clone()).or_default().push((row.day, value));
                }
            }
        }
        if columns.is_empty() {
            return Err(table.error("no readings: add a column, such as reservoir_level_m"));
        }
        Ok(Self {
            path: path.to_path_buf(),
            columns,
            longest_gap_days,
        })
    }

    /// The conditions of a day, interpolated linearly between the readings before and after it; of several readings of
    /// one moment the last counts. Nothing is said beyond the first and last reading, or where two readings lie too far
    /// apart.
    pub fn at(&self, date: &str) -> ConditionsAt {
        let mut found = ConditionsAt::default();
        let Some(day) = day_of(date) else {
            return found;
        };
        let file = self.path.file_name().unwrap_or_default().to_string_lossy();
        for (name, readings) in &self.columns {
            let after = readings.partition_point(|r| r.0 <= day);
            let before = after.checked_sub(1).map(|i| readings[i]);
            let value = match (before, readings.get(after)) {
                (Some((at, value)), _) if at == day => Ok(value),
                (Some((from, low)), Some((to, high))) if to - from <= self.longest_gap_days => {
                    Ok(low + (high - low) * (day - from) / (to - from))
                }
                (Some((from, _)), Some((to, _))) => Err((&CONDITION_BETWEEN, to - from)),
                (None, _) => Err((&CONDITION_BEFORE, 0.0)),
                (_, None) => Err((&CONDITION_AFTER, 0.0)),
            };
            match value {
                Ok(value) => {
                    found.values.insert(name.clone(), value);
                }
                Err((gap, days)) => {
                    let words = [
                        ("file", file.as_ref().into()),
                        ("name", name.as_str().into()),
                        ("date", date.into()),
                        ("days", Said::numbers(format!("{days:.0}"))),
                        ("longest", self.longest_gap_days.to_string().into()),
                    ];
                    found.gaps.push((name.clone(), gap.say(&words)));
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ConditionsFile> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("levels.csv");
        std::fs::write(&path, text).unwrap();
        ConditionsFile::read(&path, 7.0)
    }

    const LEVELS: &str = "date,reservoir_level_m,temperature_c\n2025-04-01,312.0,\n2025-04-05,314.0,8\n\n2025-05-20,300,20\n\
                          2025-05-21,301,\n";

    #[test]
    fn the_column_of_dates_may_have_any_name() {
        for text in [
            "Datum;Pegel_m\n09.04.2024;312,40\n",
            "DATE,Pegel_m\n2024-04-09,312.4\n",
            "Pegel_m;fecha\n312,4;09.04.2024\n",
        ] {
            let file = read(text).unwrap();
            assert_eq!(
                file.at("2024-04-09").values,
                BTreeMap::from([("Pegel_m".to_owned(), 312.4)]),
                "{text}"
            );
        }
        let two = read("Beginn;Ende;Pegel_m\n2024-04-09;2024-04-10;312\n").unwrap_err();
        assert!(two.to_string().contains("one of them `date`"), "{two}");
    }

    #[test]
    fn readings_are_interpolated_between_near_days_and_nowhere_else() {
        let file = read(LEVELS).unwrap();
        let at = |date: &str| file.at(date);
        assert_eq!(at("2025-04-02").values["reservoir_level_m"], 312.5);
        assert_eq!(at("2025-04-05").values["temperature_c"], 8.0);
        assert_eq!(at("2025-05-20T12:00:00").values["reservoir_level_m"], 300.5);
        let gap = at("2025-05-01");
        assert!(gap.values.is_empty());
        assert!(
            gap.gaps[0]
                .1
                .english
                .contains("levels.csv: no reservoir_level_m on 2025-05-01")
                && gap.gaps[0].1.english.contains("45 days")
        );
        assert!(at("2025-03-31").gaps[0].1.english.contains("before its readings"));
        assert!(at("2025-05-22").gaps[0].1.english.contains("after its readings"));
        // A reading of the day itself needs no other.
        assert_eq!(at("2025-05-21").values["reservoir_level_m"], 301.0);
    }

    #[test]
    fn what_a_german_spreadsheet_writes_says_the_same() {
        let german = "\u{feff}date;reservoir_level_m;\"temperature_c\"\r\n01.04.2025;312,0;\r\n05.04.2025 00:00;314;8,0\r\n\r\n\
                      20.05.2025;300,0;20\r\n21.05.2025;301;\r\n;;\r\n";
        let [english, german] = [LEVELS, german].map(|text| read(text).unwrap());
        assert_eq!(english.columns, german.columns);
        // A quoted cell with a comma in it.
        let quoted = read("date,\"level, m\"\n2025-04-01,312\n").unwrap();
        assert_eq!(quoted.at("2025-04-01").values["level, m"], 312.0);
    }

    #[test]
    fn mistakes_are_named_with_line_and_fix() {
        for (text, message) in [
            (
                "day,level\n",
                "levels.csv:1: the first line must name the columns",
            ),
            ("date\n2025-01-01\n", "levels.csv:1: no readings"),
            ("date,a,a\n", "levels.csv:1: two columns are named \"a\""),
            (
                "date,a\n2025-01-01,1\n2025-01-02,x\n",
                "levels.csv:3: a: \"x\" is no number",
            ),
            (
                "date,a\n31.02.2025,1\n",
                "levels.csv:2: \"31.02.2025\" is no date",
            ),
            (
                "date;a\n2025-01-01;\"1\n",
                "levels.csv:2: a quote is opened and never closed",
            ),
            (
                "date,a\n2025-01-01,1,5\n",
                "levels.csv:2: 3 cells, but the first line names 2 columns",
            ),
            (
                "date,a\n2025-01-02,1\n2025-01-01,1\n",
                "levels.csv:3: 2025-01-01 stands after a later date",
            ),
        ] {
            let found = read(text).unwrap_err().to_string();
            assert!(found.contains(message), "{found}");
        }
    }
}
