//! Files of other instruments: pendulums, targets, levelling.

use crate::dated_csv::{DatedCsv, DatedRow};
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_base::error::Result;
use stonewise_results::calendar::day_of;

/// Columns that a file has beside those of the axes.
const PLACE: [&str; 5] = ["name", "x", "y", "z", "date"];
/// Columns of the axes: what was measured, and its standard deviation.
const AXES: [[&str; 2]; 3] = [["dx", "sd_x"], ["dy", "sd_y"], ["dz", "sd_z"]];
/// How far the places of one instrument in two lines may lie apart, metres.
const SAME_PLACE_M: f64 = 1e-3;

/// A file of instruments.
#[derive(Clone, Debug)]
pub struct InstrumentFile {
    /// Where it lies.
    pub path: PathBuf,
    /// Whether the instruments are observations of the datum.
    pub is_used: bool,
    /// How far from an instrument stones are compared with it, metres.
    pub reach_m: f64,
    /// Longest time between two readings that is interpolated, days.
    longest_gap_days: f64,
    /// The instruments by name.
    pub instruments: Vec<Instrument>,
}

/// What an instrument measures at one place.
#[derive(Clone, Debug)]
pub struct Instrument {
    /// Its name.
    pub name: String,
    /// Where it is, in the frame of the clouds.
    pub place: Point3<f64>,
    /// Readings of each axis of the world, ascending by day.
    axes: [Vec<Reading>; 3],
}

#[derive(Clone, Copy, Debug)]
struct Reading {
    day: f64,
    value_m: f64,
    sd_m: f64,
}

/// What an instrument moved between two dates, along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMotion {
    /// Metres.
    pub value_m: f64,
    /// Its variance, m^2.
    pub variance_m2: f64,
}

/// Why an instrument does not say what it moved between two epochs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReadingGap {
    /// An epoch has no date.
    NoDate,
    /// An epoch lies before the first reading.
    Before,
    /// An epoch lies after the last reading.
    After,
    /// The readings before and after an epoch lie this number of days apart.
    Apart(f64),
}

impl InstrumentFile {
    /// Reads a [CSV file](stonewise_io::table::CsvFile) with the columns name, x, y, z, date, and for at least one axis
    /// the reading and its standard deviation: dx and sd_x, dy and sd_y, dz and sd_z; metres, in any order of lines.
    ///
    /// # Errors
    /// With the line: a column that is missing or unknown, a cell that is no number, a reading without a standard
    /// deviation, two readings of one instrument on one date, one name at two places.
    pub fn read(path: &Path, is_used: bool, longest_gap_days: f64, reach_m: f64) -> Result<Self> {
        let file = DatedCsv::read(path, "reading the file of instruments")?;
        let columns = Columns::of(&file)?;
        let mut instruments: BTreeMap<String, Instrument> = BTreeMap::new();
        for row in file.rows() {
            columns.add(&row?, &mut instruments)?;
        }
        let mut instruments: Vec<Instrument> = instruments.into_values().collect();
        for axis in instruments.iter_mut().flat_map(|i| &mut i.axes) {
            axis.sort_by(|a, b| a.day.total_cmp(&b.day));
        }
        if instruments.is_empty() {
            return Err(file.error("no readings: add a line for each instrument and date"));
        }
        Ok(Self {
            path: path.to_path_buf(),
            is_used,
            reach_m,
            longest_gap_days,
            instruments,
        })
    }

    /// What an instrument of the file moved from one date to another along x, y and z; `None` along axes that it does not
    /// measure.
    ///
    /// A reading of the day itself counts; else readings are interpolated linearly, and nothing is extrapolated.
    ///
    /// # Errors
    /// No axis has readings for both dates.
    pub fn motion(
        &self,
        instrument: &Instrument,
        dates: [Option<&str>; 2],
    ) -> std::result::Result<[Option<AxisMotion>; 3], ReadingGap> {
        let [Some(first), Some(later)] = dates.map(|d| d.and_then(day_of)) else {
            return Err(ReadingGap::NoDate);
        };
        // The reason of the axis with the most readings.
        let (mut gap, mut most) = (ReadingGap::Before, 0);
        let moved = instrument.axes.each_ref().map(|axis| {
            let both = self.at(axis, first).and_then(|a| Ok([a, self.at(axis, later)?]));
            match both {
                Ok([first, later]) => Some(AxisMotion {
                    value_m: later.value_m - first.value_m,
                    variance_m2: later.variance_m2 + first.variance_m2,
                }),
                Err(why) => {
                    if axis.len() > most {
                        (gap, most) = (why, axis.len());
                    }
                    None
                }
            }
        });
        match moved.iter().any(Option::is_some) {
            true => Ok(moved),
            false => Err(gap),
        }
    }

