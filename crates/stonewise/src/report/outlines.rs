//! The file of stone outlines.

use super::ReportError;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_io::atomic::write_atomically;

/// Name of the file beside the stone table.
pub const OUTLINES_FILE: &str = "outlines.json";

/// Version of its layout.
const FORMAT: u32 = 1;

/// The outline of one stone of epoch 1 and the way its face looks.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneOutline {
    /// The stone.
    pub stone_id: u32,
    /// Unit normal of its face, out of the wall, world.
    pub normal: Vector3<f64>,
    /// Polygon in the plane of the face, world, counter-clockwise for a viewer in front; first vertex not repeated.
    pub ring: Vec<Point3<f64>>,
}

/// `outlines.json`: coordinates relative to `origin`, metres; rings rounded to 0.1 mm.
#[derive(Serialize, Deserialize)]
struct File {
    format: u32,
    origin: [f64; 3],
    stones: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    id: u32,
    normal: [f64; 3],
    ring: Vec<[f64; 3]>,
}

/// Writes `outlines.json` into `dir`, in the order of stone ids.
///
/// # Errors
/// The file cannot be written; an earlier one is kept then.
pub fn write_outlines(dir: &Path, outlines: &[StoneOutline]) -> Result<(), ReportError> {
    let path = dir.join(OUTLINES_FILE);
    let origin = outlines
        .iter()
        .flat_map(|o| o.ring.first())
        .next()
        .map_or(Point3::origin(), |p| p.map(f64::round));
    let round = |v: f64, to: f64| (v * to).round() / to;
    let entry = |o: &StoneOutline| Entry {
        id: o.stone_id,
        normal: o.normal.map(|v| round(v, 1e6)).into(),
        ring: o
            .ring
            .iter()
            .map(|p| (p - origin).map(|v| round(v, 1e4)).into())
            .collect(),
    };
    let mut stones: Vec<Entry> = outlines.iter().map(entry).collect();
    stones.sort_by_key(|s| s.id);
    let file = File {
        format: FORMAT,
        origin: origin.into(),
        stones,
    };
    write_atomically(&path, |partial| {
        let text = serde_json::to_string(&file)?;
        std::fs::write(partial, text.replace("},{", "},\n{"))
    })
    .map_err(ReportError::io("writing the outlines", &path))
}

/// Reads `outlines.json` from `dir`; empty where there is none.
///
/// # Errors
/// The file is damaged or of a later version.
pub fn read_outlines(dir: &Path) -> Result<BTreeMap<u32, StoneOutline>, ReportError> {
    let path = dir.join(OUTLINES_FILE);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(e) => return Err(ReportError::io("reading the outlines", &path)(e)),
    };
    let content = |message: String| ReportError::Content {
        path: path.clone(),
        message,
    };
    let file: File = serde_json::from_slice(&text).map_err(|e| content(e.to_string()))?;
    if file.format != FORMAT {
        return Err(content(format!(
            "outlines of format {}, this version reads {FORMAT}",
            file.format
        )));
    }
    let origin = Point3::from(file.origin);
    let outline = |e: Entry| {
        let ring = e.ring.into_iter().map(|p| origin + Vector3::from(p)).collect();
        (
            e.id,
            StoneOutline {
                stone_id: e.id,
                normal: Vector3::from(e.normal),
                ring,
            },
        )
    };
    Ok(file.stones.into_iter().map(outline).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_come_back_to_a_tenth_of_a_millimetre() {
        let folder = tempfile::tempdir().unwrap();
        assert!(read_outlines(folder.path()).unwrap().is_empty());
        let base = Point3::new(451_234.567_89, 5_601_234.5, 312.25);
        let ring = vec![
            base,
            base + Vector3::y() * 0.3,
            base + Vector3::new(-0.05, 0.3, 0.2),
        ];
        let outlines = [9, 4].map(|stone_id| StoneOutline {
            stone_id,
            normal: Vector3::x(),
            ring: ring.clone(),
        });
        write_outlines(folder.path(), &outlines).unwrap();
        let back = read_outlines(folder.path()).unwrap();
        assert_eq!(back.keys().copied().collect::<Vec<_>>(), [4, 9]);
        assert!(
            back[&4]
                .ring
                .iter()
                .zip(&ring)
                .all(|(a, b)| (a - b).norm() < 1e-4)
        );
        assert_eq!(back[&9].normal, Vector3::x());
    }

    #[test]
    fn a_later_version_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join(OUTLINES_FILE),
            r#"{"format":2,"origin":[0,0,0],"stones":[]}"#,
        )
        .unwrap();
        let message = read_outlines(folder.path()).unwrap_err().to_string();
        assert!(message.contains("format 2"), "{message}");
    }
}
