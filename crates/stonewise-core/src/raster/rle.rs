//! Run-length masks as COCO stores them.

use super::LabelImage;
use std::ops::Range;

/// A binary mask as alternating runs of outside and inside pixels, column by column, the first run outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Rle {
    width: u32,
    height: u32,
    counts: Vec<u32>,
}

/// Why runs are not a mask.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RleError {
    /// The runs do not cover the image exactly.
    #[error("runs cover {covered} pixels, the mask of {width}x{height} px has {}", u64::from(*width) * u64::from(*height))]
    WrongLength {
        /// Sum of the runs.
        covered: u64,
        /// Width of the mask.
        width: u32,
        /// Height of the mask.
        height: u32,
    },
    /// The compressed text is broken.
    #[error("broken compressed runs at character {at}")]
    BrokenText {
        /// Byte offset in the text.
        at: usize,
    },
}

impl Rle {
    /// A mask from its runs, which must cover the image exactly.
    ///
    /// # Errors
    /// The runs do not cover the image exactly.
    pub fn from_counts(width: u32, height: u32, counts: Vec<u32>) -> Result<Self, RleError> {
        let covered: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        if covered == u64::from(width) * u64::from(height) {
            Ok(Self {
                width,
                height,
                counts,
            })
        } else {
            Err(RleError::WrongLength {
                covered,
                width,
                height,
            })
        }
    }

    /// A mask from COCO's compressed text.
    ///
    /// Each run is a signed number in groups of five bits, least significant first, each group a character
    /// from '0' on with bit 5 set where another follows; from the fourth run on it is the difference to the
    /// run two before.
    ///
    /// # Errors
    /// The text is damaged, or the runs do not cover the image exactly.
    pub fn from_compressed(width: u32, height: u32, text: &str) -> Result<Self, RleError> {
        let bytes = text.as_bytes();
        let mut counts: Vec<u32> = Vec::new();
        let mut at = 0;

        while at < bytes.len() {
            let start = at;
            let broken = || RleError::BrokenText { at: start };
            let mut value = 0i64;
            let mut shift = 0;
            loop {
                let group = bytes.get(at).and_then(|b| b.checked_sub(48)).filter(|&g| g < 64);
                let group = i64::from(group.ok_or_else(broken)?);
                at += 1;
                if shift > 40 {
                    return Err(broken());
                }
                value |= (group & 31) << shift;
                shift += 5;
                if group & 32 == 0 {
                    if group & 16 != 0 {
                        value |= -1 << shift;
                    }
                    break;
                }
            }
            if counts.len() > 2 {
                value += i64::from(counts[counts.len() - 2]);
            }
            counts.push(u32::try_from(value).map_err(|_| broken())?);
        }

        Self::from_counts(width, height, counts)
    }

    /// The pixels of one label within these columns and rows, which must hold all of them. Cost: one look-up a
    /// pixel there.
    pub fn of_label(labels: &LabelImage, label: u32, columns: Range<u32>, rows: Range<u32>) -> Self {
        let (width, height) = (labels.width(), labels.height());
        let columns = columns.start.min(width)..columns.end.min(width);
        let rows = rows.start.min(height)..rows.end.min(height);
        let mut counts = vec![0u32];
        let mut add = |is_inside: bool, pixels: u32| {
            let was_inside = counts.len().is_multiple_of(2);
            match counts.last_mut() {
                Some(last) if was_inside == is_inside || pixels == 0 => *last += pixels,
                _ => counts.push(pixels),
            }
        };
        add(false, columns.start * height);
        for x in columns.clone() {
            add(false, rows.start);
            rows.clone()
                .for_each(|y| add(labels.get(x, y) == Some(&label), 1));
            add(false, height - rows.end);
        }
        add(false, (width - columns.end) * height);
        Self {
            width,
            height,
            counts,
        }
    }

    /// COCO's compressed text.
    pub fn to_compressed(&self) -> String {
        let mut text = String::new();
        for (i, &count) in self.counts.iter().enumerate() {
            let before = if i > 2 { self.counts[i - 2] } else { 0 };
            let mut value = i64::from(count) - i64::from(before);
            loop {
                let group = (value & 31) as u8;
                value >>= 5;
                let is_last = if group & 16 == 0 { value == 0 } else { value == -1 };
                let more = if is_last { 0 } else { 32 };
                text.push(char::from(48 + (group | more)));
                if is_last {
                    break;
                }
            }
        }
        text
    }

    /// Width of the mask, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the mask, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Number of pixels inside.
    pub fn area(&self) -> u64 {
        self.counts.iter().skip(1).step_by(2).map(|&c| u64::from(c)).sum()
    }

    /// Calls `run(x, y, length)` for every vertical run of inside pixels, column by column.
    pub fn for_each_run(&self, mut run: impl FnMut(u32, u32, u32)) {
        let height = u64::from(self.height);
        let mut start = 0u64;
        for (i, &count) in self.counts.iter().enumerate() {
            let end = start + u64::from(count);
            if i % 2 == 1 {
                let mut at = start;
                while at < end {
                    let (x, y) = (at / height, at % height);
                    let length = (height - y).min(end - at);
                    run(x as u32, y as u32, length as u32);
                    at += length;
                }
            }
            start = end;
        }
    }
}
