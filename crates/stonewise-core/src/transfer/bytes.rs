//! Numbers as bytes, little-endian, to the last bit: text would round them.

use super::TransferError;

/// Appends numbers.
#[derive(Default)]
pub(super) struct Writer(pub Vec<u8>);

impl Writer {
    pub(super) fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn i64(&mut self, value: i64) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn f32(&mut self, value: f32) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.0.extend(value.to_le_bytes());
    }

    /// The length of a list, then its entries.
    pub(super) fn list<T>(
        &mut self,
        values: impl ExactSizeIterator<Item = T>,
        mut each: impl FnMut(&mut Self, T),
    ) {
        self.u32(values.len() as u32);
        values.for_each(|value| each(self, value));
    }
}

/// Reads them back in the same order.
pub(super) struct Reader<'a>(pub &'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], TransferError> {
        let (head, rest) = self.0.split_first_chunk::<N>().ok_or(TransferError::Damaged)?;
        self.0 = rest;
        Ok(*head)
    }

    pub(super) fn u32(&mut self) -> Result<u32, TransferError> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Result<i32, TransferError> {
        self.take().map(i32::from_le_bytes)
    }

    pub(super) fn i64(&mut self) -> Result<i64, TransferError> {
        self.take().map(i64::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Result<f32, TransferError> {
        self.take().map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, TransferError> {
        self.take().map(f64::from_le_bytes)
    }

    pub(super) fn list<T>(
        &mut self,
        mut each: impl FnMut(&mut Self) -> Result<T, TransferError>,
    ) -> Result<Vec<T>, TransferError> {
        let count = self.u32()? as usize;
        // No entry is shorter than a byte: a wrong length takes no memory.
        if count > self.0.len() {
            return Err(TransferError::Damaged);
        }
        (0..count).map(|_| each(self)).collect()
    }
}
