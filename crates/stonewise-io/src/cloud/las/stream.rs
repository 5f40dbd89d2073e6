//! The bytes of a LAS file, as the decoder should see them.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Where the header holds the number of its variable length records (LAS 1.4 R15, table 3).
const RECORD_COUNT: std::ops::Range<u64> = 100..104;

/// What the decoder must be told otherwise than the file says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Corrections {
    /// Number of variable length records between the header and the points.
    pub record_count: u32,
}

/// A file with corrections.
pub struct LasStream {
    file: BufReader<File>,
    position: u64,
    corrections: Corrections,
}

impl LasStream {
    pub fn open(path: &Path, corrections: Corrections) -> io::Result<Self> {
        Ok(Self {
            file: BufReader::with_capacity(1 << 20, File::open(path)?),
            position: 0,
            corrections,
        })
    }
}

impl Read for LasStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        if self.position < RECORD_COUNT.end {
            let count = self.corrections.record_count.to_le_bytes();
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
