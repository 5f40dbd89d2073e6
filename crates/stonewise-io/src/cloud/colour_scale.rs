//! Colours whose numbers do not say how large white is.

/// Points of a file that are looked at before it is read.
pub(super) const LOOK_POINTS: usize = 10_000;

/// Values of one column among the points that are looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub largest: f64,
    /// All are whole and not negative.
    pub is_whole: bool,
}

impl Default for Seen {
    fn default() -> Self {
        Self {
            largest: 0.0,
            is_whole: true,
        }
    }
}

impl Seen {
    pub fn add(&mut self, value: f64) {
        self.largest = self.largest.max(value);
        self.is_whole &= value >= 0.0 && value.fract() == 0.0;
    }
}

/// What the values of three channels must be multiplied by to have 16 bits: they go to 65535 where one is above 255, to 1
/// where all are at most that and none is an integer by `is_real`, else to 255.
pub(super) fn to_16_bits(channels: [Seen; 3], is_real: bool) -> f64 {
    let largest = channels.iter().map(|c| c.largest).fold(0.0, f64::max);
    let is_real = is_real || channels.iter().any(|c| !c.is_whole);
    match largest {
        l if l > 255.0 => 1.0,
        l if l <= 1.0 && is_real => 65535.0,
        _ => 257.0,
    }
}
