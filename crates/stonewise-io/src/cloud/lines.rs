//! Lines of text files, read with a limit on their length.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::{Path, PathBuf};

use super::CloudError;

/// A longer line is no line of a point cloud, but a file of another kind.
const MAX_LINE_BYTES: u64 = 1 << 16;

/// A file that is read line by line, and can be read as bytes from any line on.
pub(super) struct Lines {
    path: PathBuf,
    reader: BufReader<File>,
    line: Vec<u8>,
    /// The line as text, where it is not in UTF-8.
    decoded: String,
    number: u64,
}

impl Lines {
    pub fn open(path: &Path) -> Result<Self, CloudError> {
        let file = File::open(path).map_err(|e| CloudError::read(path, e))?;
        Ok(Self {
            path: path.to_owned(),
            reader: BufReader::with_capacity(1 << 20, file),
            line: Vec::new(),
            decoded: String::new(),
            number: 0,
        })
    }

    /// The next line without spaces at its ends; `None` at the end of the file.
    pub fn next(&mut self) -> Result<Option<&str>, CloudError> {
        if self.advance()? {
            self.text().map(Some)
        } else {
            Ok(None)
        }
    }

    /// The next line that is not empty, without spaces at its ends; `None` at the end of the file.
    pub fn next_filled(&mut self) -> Result<Option<&str>, CloudError> {
        while self.advance()? {
            if !self.line.trim_ascii().is_empty() {
                return self.text().map(Some);
            }
        }
        Ok(None)
    }

    fn advance(&mut self) -> Result<bool, CloudError> {
        self.line.clear();
        let mut limited = self.reader.by_ref().take(MAX_LINE_BYTES);
        let read = limited.read_until(b'\n', &mut self.line);
        if read.map_err(|e| CloudError::read(&self.path, e))? == 0 {
            return Ok(false);
        }
        self.number += 1;
        if self.line.len() as u64 == MAX_LINE_BYTES {
            return Err(self.error("the line is too long for text with one point per line"));
        }
        Ok(true)
    }

    /// In UTF-8, else in Latin-1, which programs on Windows write into comments.
    fn text(&mut self) -> Result<&str, CloudError> {
        if str::from_utf8(&self.line).is_err() {
            if self
                .line
                .iter()
                .any(|b| b.is_ascii_control() && !b.is_ascii_whitespace())
            {
                return Err(self.error("the line is no text: save the file as text in UTF-8"));
            }
            self.decoded = self.line.iter().map(|&b| char::from(b)).collect();
            return Ok(self.decoded.trim());
        }
        let line = str::from_utf8(&self.line).unwrap_or_default();
        Ok(line.trim_start_matches('\u{feff}').trim())
    }

    /// Bytes of the file after the line that was read last.
    pub fn bytes_left(&mut self) -> Result<u64, CloudError> {
        let length = self.reader.get_ref().metadata().map(|m| m.len());
        let place = length.and_then(|length| Ok((length, self.reader.stream_position()?)));
        let (length, position) = place.map_err(|e| CloudError::read(&self.path, e))?;
        Ok(length.saturating_sub(position))
    }

    /// Number of the line that was read last, from 1.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// An error in the line that was read last.
    pub fn error(&self, reason: impl Into<String>) -> CloudError {
        CloudError::Line {
            path: self.path.clone(),
            line: self.number,
            reason: reason.into(),
        }
    }

    /// The bytes after the line that was read last.
    pub fn into_bytes(self) -> BufReader<File> {
        self.reader
    }
}
