//! What a LAS file says about itself, checked against its size before any of it is trusted.

use std::path::Path;

use super::chunks::Chunks;
use super::compression::Compression;
use super::crs_record::{NamedSystem, named_system};
use super::envelope::{Envelope, more_than_counted};
use super::las_error::las_error;
use super::stream::LasStream;
use super::unpack::Packing;
use crate::cloud::guard::guarded;
use crate::cloud::{CloudError, Remark};
use crate::crs::in_metres;
use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

/// Where the header holds the number of its variable length records (LAS 1.4 R15, table 3).
const RECORD_COUNT: std::ops::Range<u64> = 100..104;

/// The header, and the records after the points, of a LAS file whose sizes agree with the file.
pub struct Layout {
    pub header: las::Header,
    /// All extended variable length records, of which the header has only the first.
    pub extended: Vec<las::Vlr>,
    /// Bytes of the header as they must be to be read, by their places.
    pub sound_header: Vec<(u64, u8)>,
    /// How the points are compressed; `None` if they are not.
    pub packing: Option<Packing>,
    /// The system that the file names, and the units of its coordinates.
    pub system: NamedSystem,
    /// Counts that do not agree with each other or with the bytes.
    pub remarks: Vec<Remark>,
}

impl Layout {
    /// Reads and checks the header, so that a damaged size can neither exhaust memory nor hide missing
    /// points.
    pub fn open(path: &Path) -> Result<Self, CloudError> {
        let mut envelope = Envelope::open(path)?;
        let records = envelope.records()?;
        let compression = Compression::of(&envelope, &records)?;
        let mut packing = None;
        if let Some(compression) = compression {
            let (chunks, held) = guarded(path, || Chunks::check(&envelope, &compression))?;
            let points = envelope.points();
            if held > points {
                envelope.remarks.push(more_than_counted(points, held));
            }
            packing = Some(Packing {
                record_bytes: envelope.record_bytes(),
                chunks,
                compression,
            });
        }
        let extended = envelope.extended_records()?;
        let mut sound_header = envelope.sound_counts();
        sound_header.extend(RECORD_COUNT.zip(records.count.to_le_bytes()));
        let header = guarded(path, || {
            let stream =
                LasStream::open(path, sound_header.clone()).map_err(|e| CloudError::read(path, e))?;
            las::Header::new(stream).map_err(|e| las_error(path, e))
        })?;
        let system = named_system(header.vlrs().iter().chain(&extended)).map_err(|reason| {
            let fix = "transform it to a system in metres";
            CloudError::malformed(path, format!("{reason}: {fix}"))
        })?;
        Ok(Self {
            header,
            extended,
            sound_header,
            packing,
            system,
            remarks: envelope.remarks,
        })
    }

    /// The coordinate system in metres: WKT, or `EPSG:` and a code where the file has GeoTIFF keys.
    pub fn crs(&self) -> Option<String> {
        self.system.text.as_deref().map(in_metres)
    }

    /// The box that the header states, metres; `None` without points.
    pub fn bounds(&self) -> Option<Bounds> {
        let las::Bounds { min, max } = self.header.bounds();
        let corner = |v: las::Vector<f64>| self.system.units.to_metres(Point3::new(v.x, v.y, v.z));
        (self.header.number_of_points() > 0).then(|| Bounds {
            min: corner(min),
            max: corner(max),
        })
    }
}
