//! Points as text: XYZ, CSV, ASC, PTS.

use std::path::Path;

use nalgebra::Point3;

use super::chunk::{Chunker, PointRecord, Visit};
use super::colour_scale::{LOOK_POINTS, Seen, to_16_bits};
use super::lines::Lines;
use super::scan::Scan;
use super::{CloudError, ReadSummary, Remark};

/// Passes all points of a text file to `visit`, one point per line.
///
/// Columns are separated by semicolons, else by commas, else by spaces or tabs, as the first point shows; with
/// semicolons, spaces or tabs a comma may stand for the decimal point. Separators at the end of a line add nothing. Lines
/// that begin with `#`, `//` or `%` are comments. A header, also one in a comment, names the columns (x, y, z, or easting, northing and height in English or German; r or red,
/// g or green, b or blue, intensity or i); others may hold anything. Without a header the columns are x, y, z and, where the first points have whole numbers
/// there that are not all 0 or 1, colours; a seventh column is an intensity, behind the colours as CloudCompare writes it,
/// or in front of them where only that fits and in PTS files, where it is also the fourth of four. Colours go to 255, to
/// 65535 where the first points have larger ones, or to 1 where they are fractions. A line with nothing but a count is
/// skipped before the first point. In PTS files a count begins a scan, wherever it stands, and must be right.
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

