//! LZF, the compression of PCD files (liblzf, Lehmann 2000): literal runs and copies of what came before.

use std::io::{self, ErrorKind, Read};

/// Farthest byte that a copy can begin at.
const WINDOW: usize = 1 << 13;
/// Bytes that a byte of compressed data unpacks to at most: a copy of 264 bytes takes three.
pub(super) const MOST_GROWTH: u64 = 88;

/// Unpacks a stream in memory of constant size.
pub(super) struct Lzf<R> {
    packed: R,
    /// The last bytes, as a ring.
    window: Vec<u8>,
    unpacked: usize,
    next: Run,
}

enum Run {
    /// Bytes that follow as they are.
    Literal(usize),
    /// Bytes to copy, and how far back from the end.
    Copy(usize, usize),
}

impl<R: Read> Lzf<R> {
    pub fn new(packed: R) -> Self {
        Self {
            packed,
            window: vec![0; WINDOW],
            unpacked: 0,
            next: Run::Literal(0),
        }
    }

    fn byte(&mut self) -> io::Result<u8> {
        let mut byte = [0];
        self.packed.read_exact(&mut byte)?;
        Ok(byte[0])
    }

    /// The next byte; an error of the kind `UnexpectedEof` at the end of the packed data, `InvalidData` where
    /// it points before its beginning.
    fn unpack(&mut self) -> io::Result<u8> {
        if let Run::Literal(0) | Run::Copy(0, _) = self.next {
            let control = usize::from(self.byte()?);
            self.next = if control < 32 {
                Run::Literal(control + 1)
            } else {
                let mut length = control >> 5;
                if length == 7 {
                    length += usize::from(self.byte()?);
                }
                let back = ((control & 31) << 8) + usize::from(self.byte()?) + 1;
                if back > self.unpacked {
                    return Err(ErrorKind::InvalidData.into());
                }
                Run::Copy(length + 2, back)
            };
        }

        let byte = match &mut self.next {
            Run::Copy(left, back) => {
                *left -= 1;
                self.window[(self.unpacked - *back) % WINDOW]
            }
            Run::Literal(left) => {
                *left -= 1;
                self.byte()?
            }
        };
        self.window[self.unpacked % WINDOW] = byte;
        self.unpacked += 1;
        Ok(byte)
    }

    /// Unpacks this number of bytes and drops them.
    pub fn skip(&mut self, bytes: u64) -> io::Result<()> {
        (0..bytes).try_for_each(|_| self.unpack().map(drop))
    }

    pub fn fill(&mut self, out: &mut [u8]) -> io::Result<()> {
        out.iter_mut()
            .try_for_each(|byte| self.unpack().map(|unpacked| *byte = unpacked))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_overlapping_copies_are_unpacked() {
        // "abc", then six bytes from three back; then one literal, then 9 + 2 bytes from one back.
        let packed = [2, b'a', b'b', b'c', 4 << 5, 2, 0, b'x', 7 << 5, 2, 0];
        let mut out = [0; 21];
        Lzf::new(&packed[..]).fill(&mut out).unwrap();
        assert_eq!(&out, b"abcabcabcxxxxxxxxxxxx");
        let mut rest = Lzf::new(&packed[..]);
        rest.skip(8).unwrap();
        rest.fill(&mut out[..3]).unwrap();
        assert_eq!(&out[..3], b"cxx");
    }

    #[test]
    fn references_before_the_beginning_and_missing_bytes_are_errors() {
        let kind = |packed: &[u8]| Lzf::new(packed).fill(&mut [0; 8]).map_err(|e| e.kind());
        assert_eq!(kind(&[0, 1, 1 << 5, 1]), Err(ErrorKind::InvalidData));
        assert_eq!(kind(&[5, 1, 2]), Err(ErrorKind::UnexpectedEof));
        assert_eq!(kind(&[0, 1, 7 << 5, 255, 0]), Ok(()));
    }
}
