//! The bytes of a LAS file, as the decoder should see them.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Where the header holds the number of its variable length records (LAS 1.4 R15, table 3).
const RECORD_COUNT: std::ops::Range<u64> = 100..104;

/// A file, read with the right number of variable length records in its header even where the file has a
/// wrong one.
pub struct LasStream {
    file: BufReader<File>,
    position: u64,
    record_count: u32,
}

impl LasStream {
    /// `record_count`: number of variable length records between the header and the points.
    pub fn open(path: &Path, record_count: u32) -> io::Result<Self> {
        Ok(Self {
            file: BufReader::with_capacity(1 << 20, File::open(path)?),
            position: 0,
            record_count,
        })
    }
}

impl Read for LasStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        if self.position < RECORD_COUNT.end {
            let count = self.record_count.to_le_bytes();
            for (place, byte) in RECORD_COUNT.zip(count) {
                let inside = place.checked_sub(self.position).filter(|&i| i < read as u64);
                if let Some(inside) = inside {
                    buffer[inside as usize] = byte;
                }
            }
        }
        self.position += read as u64;
        Ok(read)
    }
}

impl Seek for LasStream {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = self.file.seek(to)?;
        Ok(self.position)
    }
}
