//! Leica PTX: text, scan after scan, each with the place of its scanner and its transformation.

use std::path::Path;

use nalgebra::{Matrix3, Point3, Vector3};

use super::chunk::{Chunker, PointRecord, Visit};
use super::lines::Lines;
use super::scan::Scan;
use super::{CloudError, ReadSummary};

/// Bytes of the shortest line of a point.
const LEAST_LINE_BYTES: u64 = 6;

/// Passes the points of all scans to `visit`, scan after scan, in the world frame.
///
/// A point at the scanner itself (0 0 0) is a direction without an echo, and has no position. Colours are
/// 8-bit.
pub fn read<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    visit: Visit<'_, E>,
) -> Result<ReadSummary, E> {
    let mut lines = Lines::open(path)?;
    let mut chunker = Chunker::new(chunk_points, false, false, visit);
    let mut number = 0;
    while let Some(head) = Head::read(&mut lines)? {
        head.check_room(path, number, lines.bytes_left()?)?;
        read_scan(path, &mut lines, &head, number, &mut chunker)?;
        chunker.pass()?;
        number += 1;
    }
    chunker.finish()
}

/// The scans of a file. The file is read from end to end: only its text says where a scan ends.
pub fn scans(path: &Path) -> Result<Vec<Scan>, CloudError> {
    let mut lines = Lines::open(path)?;
    let mut scans = Vec::new();
    while let Some(head) = Head::read(&mut lines)? {
        head.check_room(path, scans.len(), lines.bytes_left()?)?;
        for found in 0..head.records() {
            if lines.next_filled()?.is_none() {
                return Err(head.cut_off(path, scans.len(), found));
            }
        }
        scans.push(Scan {
            name: format!("scan {}", scans.len() + 1),
            records: head.records(),
            origin: head.scanner,
            ..Scan::default()
        });
    }
    Ok(scans)
}

/// The ten lines before the points of a scan.
struct Head {
    columns: u32,
    rows: u32,
    /// Place of the scanner in the world frame; `None` where the file leaves it at zero.
    scanner: Option<Point3<f64>>,
    /// Linear part and translation from the scanner's frame to the world.
    turn: Matrix3<f64>,
    shift: Vector3<f64>,
}

impl Head {
    /// `None` at the end of the file.
    fn read(lines: &mut Lines) -> Result<Option<Self>, CloudError> {
        let Some(line) = lines.next_filled()? else {
            return Ok(None);
        };
        let columns = line.parse();
        let columns = columns.map_err(|_| {
            lines.error(
                "not the number of columns that begins a scan of a PTX file: the scan before holds more points \
                 than its header claims, or this is no PTX file; export it again",
            )
        })?;
        let rows = expect(lines, "the number of rows")?.parse();
        let rows = rows.map_err(|_| lines.error("not the number of rows of the scan"))?;
        let place: [f64; 3] = numbers(lines, "the position of the scanner")?;
        for axis in ["x", "y", "z"] {
            numbers::<3>(lines, &format!("the {axis} axis of the scanner"))?;
        }
        let mut matrix = [[0.0; 4]; 4];
        for (row, last) in matrix.iter_mut().zip([0.0, 0.0, 0.0, 1.0]) {
            *row = numbers(lines, "a row of the transformation")?;
            if row[3] != last {
                let reason = format!(
                    "the fourth number of this row of the transformation must be {last}: the translation stands in \
                     the fourth row, not in the fourth column"
                );
                return Err(lines.error(reason));
            }
        }
        // A row times the matrix is a point of the world.
        let turn = Matrix3::from_fn(|to, from| matrix[from][to]);
        let [x, y, z, _] = matrix[3];
        let shift = Vector3::new(x, y, z);
        let volume = turn.determinant().abs();
        if !volume.is_finite() || volume < 1e-6 {
            return Err(lines.error("the transformation of the scan has no inverse: export it again"));
        }
        let places = [Point3::from(place), Point3::from(shift)];
        Ok(Some(Self {
            columns,
            rows,
            scanner: places.into_iter().find(|p| *p != Point3::origin()),
            turn,
            shift,
        }))
    }

