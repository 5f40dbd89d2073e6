//! The header of a LAS file and its records, as sizes and places alone.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use las::raw;
use laz::LazVlr;

use super::las_error::las_error;
use crate::cloud::CloudError;

/// Bytes of a variable length record before its data.
const RECORD_HEAD: usize = 54;
/// Bytes of an extended record before its data.
const EXTENDED_HEAD: usize = 60;

/// The raw header and the length of the file.
pub struct Envelope {
    pub path: PathBuf,
    pub length: u64,
    pub raw: raw::Header,
}

/// The variable length records between the header and the points.
pub struct Records {
    /// How many there are; the header may claim another number.
    pub count: u32,
    /// Data of the record that describes the compression.
    pub laszip: Option<Vec<u8>>,
}

impl Envelope {
    /// Reads the header and checks what it says about the points.
    pub fn open(path: &Path) -> Result<Self, CloudError> {
        let file = File::open(path).map_err(|e| CloudError::read(path, e))?;
        let length = file.metadata().map_err(|e| CloudError::read(path, e))?.len();
        let raw = raw::Header::read_from(BufReader::new(file)).map_err(|e| las_error(path, e))?;
        let envelope = Self {
            path: path.to_owned(),
            length,
            raw,
        };
        envelope.check_sizes()?;
        Ok(envelope)
    }

    /// Number of points that the header claims.
    pub fn points(&self) -> u64 {
        let large = self.raw.large_file.map_or(0, |l| l.number_of_point_records);
        match self.raw.number_of_point_records {
            0 => large,
            n => u64::from(n),
        }
    }

    /// Where the points begin.
    pub fn start(&self) -> u64 {
        u64::from(self.raw.offset_to_point_data)
    }

    /// Bytes of an uncompressed point.
    pub fn record_bytes(&self) -> u64 {
        u64::from(self.raw.point_data_record_length)
    }

    pub fn is_compressed(&self) -> bool {
        self.raw.point_data_record_format & 0x80 != 0
    }

    fn check_sizes(&self) -> Result<(), CloudError> {
        if self.start() > self.length {
            return Err(CloudError::truncated(&self.path, "it ends inside its header"));
        }
        let transform = [
            self.raw.x_scale_factor,
            self.raw.y_scale_factor,
            self.raw.z_scale_factor,
            self.raw.x_offset,
            self.raw.y_offset,
            self.raw.z_offset,
        ];
        if !transform.iter().all(|t| t.is_finite()) || transform[..3].contains(&0.0) {
            let reason = format!("impossible scale or offset in the header: {transform:?}");
            return Err(CloudError::malformed(&self.path, reason));
        }
        let room = (self.length - self.start()) / self.record_bytes().max(1);
        if !self.is_compressed() && room < self.points() {
            let reason = format!("it holds {room} of {} points", self.points());
            return Err(CloudError::truncated(&self.path, reason));
        }
        Ok(())
    }

    /// Walks along the records; those that the header claims beyond the beginning of the points are not
    /// there.
    ///
    /// In a compressed file the walk goes beyond the claimed number until the compression is described.
    pub fn records(&self) -> Result<Records, CloudError> {
        let read = |e| CloudError::read(&self.path, e);
        let mut file = BufReader::new(File::open(&self.path).map_err(read)?);
        let least_header = self.raw.version.header_size();
        let mut place = u64::from(self.raw.header_size.max(least_header));
        let claimed = self.raw.number_of_variable_length_records;
        let mut records = Records {
            count: 0,
            laszip: None,
        };
        file.seek(SeekFrom::Start(place)).map_err(read)?;
        while records.count < claimed || (self.is_compressed() && records.laszip.is_none()) {
            if place + RECORD_HEAD as u64 > self.start() {
                break;
            }
            let mut head = [0; RECORD_HEAD];
            file.read_exact(&mut head).map_err(read)?;
            let size = u16::from_le_bytes([head[20], head[21]]);
            let end = place + RECORD_HEAD as u64 + u64::from(size);
            if end > self.start() {
                break;
            }
            let mut data = vec![0; usize::from(size)];
            file.read_exact(&mut data).map_err(read)?;
            if head[2..18].starts_with(LazVlr::USER_ID.as_bytes()) {
                records.laszip.get_or_insert(data);
            }
            records.count += 1;
            place = end;
        }
        Ok(records)
    }

    /// The records after the points.
    pub fn extended_records(&self) -> Result<Vec<las::Vlr>, CloudError> {
        let Some(place) = self.raw.evlr else {
            return Ok(Vec::new());
        };
        let read = |e| CloudError::read(&self.path, e);
        let mut file = BufReader::new(File::open(&self.path).map_err(read)?);
        let mut start = place.start_of_first_evlr;
        let mut records = Vec::new();
        for _ in 0..place.number_of_evlrs {
            file.seek(SeekFrom::Start(start)).map_err(read)?;
            let mut head = [0; EXTENDED_HEAD];
            file.read_exact(&mut head).map_err(read)?;
            let size = head[20..28].iter().rev().fold(0, |n, &b| n << 8 | u64::from(b));
            let end = start.checked_add(EXTENDED_HEAD as u64);
            let end = end.and_then(|s| s.checked_add(size));
            let Some(end) = end.filter(|&end| end <= self.length) else {
                return Err(CloudError::truncated(
                    &self.path,
                    "it ends inside an extended record",
                ));
            };
            file.seek(SeekFrom::Start(start)).map_err(read)?;
            let record = raw::Vlr::read_from(&mut file, true).map_err(|e| las_error(&self.path, e))?;
            records.push(las::Vlr::new(record));
            start = end;
        }
        Ok(records)
    }
}
