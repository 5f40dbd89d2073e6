//! The bytes of a LAS file, as the decoder should see them.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// A file, read with other bytes in its header where the file has wrong ones.
pub struct LasStream {
    file: BufReader<File>,
    position: u64,
    header: Vec<(u64, u8)>,
}

impl LasStream {
    /// `header`: bytes of the header by their places.
    pub fn open(path: &Path, header: Vec<(u64, u8)>) -> io::Result<Self> {
        Ok(Self {
            file: BufReader::with_capacity(1 << 20, File::open(path)?),
            position: 0,
            header,
        })
    }
}

impl Read for LasStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        for (place, byte) in &self.header {
            let inside = place.checked_sub(self.position).filter(|&i| i < read as u64);
            if let Some(inside) = inside {
                buffer[inside as usize] = *byte;
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
