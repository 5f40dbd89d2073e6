//! Coloured points with numbers, for programs that show clouds.

use std::path::Path;

use las::{Transform, Vector};
use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

use super::CloudError;
use super::extra_bytes::{Dimension, ExtraType, describe_all};
use super::las::{Export, LazWriter, crs_record, export_header, transforms_for};
use super::whole::write_whole;

/// Finest step of coordinates, metres.
const FINEST_M: f64 = 1e-4;
const CHUNK_POINTS: usize = 400_000;

/// Takes the points of a LAZ file one by one; memory holds a chunk of them.
pub struct ColouredPoints {
    writer: LazWriter,
    transforms: Vector<Transform>,
    numbers: usize,
    records: Vec<u8>,
    waiting: usize,
}

impl ColouredPoints {
    /// Adds a point inside the file's box, with its sRGB colour and one number for each dimension.
    ///
    /// # Errors
    /// The number of numbers is wrong, or the file cannot be written.
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
        record.append(&self.transforms, &mut self.records);
        self.records.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        self.waiting += 1;
        if self.waiting == CHUNK_POINTS {
            self.flush()
        } else {
            Ok(())
        }
    }

    fn flush(&mut self) -> Result<(), CloudError> {
        self.waiting = 0;
        self.writer.write(std::mem::take(&mut self.records))
    }
}

/// Writes a LAZ file (LAS 1.4, point format 7) of coloured points with single-precision extra dimensions.
///
/// `bounds`: a box around all points. `dimensions`: one for each number of a point. `crs`: the coordinate
/// system, where it is known: WKT, or `EPSG:` and a code. `fill` hands over the points.
///
/// # Errors
/// A name or a description does not fit, the box is too large, `fill` fails, or the file cannot be written;
/// an earlier file is kept then.
pub fn write_coloured_laz<E: From<CloudError>>(
    path: &Path,
    bounds: &Bounds,
    dimensions: &[Dimension<'_>],
    crs: Option<&str>,
    fill: impl FnOnce(&mut ColouredPoints) -> Result<(), E>,
) -> Result<(), E> {
    let descriptors = describe_all(path, dimensions.iter().map(|d| (*d, ExtraType::F32)))?;
    let transforms = transforms_for(bounds, FINEST_M)
        .ok_or_else(|| CloudError::unwritable(path, format!("too large for LAS: {bounds:?}")))?;
    write_whole(path, |partial| {
        let extra_bytes = dimensions.len() as u16 * ExtraType::F32.size();
        let mut header = export_header(true, transforms, extra_bytes, descriptors);
        header.vlrs.extend(crs.and_then(crs_record));
        let mut points = ColouredPoints {
            writer: LazWriter::create(partial, path, header)?,
            transforms,
            numbers: dimensions.len(),
            records: Vec::new(),
            waiting: 0,
        };
        fill(&mut points)?;
        points.flush()?;
        Ok(points.writer.finish()?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{cloud_info, read_cloud};

    #[test]
    fn points_colours_and_the_coordinate_system_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.laz");
        let at = |i: u32| Point3::new(451_000.0 + f64::from(i) * 0.01, 5_601_000.0, 310.25);
        let bounds = Bounds::of((0..1000).map(at)).unwrap();
        let wkt = "PROJCS[\"x\",AUTHORITY[\"EPSG\",\"25832\"]]";
        let dimensions = [Dimension::new("d_out", "m", "displacement")];
        write_coloured_laz::<CloudError>(&path, &bounds, &dimensions, Some(wkt), |points| {
            (0..1000).try_for_each(|i| points.push(at(i), [i as u8, 0, 255], &[i as f32]))
        })
        .unwrap();
        let info = cloud_info(&path).unwrap();
        assert_eq!((info.records, info.crs.as_deref()), (1000, Some(wkt)));
        read_cloud(&path, 2000, |chunk| {
            for i in [0, 500, 999] {
                assert!((chunk.positions[i] - at(i as u32)).norm() < 1e-4);
                assert_eq!(
                    chunk.colors.as_ref().unwrap()[i],
                    [u16::from(i as u8) * 257, 0, 65_535]
                );
            }
            Ok::<(), CloudError>(())
        })
        .unwrap();
        // The number of a point is single precision at the end of its record.
        let records = las::Reader::from_path(&path).unwrap().read_all().unwrap();
        for (i, record) in records.raw_bytes().chunks(records.record_len()).enumerate() {
            assert_eq!(record[record.len() - 4..], (i as f32).to_le_bytes());
        }
        let wrong = write_coloured_laz::<CloudError>(&path, &bounds, &dimensions, None, |p| {
            p.push(at(0), [0; 3], &[])
        });
        let wrong = wrong.unwrap_err().to_string();
        assert!(wrong.contains("0 numbers for 1 dimensions"), "{wrong}");
        // The file of before is kept.
        assert_eq!(cloud_info(&path).unwrap().records, 1000);
    }
}
