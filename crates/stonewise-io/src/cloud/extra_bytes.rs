//! Extra dimensions of LAS points: the "Extra Bytes" record of LAS 1.4 R15, section 2.8.

use std::ops::Range;
use std::path::Path;

use super::CloudError;
use super::scalar::Scalar;

/// Size of the description of one dimension.
pub const DESCRIPTOR_BYTES: usize = 192;
const USER_ID: &str = "LASF_Spec";
const RECORD_ID: u16 = 4;
const NAME: Range<usize> = 4..36;
const DESCRIPTION: Range<usize> = 160..192;

/// A type of extra dimension that is written here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExtraType {
    /// Integers from 0 to 65535.
    U16,
    /// Integers.
    U32,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl ExtraType {
    fn code(self) -> u8 {
        match self {
            Self::U16 => 3,
            Self::U32 => 5,
            Self::F32 => 9,
            Self::F64 => 10,
        }
    }

    /// Bytes per point.
    pub fn size(self) -> u16 {
        match self {
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// Name, unit and meaning of an extra dimension.
///
/// The file holds the name, and `MEANING, UNIT` as the description. Each of the two is plain ASCII of 1 to 32
/// bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension<'a> {
    /// Name.
    pub name: &'a str,
    /// Unit; empty for counts, identifiers, ratios and flags.
    pub unit: &'a str,
    /// What it holds.
    pub meaning: &'a str,
}

impl<'a> Dimension<'a> {
    /// A dimension with this name, unit and meaning.
    pub const fn new(name: &'a str, unit: &'a str, meaning: &'a str) -> Self {
        Self { name, unit, meaning }
    }

    fn description(&self) -> String {
        let separator = if self.unit.is_empty() { "" } else { ", " };
        format!("{}{separator}{}", self.meaning, self.unit)
    }
}

/// The descriptor of a dimension; `None` where its name or its description does not fit.
pub fn describe(dimension: Dimension<'_>, kind: ExtraType) -> Option<[u8; DESCRIPTOR_BYTES]> {
    let mut bytes = [0; DESCRIPTOR_BYTES];
    bytes[2] = kind.code();
    for (place, text) in [(NAME, dimension.name), (DESCRIPTION, &dimension.description())] {
        if text.is_empty() || text.len() > place.len() || !text.is_ascii() {
            return None;
        }
        bytes[place][..text.len()].copy_from_slice(text.as_bytes());
    }
    Some(bytes)
}

/// The descriptors of all extra dimensions of a file to be written.
///
/// # Errors
/// A name or a description does not fit; the error names `file`.
pub fn describe_all<'a>(
    file: &Path,
    dimensions: impl IntoIterator<Item = (Dimension<'a>, ExtraType)>,
) -> Result<Vec<u8>, CloudError> {
    let mut all = Vec::new();
    for (dimension, kind) in dimensions {
        let reason = || {
            CloudError::unwritable(
                file,
                format!("not a name or a description of a dimension: {dimension:?}"),
            )
        };
        all.extend(describe(dimension, kind).ok_or_else(reason)?);
    }
    Ok(all)
}

/// A dimension that a file already has.
pub struct ExistingDimension {
    pub descriptor: [u8; DESCRIPTOR_BYTES],
    /// Place among the extra bytes of a record.
    pub bytes: Range<usize>,
}

impl ExistingDimension {
    pub fn name(&self) -> &[u8] {
        let name = &self.descriptor[NAME];
        let end = name.iter().position(|&b| b == 0).unwrap_or(name.len());
        &name[..end]
    }

    /// How its number is stored; `None` for undocumented bytes, pairs and triples.
    pub fn number(&self) -> Option<ExtraNumber> {
        const KINDS: [Scalar; 10] = [
            Scalar::U8,
            Scalar::I8,
            Scalar::U16,
            Scalar::I16,
            Scalar::U32,
            Scalar::I32,
            Scalar::U64,
            Scalar::I64,
            Scalar::F32,
            Scalar::F64,
        ];
        let kind = usize::from(self.descriptor[2]).checked_sub(1)?;
        let option = |bit: u8, start: usize, otherwise: f64| {
            let bytes = self.descriptor[start..].first_chunk();
            let value = bytes.map_or(otherwise, |bytes| f64::from_le_bytes(*bytes));
            if self.descriptor[3] & bit == 0 {
                otherwise
            } else {
                value
            }
        };
        Some(ExtraNumber {
            scalar: *KINDS.get(kind)?,
            scale: option(8, 112, 1.0),
            offset: option(16, 136, 0.0),
        })
    }
}

/// A number among the extra bytes.
#[derive(Clone, Copy, Debug)]
pub struct ExtraNumber {
    scalar: Scalar,
    scale: f64,
    offset: f64,
}

impl ExtraNumber {
    /// Its value.
    pub fn of(self, bytes: &[u8]) -> f64 {
        let mut raw = [0; 8];
        let size = self.scalar.size().min(bytes.len());
        raw[..size].copy_from_slice(&bytes[..size]);
        self.scalar.decode(raw) * self.scale + self.offset
    }
}

/// Whether a record describes extra dimensions.
pub fn is_description(record: &las::Vlr) -> bool {
    record.user_id == USER_ID && record.record_id == RECORD_ID
}

/// The record that describes dimensions.
pub fn description_record(descriptors: Vec<u8>) -> las::Vlr {
    las::Vlr {
        user_id: USER_ID.to_owned(),
        record_id: RECORD_ID,
        description: "Extra Bytes Record".to_owned(),
        data: descriptors,
    }
}

/// The dimensions of a file with `extra_bytes` per point.
///
/// Bytes that no description covers become dimensions of undocumented bytes, so that what follows them is found in its
/// place. Descriptions that do not fit the record are ignored.
pub fn existing<'a>(records: impl Iterator<Item = &'a las::Vlr>, extra_bytes: u16) -> Vec<ExistingDimension> {
    let total = usize::from(extra_bytes);
    let mut found = Vec::new();
    let mut start = 0;
    for record in records.filter(|r| is_description(r)) {
        for descriptor in record.data.as_chunks::<DESCRIPTOR_BYTES>().0 {
            let end = start + size_of(descriptor);
            found.push(ExistingDimension {
                descriptor: *descriptor,
                bytes: start..end,
            });
            start = end;
        }
    }
    if start > total {
        found.clear();
        start = 0;
    }
    while start < total {
        let end = total.min(start + usize::from(u8::MAX));
        let mut descriptor = [0; DESCRIPTOR_BYTES];
        descriptor[3] = (end - start) as u8;
        found.push(ExistingDimension {
            descriptor,
            bytes: start..end,
        });
        start = end;
    }
    found
}

/// Bytes per point of a described dimension; types 11 to 30 are pairs and triples of types 1 to 10.
fn size_of(descriptor: &[u8; DESCRIPTOR_BYTES]) -> usize {
    const SIZES: [usize; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];
    match usize::from(descriptor[2]) {
        0 => usize::from(descriptor[3]),
        kind @ 1..=30 => SIZES[(kind - 1) % 10] * ((kind - 1) / 10 + 1),
        _ => 0,
    }
}
