//! What a LAS file says about itself, checked against its size before any of it is trusted.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use las::raw;
use laz::laszip::ChunkTable;

use crate::cloud::CloudError;
use crate::cloud::guard::guarded;

/// No sensible file has chunks larger than this when unpacked; LAZ chunks are usually 50,000 points.
const MAX_CHUNK_BYTES: u64 = 1 << 32;

/// The header, and the records after the points, of a LAS file whose sizes agree with the file.
pub struct Layout {
    pub header: las::Header,
    /// All extended variable length records, of which the header has only the first.
    pub extended: Vec<las::Vlr>,
}

impl Layout {
    /// Reads and checks the header, so that a damaged size can neither exhaust memory nor hide missing points.
    pub fn open(path: &Path) -> Result<Self, CloudError> {
        let check = Check::open(path)?;
        check.sizes()?;
        let extended = check.extended_records()?;
        let header = guarded(path, || {
            let file = File::open(path).map_err(|e| CloudError::read(path, e))?;
            las::Header::new(BufReader::new(file)).map_err(|e| las_error(path, e))
        })?;
        if header.point_format().is_compressed {
            guarded(path, || check.chunks(&header))?;
        }
        Ok(Self { header, extended })
    }

    /// The coordinate system: WKT, or `EPSG:` and a code where the file has GeoTIFF keys.
    pub fn crs(&self) -> Option<String> {
        let records = || self.header.vlrs().iter().chain(&self.extended);
        let wkt = records().find(|v| v.user_id == "LASF_Projection" && v.record_id == 2112);
        if let Some(record) = wkt {
            let text = String::from_utf8_lossy(&record.data);
            let text = text.trim_end_matches('\0').trim();
            return (!text.is_empty()).then(|| text.to_owned());
        }
        let keys = records().find(|v| v.user_id == "LASF_Projection" && v.record_id == 34735)?;
        epsg(&keys.data).map(|code| format!("EPSG:{code}"))
    }
}

/// The code of the projected system (key 3072), else of the geographic one (2048), in a GeoTIFF key directory.
fn epsg(directory: &[u8]) -> Option<u16> {
    let (words, _) = directory.as_chunks::<2>();
    let words: Vec<u16> = words.iter().map(|b| u16::from_le_bytes(*b)).collect();
    let (entries, _) = words.get(4..)?.as_chunks::<4>();
    let value = |key: u16| {
        let found = entries.iter().find(|[id, place, _, _]| *id == key && *place == 0);
        found.map(|[_, _, _, value]| *value)
    };
    value(3072).or_else(|| value(2048)).filter(|code| *code != 32767)
}

pub fn las_error(path: &Path, error: las::Error) -> CloudError {
    match error {
        las::Error::Io(e) | las::Error::LasZipError(laz::LasZipError::IoError(e)) => {
            CloudError::read(path, e)
        }
        other => CloudError::malformed(path, other.to_string()),
    }
}

struct Check {
    path: PathBuf,
    length: u64,
    raw: raw::Header,
}

impl Check {
    fn open(path: &Path) -> Result<Self, CloudError> {
        let file = File::open(path).map_err(|e| CloudError::read(path, e))?;
        let length = file.metadata().map_err(|e| CloudError::read(path, e))?.len();
        let raw = raw::Header::read_from(BufReader::new(file)).map_err(|e| las_error(path, e))?;
        Ok(Self {
            path: path.to_owned(),
            length,
            raw,
        })
    }

    fn points(&self) -> u64 {
        let large = self.raw.large_file.map_or(0, |l| l.number_of_point_records);
        match self.raw.number_of_point_records {
            0 => large,
            n => u64::from(n),
        }
    }

