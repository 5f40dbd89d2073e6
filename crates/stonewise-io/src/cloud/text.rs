//! Points as text: XYZ, CSV, ASC, PTS.

use std::path::Path;

use nalgebra::Point3;

use super::chunk::{Chunker, PointRecord, Visit};
use super::lines::Lines;
use super::scan::Scan;
use super::{CloudError, ReadSummary};

/// Passes all points of a text file to `visit`, one point per line.
///
/// Columns are separated by semicolons, else by commas, else by spaces or tabs, as the first point shows;
/// with semicolons a comma may stand for the decimal point. Lines that begin with `#`, `//` or `%` are
/// comments. A header, also one in a comment, names the columns (x, y, z, r or red, g or green, b or blue,
/// intensity or i). Without one they are x, y, z and, where the first point has three integers from 0 to 255
/// there, colours; with seven columns, and with four in PTS files, an intensity comes before the colours.
/// Colours are 8-bit. A line with nothing but a count is skipped before the first point. In PTS files a count
/// begins a scan, wherever it stands, and must be right.
pub fn read<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    visit: Visit<'_, E>,
) -> Result<ReadSummary, E> {
    let Some((columns, first)) = find_columns(path)? else {
        return match scans(path)?.iter().find(|scan| scan.records > 0) {
            Some(scan) => {
                let reason = format!("it claims {} points, and holds none", scan.records);
                Err(CloudError::truncated(path, reason).into())
            }
            None => Ok(ReadSummary::default()),
        };
    };
    let mut parts = is_pts(path).then(Parts::default);
    let (has_color, has_intensity) = (columns.color.is_some(), columns.intensity.is_some());
    let mut chunker = Chunker::new(chunk_points, has_color, has_intensity, visit);
    let mut lines = Lines::open(path)?;
    while let Some(line) = lines.next()? {
        if line.is_empty() || comment(line).is_some() {
            continue;
        }
        if let (Some(parts), Ok(claimed)) = (&mut parts, line.parse()) {
            parts.begin(claimed, &lines)?;
            chunker.begin_scan(parts.begun - 1, has_color, has_intensity)?;
            continue;
        }
        let record = columns.record(line);
        // What comes before the first point is the header.
        if lines.number() >= first {
            chunker.push(record.map_err(|reason| lines.error(reason))?)?;
            if let Some(parts) = &mut parts {
                parts.found += 1;
            }
        }
    }
    if let Some(parts) = parts {
        parts.end(path)?;
    }
    chunker.finish()
}

/// The scans of a PTS file, which is read from end to end; empty for other texts, and without counts.
pub fn scans(path: &Path) -> Result<Vec<Scan>, CloudError> {
    let mut scans = Vec::new();
    if !is_pts(path) {
        return Ok(scans);
    }
    let mut lines = Lines::open(path)?;
    while let Some(line) = lines.next()? {
        if let Ok(records) = line.parse() {
            scans.push(Scan {
                name: format!("scan {}", scans.len() + 1),
                records,
                ..Scan::default()
            });
        }
    }
    Ok(scans)
}

fn is_pts(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("pts"))
}

/// The scans of a PTS file, each after a line with the number of its points.
#[derive(Default)]
struct Parts {
    begun: usize,
    /// Line of the count.
    line: u64,
    claimed: u64,
    /// Points since the count.
    found: u64,
}

impl Parts {
    fn begin(&mut self, claimed: u64, lines: &Lines) -> Result<(), CloudError> {
        if self.begun > 0 && self.found != self.claimed {
            return Err(lines.error(self.wrong()));
        }
        *self = Self {
            begun: self.begun + 1,
            line: lines.number(),
            claimed,
            found: 0,
        };
        Ok(())
    }

    fn end(&self, path: &Path) -> Result<(), CloudError> {
        match self.begun {
            0 => Ok(()),
            _ if self.found == self.claimed => Ok(()),
            _ if self.found < self.claimed => Err(CloudError::truncated(path, self.wrong())),
            _ => Err(CloudError::malformed(path, self.wrong())),
        }
    }

    fn wrong(&self) -> String {
        format!(
            "line {} claims {} points, and {} follow: export the file again",
            self.line, self.claimed, self.found
        )
    }
}

/// Where the values stand in a line.
#[derive(Debug, PartialEq)]
struct Columns {
    /// `None` for spaces and tabs.
    separator: Option<char>,
    position: [usize; 3],
    color: Option<[usize; 3]>,
    intensity: Option<usize>,
}

