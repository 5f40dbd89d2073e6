//! Changes to files: of bytes, of the sizes in heads, and of the words of texts.

use bolero::{TypeGenerator, generator::*};
use std::ops::Range;

/// Numbers that sizes and counts go wrong at.
const SIZES: [u64; 12] = [
    0,
    1,
    0x7f,
    0xff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    1 << 40,
    1 << 60,
    u64::MAX >> 1,
    u64::MAX,
];
/// Words that numbers and names go wrong at.
const WORDS: [&str; 24] = [
    "0",
    "-1",
    "1",
    "255",
    "65536",
    "4294967296",
    "18446744073709551615",
    "1e308",
    "-1e308",
    "1e999",
    "1e-320",
    "nan",
    "inf",
    "",
    "\"",
    "[",
    "]",
    "<a>",
    "&#0;",
    "null",
    "true",
    "\\u0000",
    "../../..",
    "\u{feff}",
];
/// What opens a level of JSON, XML or WKT.
const OPENINGS: [&str; 5] = ["[", "{\"a\":", "<a>", "(", "A["];

/// Longest input, bytes.
const LONGEST: usize = 1 << 20;
/// Bytes of a file that often hold its sizes.
const HEAD: usize = 600;

/// A place in a file of any length.
#[derive(Clone, Copy, Debug, TypeGenerator)]
pub struct Place {
    at: u32,
    in_head: bool,
}

impl Place {
    fn of(self, bytes: &[u8]) -> usize {
        let end = if self.in_head {
            bytes.len().min(HEAD)
        } else {
            bytes.len()
        };
        self.at as usize % end.max(1)
    }
}

/// Bytes that follow each other.
#[derive(Clone, Copy, Debug, TypeGenerator)]
pub struct Block {
    start: Place,
    #[generator([4_usize, 30, 200, 5000].one_value_of())]
    most: usize,
    length: u16,
}

impl Block {
    fn of(self, bytes: &[u8]) -> Range<usize> {
        let start = self.start.of(bytes);
        start..(start + usize::from(self.length) % self.most).min(bytes.len())
    }
}

/// A change.
#[derive(Clone, Debug, TypeGenerator)]
pub enum Edit {
    /// Ends the file here.
    Cut(Place),
    Remove(Block),
    /// Puts a copy of a block in.
    Insert(Block, Place),
    /// Writes a copy of a block of another seed over what is there.
    Overwrite(Block, Place),
    /// A number where a size may stand.
    Size {
        at: Place,
        #[generator(SIZES.one_value_of())]
        size: u64,
        #[generator([1_usize, 2, 4, 8].one_value_of())]
        width: usize,
    },
    /// The length of the file, or a little more, where a size may stand.
    Length {
        at: Place,
        #[generator(0_u64..3)]
        more: u64,
    },
    Flip {
        at: Place,
        #[generator(0_u8..8)]
        bit: u8,
    },
    /// Another word in place of the one here.
    Word {
        at: Place,
        #[generator(WORDS.one_value_of())]
        word: &'static str,
    },
    /// The line here so many times again; 0: never.
    Line {
        at: Place,
        #[generator([0_usize, 1, 3, 200].one_value_of())]
        times: usize,
    },
    /// Levels that nobody closes.
    Nest {
        at: Place,
        #[generator(OPENINGS.one_value_of())]
        opening: &'static str,
        #[generator([1_usize, 40, 10_000].one_value_of())]
        levels: usize,
    },
}

/// A changed file.
#[derive(Clone, Debug, TypeGenerator)]
pub struct Input {
    /// Which seed; of any number of them.
    pub seed: u8,
    /// Which other seed pieces are taken from.
    pub other: u8,
    #[generator(produce::<Vec<Edit>>().with().len(0_usize..6))]
    pub edits: Vec<Edit>,
    /// Whether checksums are left as they were.
    pub is_damage: bool,
}

impl Edit {
    /// Changes a file; `other` is one to take pieces from.
    pub fn apply(&self, bytes: &mut Vec<u8>, other: &[u8]) {
        match *self {
            Self::Cut(place) => bytes.truncate(place.of(bytes)),
            Self::Remove(block) => drop(bytes.drain(block.of(bytes))),
            Self::Insert(block, place) => {
                let copy = bytes[block.of(bytes)].to_vec();
                let at = place.of(bytes);
                bytes.splice(at..at, copy);
            }
            Self::Overwrite(block, place) => write(bytes, place, &other[block.of(other)]),
            Self::Size { at, size, width } => write(bytes, at, &size.to_le_bytes()[..width]),
            Self::Length { at, more } => {
                let length = bytes.len() as u64 + more;
                write(bytes, at, &length.to_le_bytes());
            }
            Self::Flip { at, bit } => {
                let at = at.of(bytes);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << bit;
                }
            }
            Self::Word { at, word } => {
                let is_word = |b: u8| b.is_ascii_alphanumeric() || b"+-._".contains(&b);
                let old = around(bytes, at.of(bytes), |b| !is_word(b));
                bytes.splice(old, word.bytes());
            }
            Self::Line { at, times } => {
                let mut line = around(bytes, at.of(bytes), |b| b == b'\n');
                line.end = (line.end + 1).min(bytes.len());
                // More would be cut off.
                let most = LONGEST / line.len().max(1) + 1;
                let copy = bytes[line.clone()].repeat(if times == 0 { 0 } else { times.min(most) + 1 });
                bytes.splice(line, copy);
            }
            Self::Nest { at, opening, levels } => {
                let at = at.of(bytes);
                bytes.splice(at..at, opening.repeat(levels).into_bytes());
            }
        }
        // After every change: lines that are repeated twice would take gigabytes.
        bytes.truncate(LONGEST);
    }
}

/// Writes over what is there, up to the end.
fn write(bytes: &mut [u8], at: Place, new: &[u8]) {
    let at = at.of(bytes);
    for (byte, &new) in bytes[at..].iter_mut().zip(new) {
        *byte = new;
    }
}

/// The bytes around a place, up to where something ends.
fn around(bytes: &[u8], at: usize, is_end: impl Fn(u8) -> bool) -> Range<usize> {
    let (before, behind) = bytes.split_at(at);
    let start = before.iter().rposition(|&b| is_end(b)).map_or(0, |i| i + 1);
    let length = behind.iter().position(|&b| is_end(b));
    start..length.map_or(bytes.len(), |length| at + length)
}