    fn at(&self, readings: &[Reading], day: f64) -> std::result::Result<AxisMotion, ReadingGap> {
        let of = |r: &Reading| AxisMotion {
            value_m: r.value_m,
            variance_m2: r.sd_m * r.sd_m,
        };
        let same_day = readings.iter().filter(|r| r.day.floor() == day.floor());
        if let Some(reading) = same_day.min_by(|a, b| (a.day - day).abs().total_cmp(&(b.day - day).abs())) {
            return Ok(of(reading));
        }
        let after = readings.partition_point(|r| r.day <= day);
        let before = after
            .checked_sub(1)
            .map(|i| readings[i])
            .ok_or(ReadingGap::Before)?;
        let after = readings.get(after).ok_or(ReadingGap::After)?;
        let apart = after.day - before.day;
        if apart > self.longest_gap_days {
            return Err(ReadingGap::Apart(apart));
        }
        let late = (day - before.day) / apart;
        let [before, after] = [of(&before), of(after)];
        Ok(AxisMotion {
            value_m: (1.0 - late) * before.value_m + late * after.value_m,
            variance_m2: (1.0 - late).powi(2) * before.variance_m2 + late.powi(2) * after.variance_m2,
        })
    }
}

/// Where the columns of a file are.
struct Columns {
    name: usize,
    place: [usize; 3],
    axes: [Option<[usize; 2]>; 3],
}

impl Columns {
    fn of(file: &DatedCsv) -> Result<Self> {
        let place = |name: &str| file.file.column(name);
        let known = |name: &String| PLACE.contains(&name.as_str()) || AXES.concat().contains(&name.as_str());
        if let Some(other) = file.file.head().iter().find(|name| !known(name)) {
            let message = format!(
                "no column may be named {other:?}: they are name, x, y, z, date, dx, dy, dz, sd_x, sd_y, sd_z"
            );
            return Err(file.error(message));
        }
        let required = |name: &str| {
            place(name).ok_or_else(|| file.error(format!("the column `{name}` is missing: add it")))
        };
        let axis = |[value, sd]: [&str; 2]| match (place(value), place(sd)) {
            (Some(value), Some(sd)) => Ok(Some([value, sd])),
            (None, None) => Ok(None),
            (Some(_), None) => Err(file.error(format!("`{value}` needs the column `{sd}`: add it"))),
            (None, Some(_)) => Err(file.error(format!("`{sd}` needs the column `{value}`: add it"))),
        };
        let axes = [axis(AXES[0])?, axis(AXES[1])?, axis(AXES[2])?];
        if axes.iter().all(Option::is_none) {
            let message = "nothing is measured: add one of dx, dy and dz with its standard deviation sd_x, sd_y or sd_z";
            return Err(file.error(message));
        }
        Ok(Self {
            name: required("name")?,
            place: [required("x")?, required("y")?, required("z")?],
            axes,
        })
    }

