//! What a camera writes beside the pixels of a photo: Exif 2.32 in JPEG and TIFF files.

use serde::Serialize;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// What the camera says of a photo; every part is `None` where it says nothing, or nothing sound.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Exif {
    /// Maker and model of the camera.
    pub camera: Option<String>,
    /// When the photo was taken, by the camera's clock: `2025-04-12 09:31:02`.
    pub taken: Option<String>,
    /// Focal length, millimetres.
    pub focal_mm: Option<f64>,
    /// Focal length of a lens with the same view on film of 36 mm, millimetres.
    pub focal_35_mm: Option<f64>,
    /// Latitude and longitude, degrees.
    pub position: Option<[f64; 2]>,
    /// Altitude, metres, in the system of the camera's receiver.
    pub altitude_m: Option<f64>,
}

/// Longest text and most entries that are read.
const MOST_BYTES: u64 = 1024;
const MOST_ENTRIES: u16 = 512;

/// Reads the Exif data of a JPEG or TIFF; `None` where there are none, or the file cannot be read.
pub fn read_exif(path: &Path) -> Option<Exif> {
    let mut file = BufReader::new(File::open(path).ok()?);
    let mut start = [0; 2];
    file.read_exact(&mut start).ok()?;
    let base = if start == [0xff, 0xd8] {
        exif_segment(&mut file)?
    } else {
        0
    };
    let mut tiff = Tiff::open(file, base)?;
    let first = tiff.number(4, 4)?;
    let main = tiff.entries(first);
    let below = |tag: u16| main.iter().find(|e| e.tag == tag);
    let own = below(0x8769).map(|e| e.place).and_then(|p| tiff.number(p, 4));
    let own = own.map_or(Vec::new(), |place| tiff.entries(place));

    let gps = below(0x8825).map(|e| e.place).and_then(|p| tiff.number(p, 4));
    let gps = gps.map_or(Vec::new(), |place| tiff.entries(place));
    let (make, model) = (tiff.text(&main, 0x010f), tiff.text(&main, 0x0110));
    let camera = match (make, model) {
        // Many models begin with their maker.
        (Some(make), Some(model)) if model.starts_with(&make) => Some(model),
        (Some(make), Some(model)) => Some(format!("{make} {model}")),
        (make, model) => make.or(model),
    };
    let taken = tiff.text(&own, 0x9003).or_else(|| tiff.text(&main, 0x0132));

    let place = |tiff: &mut Tiff, tag: u16, negative: &str, most: f64| {
        let [degrees, minutes, seconds] = tiff.ratios(&gps, tag)?;
        let size = degrees + minutes / 60.0 + seconds / 3600.0;
        let sign = tiff.text(&gps, tag - 1)?;
        (size <= most).then_some(if sign == negative { -size } else { size })
    };

    let latitude = place(&mut tiff, 2, "S", 90.0);
    let longitude = place(&mut tiff, 4, "W", 180.0);
    let is_below = tiff.byte(&gps, 5) == Some(1);
    let altitude = tiff.ratios::<1>(&gps, 6).map(|[a]| if is_below { -a } else { a });
    Some(Exif {
        camera,
        taken: taken.and_then(|text| date(&text)),
        focal_mm: tiff.ratios::<1>(&own, 0x920a).map(|[f]| f).filter(|f| *f > 0.0),
        focal_35_mm: tiff.short(&own, 0xa405).filter(|f| *f > 0).map(f64::from),
        position: latitude.zip(longitude).map(|(a, b)| [a, b]),
        altitude_m: altitude,
    })
}

/// Where the TIFF data of a JPEG begin.
fn exif_segment(file: &mut BufReader<File>) -> Option<u64> {
    loop {
        let mut head = [0; 4];
        file.read_exact(&mut head).ok()?;
        let [0xff, marker, high, low] = head else {
            return None;
        };
        let length = u16::from_be_bytes([high, low]).checked_sub(2)?;
        // The image itself follows: no more segments.
        if marker == 0xda {
            return None;
        }
        let start = file.stream_position().ok()?;
        let mut name = [0; 6];
        if marker == 0xe1 && length > 6 && file.read_exact(&mut name).is_ok() && &name == b"Exif\0\0" {
            return Some(start + 6);
        }
        file.seek(SeekFrom::Start(start + u64::from(length))).ok()?;
    }
}

/// Data in the form of a TIFF file, which begin somewhere in another.
struct Tiff {
    file: BufReader<File>,
    base: u64,
    is_little: bool,
}

