//! Coloured points with numbers, for programs that show clouds.

use std::path::Path;

use las::{Transform, Vector};
use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

use super::CloudError;
use super::extra_bytes::{Dimension, ExtraType, describe_all};
use super::las::{CopcWriter, Export, crs_record, export_header, transforms_for};
use super::whole::write_whole;

/// Finest step of coordinates, metres.
const FINEST_M: f64 = 1e-4;

/// Takes the points of a COPC file one by one.
pub struct ColouredPoints {
    writer: CopcWriter,
    transforms: Vector<Transform>,
    numbers: usize,
}

impl ColouredPoints {
    /// Adds a point inside the current part, with its sRGB colour and one number for each dimension.
    ///
    /// # Errors
    /// The number of numbers is wrong, or the point lies in a node that no part from this one on reaches into.
    pub fn push(
        &mut self,
        position: Point3<f64>,
        colour: [u8; 3],
        numbers: &[f32],
    ) -> Result<(), CloudError> {
        if numbers.len() != self.numbers {
            let reason = format!("{} numbers for {} dimensions", numbers.len(), self.numbers);
            return Err(CloudError::unwritable(self.writer.name(), reason));
        }
        let record = Export {
            position,
            intensity: 0,
            color: Some(colour.map(|c| u16::from(c) * 257)),
            source: 0,
            gps_time: 0.0,
        };
        let records = self.writer.records(record.rounded(&self.transforms))?;
        record.append(&self.transforms, records);
        records.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        Ok(())
    }
}

