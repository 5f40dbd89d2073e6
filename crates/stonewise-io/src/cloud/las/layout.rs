//! What a LAS file says about itself, checked against its size before any of it is trusted.

use std::path::Path;

use super::chunks::Chunks;
use super::compression::Compression;
use super::crs_record::named_crs;
use super::envelope::Envelope;
use super::las_error::las_error;
use super::stream::LasStream;
use super::unpack::Packing;
use crate::cloud::CloudError;
use crate::cloud::guard::guarded;

/// The header, and the records after the points, of a LAS file whose sizes agree with the file.
pub struct Layout {
    pub header: las::Header,
    /// All extended variable length records, of which the header has only the first.
    pub extended: Vec<las::Vlr>,
    /// Number of variable length records between the header and the points.
    pub record_count: u32,
    /// How the points are compressed; `None` if they are not.
    pub packing: Option<Packing>,
}

impl Layout {
    /// Reads and checks the header, so that a damaged size can neither exhaust memory nor hide missing
    /// points.
    pub fn open(path: &Path) -> Result<Self, CloudError> {
        let envelope = Envelope::open(path)?;
        let records = envelope.records()?;
        let compression = Compression::of(&envelope, &records)?;
        let packing = compression.map(|compression| {
            Ok::<_, CloudError>(Packing {
                record_bytes: envelope.record_bytes(),
                chunks: guarded(path, || Chunks::check(&envelope, &compression))?,
                compression,
            })
        });
        let packing = packing.transpose()?;
        let extended = envelope.extended_records()?;
        let header = guarded(path, || {
            let stream = LasStream::open(path, records.count).map_err(|e| CloudError::read(path, e))?;
            las::Header::new(stream).map_err(|e| las_error(path, e))
        })?;
        Ok(Self {
            header,
            extended,
            record_count: records.count,
            packing,
        })
    }

    /// The coordinate system: WKT, or `EPSG:` and a code where the file has GeoTIFF keys.
    pub fn crs(&self) -> Option<String> {
        named_crs(self.header.vlrs().iter().chain(&self.extended))
    }
}