struct Entry {
    tag: u16,
    kind: u16,
    count: u32,
    /// Where its value, or the place of its value, stands.
    place: u64,
}

impl Tiff {
    fn open(file: BufReader<File>, base: u64) -> Option<Self> {
        let mut tiff = Self {
            file,
            base,
            is_little: true,
        };
        match tiff.bytes::<4>(0)? {
            [b'I', b'I', 42, 0] => Some(tiff),
            [b'M', b'M', 0, 42] => {
                tiff.is_little = false;
                Some(tiff)
            }
            _ => None,
        }
    }

    fn bytes<const N: usize>(&mut self, place: u64) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        self.file
            .seek(SeekFrom::Start(self.base.checked_add(place)?))
            .ok()?;
        self.file.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }

    /// A whole number of 2 or 4 bytes.
    fn number(&mut self, place: u64, size: usize) -> Option<u64> {
        let [a, b, c, d] = match size {
            2 => self.bytes::<2>(place).map(|[a, b]| [a, b, 0, 0])?,
            _ => self.bytes::<4>(place)?,
        };
        Some(match (self.is_little, size) {
            (true, _) => u64::from(u32::from_le_bytes([a, b, c, d])),
            (false, 2) => u64::from(u16::from_be_bytes([a, b])),
            (false, _) => u64::from(u32::from_be_bytes([a, b, c, d])),
        })
    }

    fn entries(&mut self, place: u64) -> Vec<Entry> {
        let count = self.number(place, 2).unwrap_or(0).min(u64::from(MOST_ENTRIES));
        let starts = (0..count).map(|k| place + 2 + 12 * k);
        let read = |start| {
            Some(Entry {
                tag: self.number(start, 2)? as u16,
                kind: self.number(start + 2, 2)? as u16,
                count: self.number(start + 4, 4)? as u32,
                place: start + 8,
            })
        };
        starts.map_while(read).collect()
    }

    /// Where the values of an entry begin: more than four bytes stand elsewhere.
    fn values(&mut self, entries: &[Entry], tag: u16, kind: u16, bytes: u64) -> Option<(u64, u64)> {
        let entry = entries.iter().find(|e| e.tag == tag && e.kind == kind)?;
        let count = u64::from(entry.count);
        let place = match count * bytes {
            0..=4 => entry.place,
            _ => self.number(entry.place, 4)?,
        };
        Some((place, count))
    }

    fn text(&mut self, entries: &[Entry], tag: u16) -> Option<String> {
        let (place, count) = self.values(entries, tag, 2, 1)?;
        let mut bytes = vec![0; count.min(MOST_BYTES) as usize];
        self.file
            .seek(SeekFrom::Start(self.base.checked_add(place)?))
            .ok()?;
        self.file.read_exact(&mut bytes).ok()?;
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
        let text = String::from_utf8_lossy(&bytes[..end]);
        let text: String = text.chars().filter(|c| !c.is_control()).collect();
        Some(text.trim().to_owned()).filter(|t| !t.is_empty())
    }

    fn byte(&mut self, entries: &[Entry], tag: u16) -> Option<u8> {
        let (place, _) = self.values(entries, tag, 1, 1)?;
        self.bytes::<1>(place).map(|[byte]| byte)
    }

    fn short(&mut self, entries: &[Entry], tag: u16) -> Option<u16> {
        let (place, _) = self.values(entries, tag, 3, 2)?;
        self.number(place, 2).map(|n| n as u16)
    }

    fn ratios<const N: usize>(&mut self, entries: &[Entry], tag: u16) -> Option<[f64; N]> {
        let (place, count) = self.values(entries, tag, 5, 8)?;
        if count < N as u64 {
            return None;
        }
        let mut values = [0.0; N];
        for (k, value) in (0..).zip(&mut values) {
            let at = place + 8 * k;
            *value = self.number(at, 4)? as f64 / self.number(at + 4, 4)? as f64;
        }
        values.iter().all(|v| v.is_finite()).then_some(values)
    }
}

/// `2025:04:12 09:31:02` as a date is written elsewhere; `None` for a clock that was never set.
fn date(text: &str) -> Option<String> {
    let (day, time) = text.split_once(' ')?;
    let is_sound = day.len() == 10 && day.bytes().any(|b| matches!(b, b'1'..=b'9'));
    is_sound.then(|| format!("{} {time}", day.replace(':', "-")))
}
