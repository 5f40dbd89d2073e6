//! Columns of numbers, packed for the page: quantised, compressed, as text.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::{Value, json};
use std::io::Write;

/// Named columns that travel together; the page unpacks a block when it needs it.
///
/// A column is little-endian integers times a unit. The least value of a signed type stands for "no value",
/// which the page reads as NaN; unsigned types hold whole numbers that always exist. Numbers beyond a type's
/// range are cut to it.
#[derive(Default)]
pub(super) struct Block {
    bytes: Vec<u8>,
    columns: Vec<Value>,
}

impl Block {
    /// Numbers to a step of `unit`, within 32,767 steps of zero.
    pub(super) fn i16(&mut self, name: &str, unit: f64, values: impl IntoIterator<Item = f64>) {
        let limit = f64::from(i16::MAX);
        self.push(name, "i16", unit, values, |v| {
            let whole = if v.is_finite() {
                v.clamp(-limit, limit) as i16
            } else {
                i16::MIN
            };
            whole.to_le_bytes()
        });
    }

    /// Numbers to a step of `unit`, within 2,147,483,647 steps of zero.
    pub(super) fn i32(&mut self, name: &str, unit: f64, values: impl IntoIterator<Item = f64>) {
        let limit = f64::from(i32::MAX);
        self.push(name, "i32", unit, values, |v| {
            let whole = if v.is_finite() {
                v.clamp(-limit, limit) as i32
            } else {
                i32::MIN
            };
            whole.to_le_bytes()
        });
    }

    /// Numbers to a step of `unit`, within 127 steps of zero.
    pub(super) fn i8(&mut self, name: &str, unit: f64, values: impl IntoIterator<Item = f64>) {
        self.push(name, "i8", unit, values, |v| {
            let whole = if v.is_finite() {
                v.clamp(-127.0, 127.0) as i8
            } else {
                i8::MIN
            };
            whole.to_le_bytes()
        });
    }

    /// Whole numbers up to 255.
    pub(super) fn u8(&mut self, name: &str, values: impl IntoIterator<Item = u8>) {
        self.push(name, "u8", 1.0, values, |v| [v as u8]);
    }

    /// Whole numbers up to 65,535.
    pub(super) fn u16(&mut self, name: &str, unit: f64, values: impl IntoIterator<Item = u16>) {
        self.push(name, "u16", 1.0, values, |v| (v as u16).to_le_bytes());
        if let Some(column) = self.columns.last_mut() {
            column["unit"] = json!(unit);
        }
    }

    /// Whole numbers up to 4,294,967,295.
    pub(super) fn u32(&mut self, name: &str, values: impl IntoIterator<Item = u32>) {
        self.push(name, "u32", 1.0, values, |v| (v as u32).to_le_bytes());
    }

    fn push<const N: usize, V: Into<f64>>(
        &mut self,
        name: &str,
        kind: &str,
        unit: f64,
        values: impl IntoIterator<Item = V>,
        encode: impl Fn(f64) -> [u8; N],
    ) {
        // Typed arrays of the page must start at a multiple of their size.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let start = self.bytes.len();
        for value in values {
            self.bytes.extend(encode((value.into() / unit).round()));
        }
        let length = (self.bytes.len() - start) / N;
        self.columns
            .push(json!({ "name": name, "type": kind, "unit": unit, "start": start, "length": length }));
    }

    /// The list of columns, and all bytes compressed by gzip (RFC 1952) as base64 (RFC 4648). The same
    /// columns give the same text.
    pub(super) fn finish(self) -> std::io::Result<(Value, String)> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::new(7));
        encoder.write_all(&self.bytes)?;
        Ok((Value::Array(self.columns), STANDARD.encode(encoder.finish()?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::GzDecoder;
    use std::io::Read;

    #[test]
    fn columns_come_back_from_the_text() {
        let mut block = Block::default();
        block.u8("flag", [7, 255, 0]);
        block.i32("move", 1e-6, [0.001_234_4, f64::NAN, -5.0]);
        block.i16("near", 1e-4, [0.5, -40.0]);
        let (columns, text) = block.finish().unwrap();
        let mut bytes = Vec::new();
        let packed = STANDARD.decode(text).unwrap();
        GzDecoder::new(packed.as_slice()).read_to_end(&mut bytes).unwrap();
        let start = |i: usize| columns[i]["start"].as_u64().unwrap() as usize;
        assert_eq!((start(0), start(1), start(2)), (0, 4, 16));
        assert_eq!(columns[1]["length"], 3);
        assert_eq!(bytes[..3], [7, 255, 0]);
        let word = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!([word(4), word(8), word(12)], [1234, i32::MIN, -5_000_000]);
        // 40 m is beyond 16 bits of tenths of a millimetre.
        assert_eq!(bytes[16..20], [0x88, 0x13, 0x01, 0x80]);
    }
}
