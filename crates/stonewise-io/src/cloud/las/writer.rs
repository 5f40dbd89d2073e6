//! Writing LAZ files.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use las::{Builder, Header, PointDataBuilder, raw};
use laz::ParLasZipCompressor;

use super::crs_record::is_wkt;
use super::las_error::las_error;
use crate::cloud::CloudError;
use crate::cloud::guard::guarded_write;

/// Bit of the header that says where the coordinate system is (LAS 1.4 R15, table 4).
const WKT_BIT: u16 = 16;

/// A LAZ file that is being written, compressed by all threads.
///
/// Nothing is written when it is dropped: a file is complete only after [`finish`](Self::finish).
pub struct LazWriter {
    name: PathBuf,
    header: Header,
    compressor: ParLasZipCompressor<BufWriter<File>>,
}

impl LazWriter {
    /// Starts a file at `partial`; errors name it `name`.
    pub fn create(partial: &Path, name: &Path, mut builder: Builder) -> Result<Self, CloudError> {
        builder.point_format.is_compressed = true;
        let mut header = builder.into_header().map_err(|e| unwritable(name, e))?;
        header.clear();
        header.add_laz_vlr().map_err(|e| unwritable(name, e))?;
        let vlr = header.laz_vlr().map_err(|e| unwritable(name, e))?;
        let file = File::create(partial).map_err(|e| CloudError::write(name, e))?;
        let mut file = BufWriter::with_capacity(1 << 20, file);
        header.write_to(&mut file).map_err(|e| unwritable(name, e))?;
        let compressor = ParLasZipCompressor::new(file, vlr).map_err(|e| unwritable(name, e.into()))?;
        Ok(Self {
            name: name.to_owned(),
            header,
            compressor,
        })
    }

    /// Appends whole point records.
    pub fn write(&mut self, records: Vec<u8>) -> Result<(), CloudError> {
        if records.is_empty() {
            return Ok(());
        }
        let points = PointDataBuilder::new()
            .for_header(&self.header)
            .build_from_bytes(records)
            .map_err(|e| unwritable(&self.name, e))?;
        self.header.add_point_data(&points);
        let Self { name, compressor, .. } = self;
        guarded_write(name, || {
            let written = compressor.compress_many(points.raw_bytes());
            written.map_err(|e| CloudError::write(name, e))
        })
    }

    /// Writes what comes after the points, and the final header.
    pub fn finish(mut self) -> Result<(), CloudError> {
        guarded_write(&self.name, || {
            let done = self.compressor.done();
            done.map_err(|e| unwritable(&self.name, e.into()))
        })?;
        let mut file = self.compressor.into_inner();
        write_end(&mut file, self.header).map_err(|e| unwritable(&self.name, e))?;
        file.flush().map_err(|e| CloudError::write(&self.name, e))
    }
}

fn write_end(file: &mut BufWriter<File>, header: Header) -> las::Result<()> {
    let start = file.seek(SeekFrom::End(0))?;
    let count = header.evlrs().len();
    for record in header.evlrs() {
        record.clone().into_raw(true)?.write_to(&mut *file)?;
    }
    let extended = header.point_format().is_extended;
    let names_keys = header.has_crs_vlrs() && !header.all_vlrs().any(is_wkt);
    let las::Bounds { min, max } = header.bounds();
    let bounds = match header.number_of_points() {
        0 => ([0.0; 3], [0.0; 3]),
        _ => ([min.x, min.y, min.z], [max.x, max.y, max.z]),
    };
    let mut raw = header.into_raw()?;
    raw.evlr = (count > 0).then_some(raw::header::Evlr {
        start_of_first_evlr: start,
        number_of_evlrs: u32::try_from(count)?,
    });

    if extended {
        // LAS 1.4: the counts of earlier versions are zero with point formats 6 and later.
        raw.number_of_point_records = 0;
        raw.number_of_points_by_return = [0; 5];
    }

    if names_keys {
        // The crate says that every file of the extended point formats names its system as WKT.
        raw.global_encoding &= !WKT_BIT;
    }

    // The crate widens the box by up to a step.
    [raw.min_x, raw.min_y, raw.min_z] = bounds.0;
    [raw.max_x, raw.max_y, raw.max_z] = bounds.1;
    file.seek(SeekFrom::Start(0))?;
    raw.write_to(&mut *file)
}

/// An error of writing that names the file.
fn unwritable(name: &Path, error: las::Error) -> CloudError {
    match error {
        las::Error::Io(e) | las::Error::LasZipError(laz::LasZipError::IoError(e)) => {
            CloudError::write(name, e)
        }
        other => match las_error(name, other) {
            CloudError::Malformed { path, reason } => CloudError::Unwritable { path, reason },
            other => other,
        },
    }
}