/// Says which column is east where the header names y before x, as surveyors do whose y points east.
pub fn remarks(path: &Path) -> Result<Vec<Remark>, CloudError> {
    let is_odd = find_columns(path)?.is_some_and(|(columns, _)| columns.y_before_x);
    let text = "its header names Y before X; columns are read by their names, so X points east and Y north: if Y points east, \
                rename both, or the cloud is mirrored";
    Ok(is_odd.then(|| Remark::note(text)).into_iter().collect())
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

/// Names of columns that say where they point, in small letters.
const EAST: [&str; 6] = ["east", "easting", "e", "rechtswert", "ostwert", "ost"];
const NORTH: [&str; 6] = ["north", "northing", "n", "hochwert", "nordwert", "nord"];
const UP: [&str; 7] = ["z", "h", "height", "elevation", "up", "höhe", "hoehe"];

/// Where the values stand in a line.
#[derive(Debug)]
struct Columns {
    /// `None` for spaces and tabs.
    separator: Option<char>,
    position: [usize; 3],
    color: Option<[usize; 3]>,
    /// Multiplies colours to 16 bits.
    color_factor: f64,
    intensity: Option<usize>,
    /// The header names y before x.
    y_before_x: bool,
    /// Columns of the header; 0 without one.
    named: usize,
}

/// The columns and the number of the first line that is a point; `None` where there is no point at all.
fn find_columns(path: &Path) -> Result<Option<(Columns, u64)>, CloudError> {
    let mut lines = Lines::open(path)?;
    let mut named: Option<Columns> = None;
    while let Some(line) = lines.next()? {
        if let Some(text) = comment(line) {
            named = named.or_else(|| Columns::named(text));
            continue;
        }
        if line.is_empty() || is_count(line) {
            continue;
        }
        let separator = separator(line);
        if let Some(header) = &mut named {
            header.separator = separator;
            if let Err(reason) = header.record(line) {
                return Err(lines.error(format!("not a point: {reason}")));
            }
        } else if numbers(line, separator).is_none_or(|n| n.len() < 3) {
            named = Columns::named(line);
            if named.is_none() {
                let reason = "neither three numbers nor a header with columns x, y and z";
                return Err(lines.error(reason));
            }
            continue;
        }
        let (line, first) = (line.to_owned(), lines.number());
        let look = Look::at(line, separator, &mut lines)?;
        let columns = named.unwrap_or_else(|| look.columns(separator, is_pts(path)));
        if look.has_decimal_commas(&columns) {
            let reason = "whole numbers between commas: if commas are decimal signs, export with points or \
                          semicolons; if the coordinates are whole, write them as 1.0";
            return Err(CloudError::Line {
                path: path.to_owned(),
                line: first,
                reason: reason.to_owned(),
            });
        }
        let color_factor = look.color_factor(&columns);
        return Ok(Some((
            Columns {
                color_factor,
                ..columns
            },
            first,
        )));
    }
    Ok(None)
}

/// What the first points of a file have in their columns.
#[derive(Default)]
struct Look {
    columns: Vec<Seen>,
    /// A number has a decimal point.
    has_point: bool,
}

impl Look {
    /// Looks at a line and those after it; lines that are no points are met again while the file is read.
    fn at(first: String, separator: Option<char>, lines: &mut Lines) -> Result<Self, CloudError> {
        let mut look = Self::default();
        look.add(&first, separator);
        for _ in 1..LOOK_POINTS {
            match lines.next()? {
                Some(line) if comment(line).is_none() => look.add(line, separator),
                Some(_) => {}
                None => break,
            }
        }
        Ok(look)
    }

    fn add(&mut self, line: &str, separator: Option<char>) {
        for (place, cell) in cells(line, separator).enumerate() {
            if let Some(value) = number(cell, separator) {
                self.columns
                    .resize(self.columns.len().max(place + 1), Seen::default());
                self.columns[place].add(value);
                self.has_point |= cell.contains('.');
            }
        }
    }

    /// Columns by the values of the first points.
    fn columns(&self, separator: Option<char>, is_pts: bool) -> Columns {
        let fits = |start: usize, white: f64| {
            self.columns.get(start..start + 3).is_some_and(|all| {
                let is_color = |c: &Seen| c.is_whole && c.largest <= white;
                // A normal such as 0 0 1 is no colour.
                all.iter().all(is_color) && all.iter().any(|c| c.largest > 1.0)
            })
        };
        let starts: &[usize] = match self.columns.len() {
            7 if is_pts => &[4],
            7 => &[3, 4],
            _ => &[3],
        };
        let color = [255.0, 65535.0]
            .into_iter()
            .find_map(|white| starts.iter().copied().find(|&s| fits(s, white)));
        let intensity = match (self.columns.len(), color) {
            (7, Some(3)) => Some(6),
            (7, _) => Some(3),
            (4, _) if is_pts => Some(3),
            _ => None,
        };
        Columns {
            separator,
            position: [0, 1, 2],
            color: color.map(|start| [start, start + 1, start + 2]),
            color_factor: 257.0,
            intensity,
            y_before_x: false,
            named: 0,
        }
    }

    fn color_factor(&self, columns: &Columns) -> f64 {
        let seen = |column: usize| self.columns.get(column).copied().unwrap_or_default();
        columns
            .color
            .map_or(257.0, |channels| to_16_bits(channels.map(seen), false))
    }

    /// Whether commas separate the whole part of each number from its decimals.
    fn has_decimal_commas(&self, columns: &Columns) -> bool {
        let count = self.columns.len();
        let may_be = count >= 6 && count.is_multiple_of(2) && count != columns.named;
        columns.separator == Some(',') && !self.has_point && may_be
    }
}

impl Columns {
    /// Columns by the names in a header.
    fn named(line: &str) -> Option<Self> {
        let separator = separator(line);
        let names: Vec<String> = cells(line, separator).map(str::to_lowercase).collect();
        let place = |known: &[&str]| names.iter().position(|name| known.contains(&bare(name)));
        let color = [
            place(&["r", "red"]),
            place(&["g", "green"]),
            place(&["b", "blue"]),
        ];
        let position = |words: [&[&str]; 3]| {
            let [x, y, z] = words.map(place);
            Some([x?, y?, z?])
        };
        let [x, y, z] = position([&["x"], &["y"], &["z"]]).or_else(|| position([&EAST, &NORTH, &UP]))?;
        Some(Self {
            separator,
            position: [x, y, z],
            color: match color {
                [Some(r), Some(g), Some(b)] => Some([r, g, b]),
                _ => None,
            },
            color_factor: 257.0,
            intensity: place(&["i", "intensity", "reflectance"]),
            y_before_x: place(&["y"]) < place(&["x"]),
            named: names.len(),
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
        let channel = |column| {
            let bits = value(column)? * self.color_factor;
            Ok::<_, String>(bits.clamp(0.0, 65535.0).round() as u16)
        };
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
    // Numbers between spaces or tabs, with a comma for the decimal point.
    let mut words = line.split_ascii_whitespace().take(3);
    let are_numbers = words.clone().count() == 3 && words.all(|word| number(word, None).is_some());
    match are_numbers {
        true => None,
        false => [';', ','].into_iter().find(|&s| line.contains(s)),
    }
}

fn cells(line: &str, separator: Option<char>) -> impl Iterator<Item = &str> {
    let (words, parts) = match separator {
        None => (Some(line.split_ascii_whitespace()), None),
        Some(separator) => {
            let line = line.trim_end_matches(separator);
            (None, Some(line.split(separator).map(str::trim)))
        }
    };
    let cells = words.into_iter().flatten().chain(parts.into_iter().flatten());
    cells.map(|cell| cell.trim_matches('"'))
}

fn numbers(line: &str, separator: Option<char>) -> Option<Vec<f64>> {
    cells(line, separator)
        .map(|cell| number(cell, separator))
        .collect()
}

fn number(cell: &str, separator: Option<char>) -> Option<f64> {
    match separator {
        Some(',') => cell.parse().ok(),
        _ if cell.ends_with(',') => None,
        _ => cell.replacen(',', ".", 1).parse().ok(),
    }
}

/// A column's name without its unit.
fn bare(name: &str) -> &str {
    name.split(['[', '(', ' ']).next().unwrap_or(name)
}
