//! Changes to files: of bytes, of the sizes in heads, and of the words of texts.

use super::random::Random;

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

/// Longest input, bytes.
const LONGEST: usize = 1 << 20;

/// Changes an input a few times; `other` is one to take pieces from.
pub fn mutate(bytes: &mut Vec<u8>, other: &[u8], is_text: bool, random: &mut Random) {
    for _ in 0..1 + random.below(4) {
        if is_text && !random.one_in(4) {
            change_text(bytes, random);
        } else {
            change_bytes(bytes, other, random);
        }
        // After every change: lines that are repeated twice would take gigabytes.
        bytes.truncate(LONGEST);
    }
}

/// A place: often in the head, where the sizes are.
fn place(bytes: &[u8], random: &mut Random) -> usize {
    let end = if random.one_in(2) {
        bytes.len().min(600)
    } else {
        bytes.len()
    };
    random.below(end)
}

fn block(bytes: &[u8], random: &mut Random) -> std::ops::Range<usize> {
    let start = place(bytes, random);
    let longest = *random.of(&[4, 30, 200, 5000]);
    start..(start + random.below(longest)).min(bytes.len())
}

fn change_bytes(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if bytes.is_empty() {
        bytes.extend_from_slice(other);
        return;
    }
    match random.below(10) {
        0 => bytes.truncate(random.below(bytes.len())),
        1 => drop(bytes.drain(block(bytes, random))),
        2 => {
            let copy = bytes[block(bytes, random)].to_vec();
            let at = place(bytes, random);
            bytes.splice(at..at, copy);
        }
        3 if !other.is_empty() => {
            let piece = other[block(other, random)].to_vec();
            let at = place(bytes, random);
            let end = (at + piece.len()).min(bytes.len());
            bytes.splice(at..end, piece);
        }
        4..=6 => {
            let at = place(bytes, random);
            let number = *random.of(&SIZES);
            let number = if random.one_in(3) {
                bytes.len() as u64 + number % 3
            } else {
                number
            };
            let width = *random.of(&[1, 2, 4, 8]);
            for (byte, new) in bytes[at..].iter_mut().zip(&number.to_le_bytes()[..width]) {
                *byte = *new;
            }
        }
        7 => {
            // A digit of a number in a text inside, such as the XML of E57.
            let at = place(bytes, random);
            if let Some(digit) = bytes[at..].iter_mut().find(|b| b.is_ascii_digit()) {
                *digit = *random.of(b"0123456789-.e");
            }
        }
        _ => {
            let at = place(bytes, random);
            bytes[at] ^= 1 << random.below(8);
        }
    }
}

fn change_text(bytes: &mut Vec<u8>, random: &mut Random) {
    let is_word = |b: u8| b.is_ascii_alphanumeric() || b"+-._".contains(&b);
    let at = random.below(bytes.len());
    let start = bytes[..at]
        .iter()
        .rposition(|&b| !is_word(b))
        .map_or(0, |i| i + 1);
    let length = bytes[start..].iter().position(|&b| !is_word(b));
    let word = start..length.map_or(bytes.len(), |length| start + length);
    let line_start = bytes[..at].iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
    let line_length = bytes[line_start..].iter().position(|&b| b == b'\n');
    let line = line_start..line_length.map_or(bytes.len(), |length| line_start + length + 1);
    match random.below(8) {
        0 => drop(bytes.drain(line)),
        1 => {
            // More would be cut off.
            let most = LONGEST / line.len().max(1) + 1;
            let copy = bytes[line].repeat((*random.of(&[1, 3, 200])).min(most));
            bytes.splice(line_start..line_start, copy);
        }
        2 => {
            let opening = *random.of(&["[", "{\"a\":", "<a>", "(", "A["]);
            let nested = opening.repeat(*random.of(&[1, 40, 10_000]));
            bytes.splice(start..start, nested.into_bytes());
        }
        _ => {
            let new = random.of(&WORDS).as_bytes().to_vec();
            bytes.splice(word, new);
        }
    }
}