    fn records(&self) -> u64 {
        u64::from(self.columns) * u64::from(self.rows)
    }

    /// Checks that the points have room in the rest of the file, before any of them is read.
    fn check_room(&self, path: &Path, scan: usize, bytes: u64) -> Result<(), CloudError> {
        // The last line may have no end.
        let room = (bytes + 1) / LEAST_LINE_BYTES;
        if room < self.records() {
            let reason = format!(
                "it has room for {room} of the {} x {} points that the header of scan {} claims",
                self.columns,
                self.rows,
                scan + 1
            );
            return Err(CloudError::truncated(path, reason));
        }
        Ok(())
    }

    fn cut_off(&self, path: &Path, scan: usize, found: u64) -> CloudError {
        let claimed = self.records();
        CloudError::truncated(
            path,
            format!("it holds {found} of {claimed} points of scan {}", scan + 1),
        )
    }
}

fn read_scan<E: From<CloudError>>(
    path: &Path,
    lines: &mut Lines,
    head: &Head,
    number: usize,
    chunker: &mut Chunker<'_, E>,
) -> Result<(), E> {
    let nowhere = || PointRecord {
        position: None,
        color: None,
        intensity: None,
    };
    let mut columns = None;
    for found in 0..head.records() {
        let Some(line) = lines.next_filled()? else {
            return Err(head.cut_off(path, number, found).into());
        };
        let (values, count) = point(line).map_err(|reason| lines.error(reason))?;
        let [x, y, z, intensity, color @ ..] = values;
        if [x, y, z] == [0.0; 3] {
            chunker.push(nowhere())?;
            continue;
        }
        // The first echo of a scan shows what its points have; empty points may have less.
        if columns.is_none() {
            columns = Some(count);
            chunker.begin_scan(number, count == 7, count >= 4)?;
        }
        if columns != Some(count) {
            let expected = columns.unwrap_or_default();
            let reason = format!("{count} columns, but the points of this scan have {expected}");
            return Err(lines.error(reason).into());
        }
        chunker.push(PointRecord {
            position: Some(Point3::from(head.turn * Vector3::new(x, y, z) + head.shift)),
            color: (count == 7).then(|| color.map(|c| (c.clamp(0.0, 255.0) * 257.0).round() as u16)),
            intensity: (count >= 4).then_some(intensity as f32),
        })?;
    }
    Ok(())
}

/// The numbers of a point, and how many there are.
fn point(line: &str) -> Result<([f64; 7], usize), String> {
    let mut values = [0.0; 7];
    let mut count = 0;
    for word in line.split_ascii_whitespace() {
        if let Some(value) = values.get_mut(count) {
            let wrong = || format!("{word:?} in column {} is not a number", count + 1);
            *value = word.parse().map_err(|_| wrong())?;
        }
        count += 1;
    }
    match count {
        3 | 4 | 7 => Ok((values, count)),
        1 => Err(
            "a single number where a point is expected: the scan holds fewer points than its header claims; \
             export it again"
                .to_owned(),
        ),
        _ => Err(format!(
            "{count} columns; a point of a PTX file has x, y, z and intensity, and red, green and blue where it \
             has colours"
        )),
    }
}

fn expect(lines: &mut Lines, what: &str) -> Result<String, CloudError> {
    match lines.next_filled()?.map(str::to_owned) {
        Some(line) => Ok(line),
        None => Err(lines.error(format!("the file ends before {what}"))),
    }
}

fn numbers<const N: usize>(lines: &mut Lines, what: &str) -> Result<[f64; N], CloudError> {
    let line = expect(lines, what)?;
    let values: Option<Vec<f64>> = line.split_ascii_whitespace().map(|w| w.parse().ok()).collect();
    let values = values.filter(|all| all.iter().all(|v| v.is_finite()));
    let values = values.and_then(|all| <[f64; N]>::try_from(all).ok());
    values.ok_or_else(|| lines.error(format!("expected {N} numbers: {what}")))
}