    /// Adds the readings of a line.
    fn add(&self, row: &DatedRow<'_>, instruments: &mut BTreeMap<String, Instrument>) -> Result<()> {
        let name = row.cells.text(self.name);
        if name.is_empty() {
            return Err(row.error("an instrument needs a name"));
        }
        let coordinate = |axis: usize| {
            let found = row.number(self.place[axis])?;
            found.ok_or_else(|| {
                let axis = PLACE[1 + axis];
                row.error(format!(
                    "{name}: {axis} is empty: give the place of the instrument"
                ))
            })
        };
        let place = Point3::new(coordinate(0)?, coordinate(1)?, coordinate(2)?);
        let instrument = instruments.entry(name.to_owned()).or_insert_with(|| Instrument {
            name: name.to_owned(),
            place,
            axes: Default::default(),
        });
        if (place - instrument.place).norm() > SAME_PLACE_M {
            let message =
                format!("{name} stands at another place in an earlier line: give each place its own name");
            return Err(row.error(message));
        }
        for (axis, columns) in self.axes.iter().enumerate() {
            let Some([of_value, of_sd]) = *columns else {
                continue;
            };
            let Some(value_m) = row.number(of_value)? else {
                continue;
            };
            let [value, sd] = AXES[axis];
            let sd_m = row.number(of_sd)?.filter(|sd| *sd >= 0.0).ok_or_else(|| {
                let message = format!(
                    "{name}: {value} needs its standard deviation: give {sd} in metres, 0 or more, or leave {value} empty"
                );
                row.error(message)
            })?;
            if instrument.axes[axis].iter().any(|r| r.day == row.day) {
                let message = format!(
                    "{name} has two readings of {}: remove one, or add the time",
                    row.date
                );
                return Err(row.error(message));
            }
            instrument.axes[axis].push(Reading {
                day: row.day,
                value_m,
                sd_m,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<InstrumentFile> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("targets.csv");
        std::fs::write(&path, text).unwrap();
        InstrumentFile::read(&path, false, 31.0, 2.0)
    }

    const TARGETS: &str = "name,x,y,z,date,dx,dz,sd_x,sd_z\n\
                           T1,1,2,3,2025-04-01,0.001,,0.0003,\n\
                           T1,1,2,3,2025-04-11,0.003,,0.0004,\n\
                           T1,1,2,3,2026-04-01T14:00,0.004,0.002,0.0003,0.0001\n\
                           L2,4,5,6,2026-04-01,,0.005,,0.0002\n\
                           L2,4,5,6,2025-04-01,,0.001,,0.0002\n";

    #[test]
    fn motions_are_between_readings_of_the_day_or_interpolated_ones() {
        let file = read(TARGETS).unwrap();
        let motion = |name: &str, dates: [&str; 2]| {
            let instrument = file.instruments.iter().find(|i| i.name == name).unwrap();
            file.motion(instrument, dates.map(Some))
        };
        // A time of the day is of that day.
        let [x, y, z] = motion("T1", ["2025-04-01", "2026-04-01"]).unwrap();
        assert!((x.unwrap().value_m - 0.003).abs() < 1e-15 && y.is_none() && z.is_none());
        assert!((x.unwrap().variance_m2 - 2.0 * 9e-8).abs() < 1e-18);
        // 0.4 of the way from 0.001 to 0.003, of variances 9 and 16 (0.36 and 0.16 of them).
        let [x, ..] = motion("T1", ["2025-04-05", "2025-04-11"]).unwrap();
        assert!((x.unwrap().value_m - (0.003 - 0.0018)).abs() < 1e-15);
        assert!((x.unwrap().variance_m2 - (0.36 * 9e-8 + 0.16 * 16e-8 + 16e-8)).abs() < 1e-18);
        let [.., z] = motion("L2", ["2025-04-01", "2026-04-01"]).unwrap();
        assert!((z.unwrap().value_m - 0.004).abs() < 1e-15);
    }

    #[test]
    fn nothing_is_extrapolated_or_taken_across_a_gap() {
        let file = read(TARGETS).unwrap();
        let target = file.instruments.iter().find(|i| i.name == "T1").unwrap();
        let motion = |dates: [Option<&str>; 2]| file.motion(target, dates);
        assert_eq!(
            motion([Some("2025-03-31"), Some("2025-04-11")]),
            Err(ReadingGap::Before)
        );
        assert_eq!(
            motion([Some("2025-04-01"), Some("2026-04-02")]),
            Err(ReadingGap::After)
        );
        assert_eq!(motion([Some("2025-04-01"), None]), Err(ReadingGap::NoDate));
        let gap = motion([Some("2025-04-01"), Some("2025-12-01")]);
        assert!(
            matches!(gap, Err(ReadingGap::Apart(days)) if (days - 355.6).abs() < 0.1),
            "{gap:?}"
        );
    }

    #[test]
    fn mistakes_are_named_with_line_and_fix() {
        for (text, message) in [
            (
                "name,x,y,date,dx,sd_x\n",
                "targets.csv:1: the column `z` is missing",
            ),
            (
                "name,x,y,z,date,dx\n",
                "targets.csv:1: `dx` needs the column `sd_x`",
            ),
            ("name,x,y,z,date\n", "targets.csv:1: nothing is measured"),
            (
                "name,x,y,z,date,dx,sdx\n",
                "targets.csv:1: no column may be named \"sdx\"",
            ),
            ("name,x,y,z,date,dx,sd_x\n", "targets.csv:1: no readings"),
            (
                "name,x,y,z,date,dx,sd_x\nT1,1,2,,2025-04-01,0.1,0.1\n",
                "targets.csv:2: T1: z is empty",
            ),
            (
                "name,x,y,z,date,dx,sd_x\nT1,1,2,3,2025-04-01,0.1,\n",
                "targets.csv:2: T1: dx needs its standard deviation",
            ),
            (
                "name,x,y,z,date,dx,sd_x\nT1,1,2,3,2025-04-01,0.1,-1\n",
                "targets.csv:2: T1: dx needs its standard deviation",
            ),
            (
                "name,x,y,z,date,dx,sd_x\nT1,1,2,3,2025-04-01,0,1\nT1,1,2,4,2025-04-02,0,1\n",
                "targets.csv:3: T1 stands at another place",
            ),
            (
                "name,x,y,z,date,dx,sd_x\nT1,1,2,3,2025-04-01,0,1\nT1,1,2,3,2025-04-01,0,1\n",
                "targets.csv:3: T1 has two readings of 2025-04-01",
            ),
            (
                "name,x,y,z,date,dx,sd_x\nT1,1,2,3,2025-04-01,0 m,1\n",
                "targets.csv:2: dx: \"0 m\" is no number",
            ),
        ] {
            let found = read(text).unwrap_err().to_string();
            assert!(found.contains(message), "{found}");
        }
    }
}