/// The columns and the number of the first line that is a point; `None` where there is no point at all.
fn find_columns(path: &Path) -> Result<Option<(Columns, u64)>, CloudError> {
    let mut lines = Lines::open(path)?;
    let mut named: Option<Columns> = None;
    while let Some(line) = lines.next()? {
        if let Some(text) = comment(line) {
            named = named.or_else(|| Columns::named(text));
        } else if line.is_empty() || is_count(line) {
            continue;
        } else if let Some(unnamed) = Columns::unnamed(line, is_pts(path)) {
            let separator = unnamed.separator;
            let columns = named.map_or(unnamed, |named| Columns { separator, ..named });
            return Ok(Some((columns, lines.number())));
        } else if named.is_none() {
            named = Columns::named(line);
            if named.is_none() {
                let reason = "neither three numbers nor a header with columns x, y and z";
                return Err(lines.error(reason));
            }
        } else {
            return Err(lines.error("not a point: expected numbers after the header"));
        }
    }
    Ok(None)
}

impl Columns {
    /// Columns by the names in a header.
    fn named(line: &str) -> Option<Self> {
        let separator = separator(line);
        let names: Vec<String> = cells(line, separator).map(str::to_ascii_lowercase).collect();
        let place = |known: &[&str]| names.iter().position(|name| known.contains(&bare(name)));
        let color = [
            place(&["r", "red"]),
            place(&["g", "green"]),
            place(&["b", "blue"]),
        ];
        Some(Self {
            separator,
            position: [place(&["x"])?, place(&["y"])?, place(&["z"])?],
            color: match color {
                [Some(r), Some(g), Some(b)] => Some([r, g, b]),
                _ => None,
            },
            intensity: place(&["i", "intensity", "reflectance"]),
        })
    }

    /// Columns by the values of the first point.
    fn unnamed(line: &str, is_pts: bool) -> Option<Self> {
        let separator = separator(line);
        let values: Option<Vec<f64>> = cells(line, separator).map(|c| number(c, separator)).collect();
        let values = values.filter(|v| v.len() >= 3)?;
        let intensity = (values.len() == 7 || (is_pts && values.len() == 4)).then_some(3);
        let start = if values.len() == 7 { 4 } else { 3 };
        let color = values.get(start..start + 3).is_some_and(|v| {
            let is_byte = |c: &f64| (0.0..=255.0).contains(c) && c.fract() == 0.0;
            // A normal such as 0 0 1 is no colour.
            v.iter().all(is_byte) && v.iter().any(|&c| c > 1.0)
        });
        Some(Self {
            separator,
            position: [0, 1, 2],
            color: color.then_some([start, start + 1, start + 2]),
            intensity,
        })
    }

    fn record(&self, line: &str) -> Result<PointRecord, String> {
        let cells: Vec<&str> = cells(line, self.separator).collect();
        let value = |column: usize| {
            let cell = cells.get(column).ok_or_else(|| {
                let count = cells.len();
                format!("{count} columns, but column {} is needed", column + 1)
            })?;
            number(cell, self.separator)
                .ok_or_else(|| format!("{cell:?} in column {} is not a number", column + 1))
        };
        let [x, y, z] = self.position;
        let position = Point3::new(value(x)?, value(y)?, value(z)?);
        let channel = |column| value(column).map(|v| (v.clamp(0.0, 255.0) * 257.0).round() as u16);
        let color = match self.color {
            Some([r, g, b]) => Some([channel(r)?, channel(g)?, channel(b)?]),
            None => None,
        };
        Ok(PointRecord {
            position: Some(position),
            color,
            intensity: self.intensity.map(value).transpose()?.map(|v| v as f32),
        })
    }
}

/// The text of a comment line.
fn comment(line: &str) -> Option<&str> {
    let marks = ["//", "#", "%"];
    marks
        .iter()
        .find_map(|mark| line.strip_prefix(mark))
        .map(str::trim)
}

fn is_count(line: &str) -> bool {
    line.parse::<u64>().is_ok()
}

fn separator(line: &str) -> Option<char> {
    [';', ','].into_iter().find(|&s| line.contains(s))
}

fn cells(line: &str, separator: Option<char>) -> impl Iterator<Item = &str> {
    let (words, parts) = match separator {
        None => (Some(line.split_ascii_whitespace()), None),
        Some(separator) => (None, Some(line.split(separator).map(str::trim))),
    };
    let cells = words.into_iter().flatten().chain(parts.into_iter().flatten());
    cells.map(|cell| cell.trim_matches('"'))
}

fn number(cell: &str, separator: Option<char>) -> Option<f64> {
    if separator == Some(';') && cell.contains(',') {
        return cell.replace(',', ".").parse().ok();
    }
    cell.parse().ok()
}

/// A column's name without its unit.
fn bare(name: &str) -> &str {
    name.split(['[', '(', ' ']).next().unwrap_or(name)
}
