//! The file of stone outlines.

use super::names::OUTLINES;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_core::geometry::FaceFrame;
use stonewise_io::atomic::write_atomically;

/// Version of its layout.
const FORMAT: u32 = 1;

/// The outline of one stone of epoch 1 and the way its face looks.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneOutline {
    /// The stone.
    pub stone_id: u32,
    /// Unit normal of its face, out of the wall, world.
    pub normal: Vector3<f64>,
    /// Polygon in the plane of the face, world, counter-clockwise for a viewer in front; first vertex not
    /// repeated.
    pub ring: Vec<Point3<f64>>,
}

/// Least vertical part of a normal of [`StoneOutline::seen_from_above`]: 0.5 %, half a millimetre on a face
/// 20 cm high.
const LEAST_LEAN: f64 = 0.005;

impl StoneOutline {
    /// The ring as a polygon whose plan, x and y alone, is valid too.
    ///
    /// Simple-features geometry is judged in plan, where a stone of a vertical wall is a line. The ring is
    /// laid flat into its plane, which rounding took it out of by up to 0.1 mm, and a plane steeper than 0.5
    /// % leans back that far about its middle.
    pub fn seen_from_above(&self) -> Vec<Point3<f64>> {
        let face = FaceFrame::from_normal(&self.normal);
        let lean = LEAST_LEAN.copysign(self.normal.z);
        let leaning = match self.normal.z.abs() < LEAST_LEAN {
            true => FaceFrame::from_normal(&(self.normal - Vector3::z() * (self.normal.z - lean))),
            false => face,
        };
        let sum: Vector3<f64> = self.ring.iter().map(|p| p.coords).sum();
        let middle = Point3::from(sum / self.ring.len().max(1) as f64);
        let lay = |p: &Point3<f64>| {
            let d = p - middle;
            middle + leaning.along * d.dot(&face.along) + leaning.up * d.dot(&face.up)
        };
        self.ring.iter().map(lay).collect()
    }
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
pub fn write_outlines(dir: &Path, outlines: &[StoneOutline]) -> Result<(), Error> {
    let path = dir.join(OUTLINES);
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
    .map_err(Error::io("writing the outlines", &path))
}

/// Reads `outlines.json` from `dir`; empty where there is none.
///
/// # Errors
/// The file is damaged or of a later version.
pub fn read_outlines(dir: &Path) -> Result<BTreeMap<u32, StoneOutline>, Error> {
    let path = dir.join(OUTLINES);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(e) => return Err(Error::io("reading the outlines", &path)(e)),
    };
    let content = |message: String| Error::Results {
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

    /// Whether no two edges of a ring that do not share an end cross in plan, tried pair by pair.
    fn is_simple(ring: &[Point3<f64>]) -> bool {
        let n = ring.len();
        let side = |a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>| (b - a).xy().perp(&(c - a).xy());
        let cross = |i: usize, j: usize| {
            let [a, b] = [&ring[i], &ring[(i + 1) % n]];
            let [c, d] = [&ring[j], &ring[(j + 1) % n]];
            side(a, b, c) * side(a, b, d) <= 0.0 && side(c, d, a) * side(c, d, b) <= 0.0
        };
        (0..n).all(|i| (i + 2..n).all(|j| (i == 0 && j == n - 1) || !cross(i, j)))
    }

    #[test]
    fn stones_of_steep_walls_are_polygons_in_plan() {
        // A stone with a notch, on walls that lean back, stand upright to rounding and exactly, and overhang.
        let corners = [
            (0.0, 0.0),
            (0.4, 0.02),
            (0.38, 0.2),
            (0.21, 0.18),
            (0.2, 0.05),
            (0.19, 0.19),
            (0.01, 0.21),
        ];
        for z in [0.2, 0.004, 0.0, -0.000_2, -0.1] {
            let normal = Vector3::new(0.6, -0.8, z).normalize();
            let face = FaceFrame::from_normal(&normal);
            let rounded = |v: f64| (v * 1e4).round() / 1e4;
            let place = |(a, u): &(f64, f64)| Point3::from(face.along * *a + face.up * *u).map(rounded);
            let outline = StoneOutline {
                stone_id: 1,
                normal,
                ring: corners.iter().map(place).collect(),
            };
            let plan = outline.seen_from_above();
            assert!(is_simple(&plan), "{z}");
            let apart = plan.iter().zip(&outline.ring).map(|(p, q)| (p - q).norm());
            assert!(apart.fold(0.0, f64::max) < 0.001, "{z}");
        }
        assert!(!is_simple(
            &[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)].map(|(x, y)| Point3::new(x, y, 0.0))
        ));
    }

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
        std::fs::create_dir(folder.path().join("data")).unwrap();
        std::fs::write(
            folder.path().join(OUTLINES),
            r#"{"format":2,"origin":[0,0,0],"stones":[]}"#,
        )
        .unwrap();
        let message = read_outlines(folder.path()).unwrap_err().to_string();
        assert!(message.contains("format 2"), "{message}");
    }
}
