//! "Internal/External camera parameters", plain and OpenCV-compliant.

use super::super::photo_sizes::PhotoSizes;
use super::super::pose::{FLIP, camera_at, rotation};
use super::super::{CameraError, CameraFile, Remark, malformed, read_text};
use super::lens::{FILM_MM, Lens, unsupported};
use crate::text::read_head;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, Vector3};
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::geometry::{Rigid3, View};
use stonewise_core::id::ImageId;

/// Bytes in which a file shows what it is.
const HEAD: u64 = 256;
/// Places farther than this from the origin are map coordinates, metres.
const MAP_M: f64 = 10_000.0;
/// Columns of the nine elements of a rotation.
const TURN: [&str; 9] = ["r00", "r01", "r02", "r10", "r11", "r12", "r20", "r21", "r22"];
/// Columns of the terms of the lens.
const TERMS: [&str; 6] = ["k1", "k2", "k3", "k4", "t1", "t2"];

/// Whether a file is of this format, by its first lines.
pub fn is_csv(path: &Path) -> bool {
    let head = read_head(path, HEAD).unwrap_or_default().to_lowercase();
    let columns = head.lines().find_map(header).unwrap_or_default();
    let has = |name: &str| columns.iter().any(|column| column == name);
    (has("roll") && has("alt")) || (has("tx") && has("r00"))
}

/// The names of the columns, if a line gives them.
fn header(line: &str) -> Option<Vec<String>> {
    let line = line.trim().to_lowercase();
    // A remark in brackets may follow the names.
    let columns = line.strip_prefix('#')?.split('(').next()?.split(',');
    let names: Vec<String> = columns.map(|column| column.trim().to_owned()).collect();
    (names.first()? == "name").then_some(names)
}

/// Reads the file; views keep its order.
pub fn read_csv(path: &Path, photos: &PhotoSizes<'_>) -> Result<CameraFile, CameraError> {
    let text = read_text(path)?;
    let mut lines = (1..).zip(text.lines());
    let columns = lines.by_ref().find_map(|(_, line)| header(line));
    let columns = columns.ok_or_else(|| malformed(path, "line 1", "no line begins with #name"))?;
    let mut rows = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        rows.push(Row::parse(line, &columns, path, number)?);
    }

    let names: Vec<&str> = rows.iter().map(|row| row.name).collect();
    let sizes = photos.of(&names)?;
    let mut file = CameraFile::default();
    for (row, size) in rows.iter().zip(sizes) {
        let [width, height] = size;
        let lens = row.lens(size)?;
        if lens.has_one_term() {
            return Err(unsupported(path, "division (k1 alone)", row.name));
        }
        let camera = lens.camera([width, height]);
        file.views.push(View {
            image: ImageId(file.views.len() as u32),
            name: row.name.to_owned(),
            camera,
            cam_from_world: row.pose()?,
        });
    }
    let is_on_map = |view: &View| view.centre().coords.xy().amax() > MAP_M;
    if columns.iter().any(|column| column == "roll") && file.views.iter().any(is_on_map) {
        file.warnings.push(Remark::YawFromTrueNorth);
    }
    Ok(file)
}

/// One photo.
struct Row<'a> {
    path: &'a Path,
    line: usize,
    name: &'a str,
    values: BTreeMap<&'a str, f64>,
}

impl<'a> Row<'a> {
    fn parse(
        line: &'a str,
        columns: &'a [String],
        path: &'a Path,
        number: usize,
    ) -> Result<Self, CameraError> {
        let bad = |problem: String| malformed(path, format!("line {number}"), problem);
        // From the right, because names may hold commas.
        let mut cells: Vec<&str> = line.rsplitn(columns.len(), ',').map(str::trim).collect();
        cells.reverse();
        if cells.len() != columns.len() {
            let problem = format!("expected {} values, found {}", columns.len(), cells.len());
            return Err(bad(problem));
        }
        let mut values = BTreeMap::new();
        for (column, cell) in columns.iter().zip(&cells).skip(1) {
            let value = cell.parse().ok().filter(|value: &f64| value.is_finite());
            let value = value.ok_or_else(|| bad(format!("{column} is no number: {cell:?}")))?;
            values.insert(column.as_str(), value);
        }
        Ok(Self {
            path,
            line: number,
            name: cells[0].trim_matches('"'),
            values,
        })
    }

    /// The value of the first of these columns that is there.
    fn get(&self, names: &[&str]) -> Option<f64> {
        names.iter().find_map(|name| self.values.get(name)).copied()
    }

    fn needed<const N: usize>(&self, names: [&str; N]) -> Result<[f64; N], CameraError> {
        let mut values = [0.0; N];
        for (value, name) in values.iter_mut().zip(names) {
            *value = self.get(&[name]).ok_or_else(|| {
                self.bad(&format!(
                    "column {name} is missing: export Internal/External camera parameters"
                ))
            })?;
        }
        Ok(values)
    }

    fn bad(&self, problem: &str) -> CameraError {
        malformed(self.path, format!("line {}", self.line), problem)
    }

    fn lens(&self, [width, height]: [u32; 2]) -> Result<Lens, CameraError> {
        let terms = TERMS.map(|name| self.get(&[name]).unwrap_or(0.0));
        let (focal, centre) = if let Some(focal_px) = self.get(&["f_pix"]) {
            let [x, y] = self.needed(["px_pix", "py_pix"])?;
            let unit = f64::from(width.max(height));
            let offset = [x - f64::from(width) / 2.0, y - f64::from(height) / 2.0];
            (focal_px / unit, offset.map(|o| o / unit))
        } else {
            let focal = self.get(&["f", "f_35mm"]).unwrap_or(0.0) / FILM_MM;
            let centre = [&["px", "px_norm"], &["py", "py_norm"]].map(|names| self.get(names).unwrap_or(0.0));
            (focal, centre)
        };
        if focal <= 0.0 {
            return Err(self.bad("a positive focal length (f, f_35mm or f_pix) is missing"));
        }
        Ok(Lens { focal, centre, terms })
    }

    fn pose(&self) -> Result<Rigid3, CameraError> {
        if self.values.contains_key("r00") {
            let turn = Matrix3::from_row_slice(&self.needed(TURN)?);
            let turn = rotation(&turn).ok_or_else(|| self.bad("R00 to R22 are no rotation"))?;
            let shift = Translation3::from(Vector3::from(self.needed(["tx", "ty", "tz"])?));
            return Ok(Rigid3::from_parts(shift, turn));
        }
        let [x, y, z, pitch, roll] = self.needed(["x", "y", "alt", "pitch", "roll"])?;
        let heading = self.get(&["heading", "yaw"]);
        let heading = heading.ok_or_else(|| self.bad("column heading or yaw is missing"))?;
        let cam_from_world = attitude(heading, pitch, roll).inverse();
        Ok(camera_at(Point3::new(x, y, z), &cam_from_world.into()))
    }
}

/// Camera to world, of angles in degrees: an aircraft's, clockwise from north, nose up, right wing down, whose
/// camera looks straight down with its upper side to the nose (section 5.1).
fn attitude(heading: f64, pitch: f64, roll: f64) -> Rotation3<f64> {
    let [heading, pitch, roll] = [heading, pitch, roll].map(f64::to_radians);
    let axes = Rotation3::from_matrix_unchecked(FLIP);
    Rotation3::from_axis_angle(&Vector3::z_axis(), -heading)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), roll)
        * axes
}