/// Writes a cloud-optimised point cloud (COPC 1.0: LAS 1.4, point format 7) of coloured points with single-precision
/// extra dimensions. Programs show it at once, as coarsely as the screen needs; to all others it is a LAZ file.
///
/// `parts`: boxes around the points of each part, in order; memory holds the nodes of the octree that parts to come reach
/// into. `points`: about how many points there are. `dimensions`: one for each number of a point. `crs`: the coordinate
/// system, where it is known: WKT, or `EPSG:` and a code. `fill` hands over the points of a part, by its number.
///
/// # Errors
/// A name or a description does not fit, there is no part, the boxes are too large, `fill` fails, or the file cannot be
/// written; an earlier file is kept then.
pub fn write_coloured_copc<E: From<CloudError>>(
    path: &Path,
    parts: Vec<Bounds>,
    points: u64,
    dimensions: &[Dimension<'_>],
    crs: Option<&str>,
    mut fill: impl FnMut(usize, &mut ColouredPoints) -> Result<(), E>,
) -> Result<(), E> {
    let descriptors = describe_all(path, dimensions.iter().map(|d| (*d, ExtraType::F32)))?;
    let bounds = parts.iter().copied().reduce(|a, b| a.union(&b));
    let bounds = bounds.ok_or_else(|| CloudError::unwritable(path, "a cloud without parts"))?;
    let transforms = transforms_for(&bounds, FINEST_M)
        .ok_or_else(|| CloudError::unwritable(path, format!("too large for LAS: {bounds:?}")))?;
    write_whole(path, |partial| {
        let extra_bytes = dimensions.len() as u16 * ExtraType::F32.size();
        let mut header = export_header(true, transforms, extra_bytes, descriptors);
        header.vlrs.extend(crs.and_then(crs_record));
        let count = parts.len();
        let mut out = ColouredPoints {
            writer: CopcWriter::create(partial, path, header, &bounds, parts, points)?,
            transforms,
            numbers: dimensions.len(),
        };
        for part in 0..count {
            fill(part, &mut out)?;
            out.writer.end_part()?;
        }
        Ok(out.writer.finish(partial)?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{cloud_info, read_cloud};
    use las::copc::VoxelKey;
    use las::{BoundsSelection, CopcReader, LodSelection};
    use std::collections::BTreeSet;

    const WKT: &str = "PROJCS[\"x\",AUTHORITY[\"EPSG\",\"25832\"]]";
    const SIDE: u32 = 600;

    /// A wall of 6 x 6 m, in parts of 1 m along it.
    fn at(i: u32, j: u32) -> Point3<f64> {
        Point3::new(
            451_000.0 + f64::from(i) * 0.01,
            5_601_000.0 + f64::from(i) * 0.003,
            310.25 + f64::from(j) * 0.01,
        )
    }

    fn part(number: u32) -> impl Iterator<Item = (u32, u32)> {
        (number * 100..(number + 1) * 100).flat_map(|i| (0..SIDE).map(move |j| (i, j)))
    }

    fn write(path: &Path) {
        let bounds = |n| Bounds::of(part(n).map(|(i, j)| at(i, j))).unwrap();
        let dimensions = [Dimension::new("place", "", "place of the point")];
        let points = u64::from(SIDE * SIDE);
        write_coloured_copc::<CloudError>(
            path,
            (0..6).map(bounds).collect(),
            points,
            &dimensions,
            Some(WKT),
            |n, out| {
                part(n as u32).try_for_each(|(i, j)| {
                    out.push(at(i, j), [(i % 256) as u8, 0, 255], &[(i * SIDE + j) as f32])
                })
            },
        )
        .unwrap();
    }

    /// The last number of each record.
    fn places(points: &las::PointData) -> Vec<u32> {
        let records = points.raw_bytes().chunks(points.record_len());
        records
            .map(|r| f32::from_le_bytes(r[r.len() - 4..].try_into().unwrap()) as u32)
            .collect()
    }

    #[test]
    fn another_reader_finds_every_point_in_the_node_of_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.copc.laz");
        write(&path);
        let mut reader = CopcReader::from_path(&path).unwrap();
        let info = reader.header().copc_info_vlr().unwrap();
        let entries: Vec<_> = reader.hierarchy_entries().collect();
        let mut levels = [0; 3];
        let mut seen = BTreeSet::new();
        for entry in &entries {
            assert!(entry.key.l == 0 || entries.iter().any(|e| e.key == entry.key.parent()));
            let bounds = entry.key.bounds(&info);
            let points = reader.read_entry(entry).unwrap();
            levels[entry.key.l as usize] += points.len();
            for place in places(&points) {
                assert!(seen.insert(place));
                let p = at(place / SIDE, place % SIDE);
                let inside = |v: f64, min: f64, max: f64| v > min - 1e-4 && v < max + 1e-4;
                assert!(inside(p.x, bounds.min.x, bounds.max.x));
                assert!(inside(p.y, bounds.min.y, bounds.max.y));
                assert!(inside(p.z, bounds.min.z, bounds.max.z));
            }
        }
        assert_eq!(seen.len() as u32, SIDE * SIDE);
        let share = |n: usize| n as f64 / f64::from(SIDE * SIDE) * 21.0;
        assert!((share(levels[0]) - 1.0).abs() < 0.05 && (share(levels[1]) - 4.0).abs() < 0.1);
        // A square of 6.3 m with this many points.
        let spacing = (6.0 * 6.26 / levels[0] as f64).sqrt();
        assert!(
            (info.spacing / spacing - 1.0).abs() < 0.2,
            "{} {spacing}",
            info.spacing
        );

        let corner = BoundsSelection::Within(las::Bounds {
            min: las::Vector {
                x: 451_000.995,
                y: 0.0,
                z: 312.245,
            },
            max: las::Vector {
                x: 451_002.005,
                y: 1e7,
                z: 313.255,
            },
        });
        let found = reader.query(LodSelection::All, corner).unwrap();
        assert_eq!(found.len(), 101 * 101);
        assert!(reader.hierarchy_entry(&VoxelKey::ROOT).is_some());
    }

    #[test]
    fn points_colours_and_the_coordinate_system_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.copc.laz");
        write(&path);
        let info = cloud_info(&path).unwrap();
        assert_eq!(
            (info.records, info.crs.as_deref()),
            (u64::from(SIDE * SIDE), Some(WKT))
        );
        let places = places(&las::Reader::from_path(&path).unwrap().read_all().unwrap());
        let mut read = 0;
        read_cloud(&path, 20_000, |chunk| {
            for (n, p) in chunk.positions.iter().enumerate() {
                let place = places[chunk.indices[n] as usize];
                assert!((p - at(place / SIDE, place % SIDE)).norm() < 1e-4);
                let red = u16::from((place / SIDE % 256) as u8) * 257;
                assert_eq!(chunk.colors.as_ref().unwrap()[n], [red, 0, 65_535]);
            }
            read += chunk.positions.len();
            Ok::<(), CloudError>(())
        })
        .unwrap();
        assert_eq!(read, places.len());
    }

    #[test]
    fn one_point_and_none_make_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.copc.laz");
        for count in [1, 0] {
            let bounds = vec![Bounds::of([at(0, 0)]).unwrap()];
            write_coloured_copc::<CloudError>(&path, bounds, 1, &[], None, |_, out| {
                (0..count).try_for_each(|_| out.push(at(0, 0), [1; 3], &[]))
            })
            .unwrap();
            let mut reader = CopcReader::from_path(&path).unwrap();
            assert!(reader.hierarchy_entry(&VoxelKey::ROOT).is_some());
            assert_eq!(
                reader
                    .query(LodSelection::All, BoundsSelection::All)
                    .unwrap()
                    .len(),
                count
            );
        }
    }

    #[test]
    fn points_of_a_part_before_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.copc.laz");
        let part = |from, to| Bounds::of([at(from, from), at(to, to)]).unwrap();
        let parts = vec![part(0, 10), part(500, 510)];
        let refused = write_coloured_copc::<CloudError>(&path, parts, 1_000_000, &[], None, |_, out| {
            (0..100).try_for_each(|_| out.push(at(0, 0), [0; 3], &[]))
        });
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("outside the box of their part"), "{refused}");
        assert!(!path.exists());
    }

    #[test]
    fn an_earlier_file_is_kept_if_a_point_lacks_a_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.copc.laz");
        write(&path);
        let dimensions = [Dimension::new("place", "", "place of the point")];
        let bounds = Bounds::of([at(0, 0), at(1, 1)]).unwrap();
        let wrong = write_coloured_copc::<CloudError>(&path, vec![bounds], 1, &dimensions, None, |_, out| {
            out.push(at(0, 0), [0; 3], &[])
        });
        let wrong = wrong.unwrap_err().to_string();
        assert!(wrong.contains("0 numbers for 1 dimensions"), "{wrong}");
        assert_eq!(cloud_info(&path).unwrap().records, u64::from(SIDE * SIDE));
    }
}
