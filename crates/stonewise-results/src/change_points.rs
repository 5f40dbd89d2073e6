//! The M3C2 core points, as the report reads them.

use nalgebra::{Point3, Vector3};
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_io::table::{CsvError, CsvFile};

/// A core point with its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistancePoint {
    /// Where, world.
    pub position: Point3<f64>,
    /// Unit normal out of the wall, where the file has normals.
    pub normal: Option<Vector3<f64>>,
    /// Signed distance along the normal, metres.
    pub distance_m: f64,
    /// 95 % detection limit, metres.
    pub detection_limit_m: f64,
    /// Points of the later epoch for each of the first in the cylinder; `None` where the file has no counts.
    pub count_ratio: Option<f64>,
}

/// The core points of an `m3c2.csv`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct CorePoints {
    /// Core points with a distance.
    pub distances: Vec<DistancePoint>,
    /// Places of the others, world.
    pub without_distance: Vec<Point3<f64>>,
}

/// Reads an `m3c2.csv`, columns by name; empty where there is no such file.
///
/// # Errors
/// The file cannot be read, lacks a column or holds something that is no number.
pub(super) fn read_distance_points(path: &Path) -> Result<CorePoints, Error> {
    let Some(file) = read_csv(path)? else {
        return Ok(CorePoints::default());
    };
    let damaged = |e: CsvError| Error::results(path, e.said());
    let find = |wanted: &[&str]| {
        file.head()
            .iter()
            .position(|n| wanted.iter().any(|w| n.eq_ignore_ascii_case(w)))
    };
    let need = |wanted: &[&str]| {
        find(wanted).ok_or_else(|| Error::results(path, format!("no column {:?}", wanted[0])))
    };
    let place = [need(&["x"])?, need(&["y"])?, need(&["z"])?];
    let (distance, limit) = (need(&["m3c2_distance"])?, need(&["m3c2_uncertainty"])?);
    let normal = [
        find(&["nx", "normalx"]),
        find(&["ny", "normaly"]),
        find(&["nz", "normalz"]),
    ];
    let counts = [find(&["m3c2_count1"]), find(&["m3c2_count2"])];
    let mut points = CorePoints::default();
    for row in file.rows() {
        let row = row.map_err(damaged)?;
        let value = |column: usize| row.number(column).map(|v| v.unwrap_or(f64::NAN)).map_err(damaged);
        let position = Point3::new(value(place[0])?, value(place[1])?, value(place[2])?);
        let distance_m = value(distance)?;
        if !distance_m.is_finite() {
            points.without_distance.push(position);
            continue;
        }
        let normal = match normal {
            [Some(x), Some(y), Some(z)] => Some(Vector3::new(value(x)?, value(y)?, value(z)?)),
            _ => None,
        };
        let count_ratio = match counts {
            [Some(first), Some(later)] => Some(value(later)? / value(first)?),
            _ => None,
        };
        points.distances.push(DistancePoint {
            position,
            count_ratio: count_ratio.filter(|r| r.is_finite()),
            normal,
            distance_m,
            detection_limit_m: value(limit)?,
        });
    }
    Ok(points)
}

/// A CSV file of the results; `None` where there is no such file.
///
/// # Errors
/// The file cannot be read, or is damaged.
pub(super) fn read_csv(path: &Path) -> Result<Option<CsvFile>, Error> {
    match std::fs::read(path) {
        Ok(bytes) => {
            let file = CsvFile::parse(path, bytes).map_err(|e| Error::results(path, e.said()))?;
            Ok(Some(file))
        }
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::io("reading results", path)(e)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_name_and_points_without_distance_kept_apart() {
        let folder = tempfile::tempdir().unwrap();
        let missing = read_distance_points(&folder.path().join("m3c2.csv")).unwrap();
        assert_eq!(missing, CorePoints::default());
        let csv = "x,y,z,m3c2_uncertainty,m3c2_distance\n1,2,3,0.001,-0.02\n4,5,6,,\n7,8,9,NaN,nan\n";
        std::fs::write(folder.path().join("m3c2.csv"), csv).unwrap();
        let CorePoints {
            distances: points,
            without_distance,
        } = read_distance_points(&folder.path().join("m3c2.csv")).unwrap();
        assert_eq!(
            without_distance,
            [Point3::new(4.0, 5.0, 6.0), Point3::new(7.0, 8.0, 9.0)]
        );
        assert_eq!(points.len(), 1);
        assert_eq!(
            (
                points[0].distance_m,
                points[0].detection_limit_m,
                points[0].normal,
                points[0].count_ratio,
            ),
            (-0.02, 0.001, None, None)
        );
        let csv =
            "x,y,z,m3c2_distance,m3c2_uncertainty,m3c2_count1,m3c2_count2\n1,2,3,0,0,8,6\n1,2,3,0,0,,6\n";
        std::fs::write(folder.path().join("m3c2.csv"), csv).unwrap();
        let points = read_distance_points(&folder.path().join("m3c2.csv")).unwrap();
        let ratios: Vec<_> = points.distances.iter().map(|p| p.count_ratio).collect();
        assert_eq!(ratios, [Some(0.75), None]);
    }

    #[test]
    fn a_word_where_a_number_should_be_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join("m3c2.csv"),
            "x,y,z,m3c2_distance,m3c2_uncertainty\n1,2,up,0,0\n",
        )
        .unwrap();
        let message = read_distance_points(&folder.path().join("m3c2.csv"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("line 2") && message.contains("up"), "{message}");
    }
}
