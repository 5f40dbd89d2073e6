//! The header of a LAS file and its records, as sizes and places alone.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use las::raw;
use laz::LazVlr;

use super::las_error::las_error;
use crate::cloud::{CloudError, Remark};

/// Bytes of a variable length record before its data.
const RECORD_HEAD: usize = 54;
/// Bytes of an extended record before its data.
const EXTENDED_HEAD: usize = 60;

/// The raw header and the length of the file.
pub struct Envelope {
    pub path: PathBuf,
    pub length: u64,
    pub raw: raw::Header,
    /// Counts that do not agree with each other or with the bytes.
    pub remarks: Vec<Remark>,
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
        if raw.version > las::Version::new(1, 4) {
            let reason = format!("LAS {} is not supported: write it as LAS 1.4", raw.version);
            return Err(CloudError::malformed(path, reason));
        }
        let mut envelope = Self {
            path: path.to_owned(),
            length,
            raw,
            remarks: Vec::new(),
        };
        envelope.check_sizes()?;
        Ok(envelope)
    }

    /// Number of points that the header claims. Of two counts that differ, the larger field holds for point formats 6 to 10,
    /// whose legacy field must be 0, and the legacy field for all others (LAS 1.4 R15, section 2.4).
    pub fn points(&self) -> u64 {
        let legacy = u64::from(self.raw.number_of_point_records);
        let large = self.raw.large_file.map_or(0, |l| l.number_of_point_records);
        let is_extended = self.raw.point_data_record_format & 0x3f >= 6;
        match (legacy, large) {
            (0, count) | (count, 0) => count,
            (_, large) if is_extended => large,
            (legacy, _) => legacy,
        }
    }

    /// The header's counts as they must be for a reader that takes the legacy one first, by their places (LAS 1.4 R15,
    /// table 3).
    pub fn sound_counts(&self) -> Vec<(u64, u8)> {
        let points = self.points();
        let legacy = u32::try_from(points).unwrap_or(0).to_le_bytes();
        let mut bytes: Vec<(u64, u8)> = (107..).zip(legacy).collect();
        if self.raw.large_file.is_some() {
            bytes.extend((247..).zip(points.to_le_bytes()));
        }
        bytes
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

    fn check_sizes(&mut self) -> Result<(), CloudError> {
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
        let points = self.points();
        let counts = [
            u64::from(self.raw.number_of_point_records),
            self.raw.large_file.map_or(points, |l| l.number_of_point_records),
        ];
        if counts.iter().any(|&count| count != 0 && count != points) {
            let [legacy, large] = counts;
            let remark = format!("its header counts {legacy} and {large} points: {points} are read");
            self.remarks.push(Remark::note(remark));
        }
        if self.is_compressed() {
            return Ok(());
        }
        let room = |end: u64| (end.saturating_sub(self.start())) / self.record_bytes().max(1);
        if room(self.length) < points {
            let reason = format!("it holds {} of {points} points", room(self.length));
            return Err(CloudError::truncated(&self.path, reason));
        }
        // Waveforms and extended records may follow the points.
        let waveforms = self
            .raw
            .start_of_waveform_data_packet_record
            .filter(|&place| place > 0);
        let extended = self.raw.evlr.filter(|e| e.number_of_evlrs > 0);
        let ends = [waveforms, extended.map(|e| e.start_of_first_evlr)];
        let held = room(ends.into_iter().flatten().fold(self.length, u64::min));
        if held > points {
            self.remarks.push(more_than_counted(points, held));
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
        if place.number_of_evlrs > 0 && start.saturating_add(EXTENDED_HEAD as u64) > self.length {
            let reason = format!(
                "its extended records (EVLR), which may name its coordinate system, should begin at byte {start} of {}",
                self.length
            );
            return Err(CloudError::truncated(&self.path, reason));
        }
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

/// What is said of a file with points that its header does not count.
pub fn more_than_counted(points: u64, held: u64) -> Remark {
    Remark::doubt(format!(
        "its header counts {points} points, and there is room for {held}: only {points} are read"
    ))
}
