//! A point of the formats 6 to 10, without colours and extra bytes (LAS 1.4 R15, table 15).

/// Bytes of a point.
pub const POINT_BYTES: usize = 30;

/// Bits of the flags that hold the scanner channel.
const CHANNEL_BITS: u8 = 0b0011_0000;

#[derive(Clone, Copy)]
pub struct Point {
    pub x: i32,
    pub y: i32,
    pub z: i32,
    pub intensity: u16,
    pub return_number: u8,
    pub return_count: u8,
    /// Edge of the flight line, direction of the scan, scanner channel, and flags of the class.
    flags: u8,
    pub class: u8,
    pub user_data: u8,
    pub scan_angle: i16,
    pub source: u16,
    pub time: f64,
}

impl Point {
    pub fn unpack(record: &[u8; POINT_BYTES]) -> Self {
        let word = |at: usize| [record[at], record[at + 1], record[at + 2], record[at + 3]];
        let long = |at| i32::from_le_bytes(word(at));
        let short = |at: usize| [record[at], record[at + 1]];
        let [a, b, c, d] = word(22);
        let [e, f, g, h] = word(26);
        Self {
            x: long(0),
            y: long(4),
            z: long(8),
            intensity: u16::from_le_bytes(short(12)),
            return_number: record[14] & 15,
            return_count: record[14] >> 4,
            flags: record[15],
            class: record[16],
            user_data: record[17],
            scan_angle: i16::from_le_bytes(short(18)),
            source: u16::from_le_bytes(short(20)),
            time: f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        }
    }

    pub fn pack(&self, record: &mut [u8]) {
        record[0..4].copy_from_slice(&self.x.to_le_bytes());
        record[4..8].copy_from_slice(&self.y.to_le_bytes());
        record[8..12].copy_from_slice(&self.z.to_le_bytes());
        record[12..14].copy_from_slice(&self.intensity.to_le_bytes());
        record[14] = self.return_count << 4 | self.return_number;
        record[15] = self.flags;
        record[16] = self.class;
        record[17] = self.user_data;
        record[18..20].copy_from_slice(&self.scan_angle.to_le_bytes());
        record[20..22].copy_from_slice(&self.source.to_le_bytes());
        record[22..30].copy_from_slice(&self.time.to_le_bytes());
    }

    pub fn channel(&self) -> usize {
        usize::from((self.flags & CHANNEL_BITS) >> 4)
    }

    pub fn set_channel(&mut self, channel: usize) {
        self.flags = self.flags & !CHANNEL_BITS | (channel as u8) << 4 & CHANNEL_BITS;
    }

    /// The flags without the channel, six bits.
    pub fn flags(&self) -> u8 {
        self.flags >> 2 & 0b11_0000 | self.flags & 15
    }

    pub fn set_flags(&mut self, six_bits: u8) {
        self.flags = (six_bits & 0b11_0000) << 2 | self.flags & CHANNEL_BITS | six_bits & 15;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_survives_unpacking_and_packing() {
        let record = std::array::from_fn(|i| (37 * i + 11) as u8);
        let mut again = [0; POINT_BYTES];
        Point::unpack(&record).pack(&mut again);
        assert_eq!(again, record);
    }

    #[test]
    fn channel_and_flags_share_a_byte() {
        let mut point = Point::unpack(&[0; POINT_BYTES]);
        for (channel, flags) in [(3, 0b10_1001), (0, 0b01_0110), (2, 0b11_1111), (1, 0)] {
            point.set_channel(channel);
            point.set_flags(flags);
            assert_eq!((point.channel(), point.flags()), (channel, flags));
        }
    }
}