    fn sizes(&self) -> Result<(), CloudError> {
        let start = u64::from(self.raw.offset_to_point_data);
        if start > self.length {
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
        let record = u64::from(self.raw.point_data_record_length);
        let compressed = self.raw.point_data_record_format & 0x80 != 0;
        if !compressed && (self.length - start) / record.max(1) < self.points() {
            let held = (self.length - start) / record.max(1);
            let reason = format!("it holds {held} of {} points", self.points());
            return Err(CloudError::truncated(&self.path, reason));
        }
        Ok(())
    }

    fn extended_records(&self) -> Result<Vec<las::Vlr>, CloudError> {
        let Some(place) = self.raw.evlr else {
            return Ok(Vec::new());
        };
        let read = |e| CloudError::read(&self.path, e);
        let mut file = BufReader::new(File::open(&self.path).map_err(read)?);
        let mut start = place.start_of_first_evlr;
        let mut records = Vec::new();
        for _ in 0..place.number_of_evlrs {
            file.seek(SeekFrom::Start(start)).map_err(read)?;
            let mut head = [0; 60];
            file.read_exact(&mut head).map_err(read)?;
            let size = head[20..28].iter().rev().fold(0, |n, &b| n << 8 | u64::from(b));
            let end = start.checked_add(60).and_then(|s| s.checked_add(size));
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

    fn chunks(&self, header: &las::Header) -> Result<(), CloudError> {
        let vlr = header.laz_vlr().map_err(|e| las_error(&self.path, e))?;
        let record = u64::from(header.point_format().len());
        if vlr.items_size() != record {
            let reason = "the compression record does not fit the point format";
            return Err(CloudError::malformed(&self.path, reason));
        }
        let fixed = !vlr.uses_variable_size_chunks();
        if fixed && u64::from(vlr.chunk_size()) * record > MAX_CHUNK_BYTES {
            let reason = format!("impossible chunk of {} points", vlr.chunk_size());
            return Err(CloudError::malformed(&self.path, reason));
        }
        if self.points() == 0 {
            return Ok(());
        }
        let table = self.chunk_table(&vlr)?;
        let entries = table.as_ref();
        let held = entries.iter().fold(0u64, |n, e| n.saturating_add(e.point_count));
        let bytes = entries.iter().fold(0u64, |n, e| n.saturating_add(e.byte_count));
        if held < self.points() || (!fixed && held != self.points()) {
            let reason = format!("its chunks hold {held} of {} points", self.points());
            return Err(CloudError::truncated(&self.path, reason));
        }
        if bytes > self.length {
            let reason = "its chunks are larger than the file".to_owned();
            return Err(CloudError::truncated(&self.path, reason));
        }
        Ok(())
    }

    fn chunk_table(&self, vlr: &laz::LazVlr) -> Result<ChunkTable, CloudError> {
        let read = |e| CloudError::read(&self.path, e);
        let mut file = BufReader::new(File::open(&self.path).map_err(read)?);
        let start = u64::from(self.raw.offset_to_point_data);
        file.seek(SeekFrom::Start(start)).map_err(read)?;
        let mut place = [0; 8];
        file.read_exact(&mut place).map_err(read)?;
        let mut table = i64::from_le_bytes(place);
        if table <= start.cast_signed() {
            // A writer that could not go back has put the place at the very end.
            file.seek(SeekFrom::End(-8)).map_err(read)?;
            file.read_exact(&mut place).map_err(read)?;
            table = i64::from_le_bytes(place);
        }
        let table = u64::try_from(table).unwrap_or(0);
        if table <= start || table > self.length.saturating_sub(8) {
            let reason = "the table of its chunks, which comes last, is missing";
            return Err(CloudError::truncated(&self.path, reason));
        }
        file.seek(SeekFrom::Start(table + 4)).map_err(read)?;
        let mut count = [0; 4];
        file.read_exact(&mut count).map_err(read)?;
        if u64::from(u32::from_le_bytes(count)) > self.points() {
            return Err(CloudError::malformed(&self.path, "more chunks than points"));
        }
        file.seek(SeekFrom::Start(start)).map_err(read)?;
        ChunkTable::read_from(&mut file, vlr).map_err(|e| las_error(&self.path, las::Error::from(e)))
    }
}
