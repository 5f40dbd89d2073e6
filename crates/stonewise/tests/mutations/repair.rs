//! Checksums made right again after a change, so that what lies behind them is reached.

use std::sync::LazyLock;

/// E57: a CRC-32C at the end of every page, big endian (ASTM E2807, section 9.3).
pub fn e57(bytes: &mut [u8]) {
    let Some(size) = bytes.get(40..48).and_then(|b| b.try_into().ok()) else {
        return;
    };
    let size = usize::try_from(u64::from_le_bytes(size)).unwrap_or(0);
    if !(8..=1 << 20).contains(&size) {
        return;
    }
    for page in bytes.chunks_exact_mut(size) {
        let (data, checksum) = page.split_at_mut(size - 4);
        checksum.copy_from_slice(&crc32c(data).to_be_bytes());
    }
}

/// Castagnoli's polynomial, byte by byte.
fn crc32c(data: &[u8]) -> u32 {
    static TABLE: LazyLock<[u32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| by_bit(byte as u32)));
    !data.iter().fold(!0, |crc: u32, &byte| {
        crc >> 8 ^ TABLE[usize::from(crc as u8 ^ byte)]
    })
}

fn by_bit(byte: u32) -> u32 {
    (0..8).fold(byte, |c, _| c >> 1 ^ (0x82f6_3b78 & (c & 1).wrapping_neg()))
}

/// PNG: a CRC-32 behind every chunk (W3C PNG, section 5.3).
pub fn png(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let end = at + 8 + length;
        if end + 4 > bytes.len() {
            return;
        }
        let mut crc = flate2::Crc::new();
        crc.update(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&crc.sum().to_be_bytes());
        at = end + 4;
    }
}
