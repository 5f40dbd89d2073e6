//! GPS times of compressed points (LASzip: item GPSTIME11 of version 2, and the times of item POINT14).
//!
//! A time is stored as its difference from the last time of its sequence, in multiples of the sequence's
//! step. A file keeps four sequences and can switch between them before each time (LASzip 3.4,
//! `lasreaditemcompressed_v2.cpp` and `_v3.cpp`). The laz library makes a recursive call for every switch. A
//! byte of damaged data can stand for 45,000 switches, which overflow the stack; here switches are counted.

use std::io::{self, Read};

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;

/// Sequences of times in a file.
const SEQUENCES: usize = 4;
/// Largest multiple of the step that has a symbol of its own.
const LARGEST_MULTIPLE: u32 = 500;
/// Smallest multiple that has a symbol of its own.
const SMALLEST_MULTIPLE: i32 = -10;
/// Symbols of multiples: 0 to 500, and -1 to -10 after them.
const MULTIPLES: u32 = LARGEST_MULTIPLE + SMALLEST_MULTIPLE.unsigned_abs() + 1;
/// Symbols after those of the multiples: a whole time, and switches by one, two and three sequences.
const OTHERS: u32 = 4;
/// Differences with the multiple 0, the largest or the smallest, that a sequence takes before it gets a new
/// step.
const MOST_EXTREMES: u32 = 3;

/// The contexts of the coder of a difference, which distinguish its corrections.
mod correction {
    pub const FIRST: u32 = 0;
    pub const SAME: u32 = 1;
    pub const SMALL_MULTIPLE: u32 = 2;
    pub const LARGE_MULTIPLE: u32 = 3;
    pub const LARGEST_MULTIPLE: u32 = 4;
    pub const NEGATIVE_MULTIPLE: u32 = 5;
    pub const SMALLEST_MULTIPLE: u32 = 6;
    pub const ZERO: u32 = 7;
    pub const HIGH_HALF: u32 = 8;
    pub const COUNT: u32 = 9;
}

/// Times that follow each other at steps of about the same length.
#[derive(Clone, Copy, Default)]
struct Sequence {
    /// Bits of the last time, as a whole number.
    time: i64,
    step: i32,
    extremes: u32,
}

/// Decoder of times.
pub struct GpsTimes {
    /// Symbols that say that a time is the same as the last one: one in version 2, none in version 3, which
    /// has a bit for it elsewhere.
    repeats: u32,
    current: usize,
    newest: usize,
    sequences: [Sequence; SEQUENCES],
    without_step: ArithmeticModel,
    with_step: ArithmeticModel,
    corrections: IntegerDecompressor,
}

/// What a symbol says.
enum Symbol {
    Time,
    Switch(u32),
}

impl GpsTimes {
    /// Version 2: every point has a symbol.
    pub fn of_every_point() -> Self {
        Self::new(1, 0.0)
    }

    /// Version 3: only times that differ from the last one have symbols.
    pub fn of_changes(first: f64) -> Self {
        Self::new(0, first)
    }

    fn new(repeats: u32, first: f64) -> Self {
        let mut times = Self {
            repeats,
            current: 0,
            newest: 0,
            sequences: [Sequence::default(); SEQUENCES],
            without_step: ArithmeticModelBuilder::new(1 + OTHERS + repeats).build(),
            with_step: ArithmeticModelBuilder::new(MULTIPLES + OTHERS + repeats).build(),
            corrections: IntegerDecompressorBuilder::new()
                .bits(32)
                .contexts(correction::COUNT)
                .build_initialized(),
        };
        times.begin(first);
        times
    }

    fn begin(&mut self, first: f64) {
        self.sequences[0].time = first.to_bits().cast_signed();
    }

    /// The next time; an error where a file switches between its sequences without end.
    pub fn next<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<f64> {
        // A writer switches at most once; four switches before one time mean that the data are damaged.
        for _ in 0..SEQUENCES {
            let symbol = if self.sequences[self.current].step == 0 {
                self.next_without_step(decoder)?
            } else {
                self.next_with_step(decoder)?
            };
            match symbol {
                Symbol::Time => {
                    let bits = self.sequences[self.current].time.cast_unsigned();
                    return Ok(f64::from_bits(bits));
                }
                Symbol::Switch(by) => self.current = (self.current + by as usize) % SEQUENCES,
            }
        }
        let reason = "the GPS times of its points are damaged: copy the file again, or write it again";
        Err(io::Error::new(io::ErrorKind::InvalidData, reason))
    }

    fn next_without_step<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Symbol> {
        let symbol = decoder.decode_symbol(&mut self.without_step)?;
        let Some(symbol) = symbol.checked_sub(self.repeats) else {
            return Ok(Symbol::Time);
        };
        match symbol {
            0 => {
                let step = self.corrections.decompress(decoder, 0, correction::FIRST)?;
                let sequence = &mut self.sequences[self.current];
                sequence.step = step;
                sequence.extremes = 0;
                sequence.advance(step);
                Ok(Symbol::Time)
            }
            1 => self.whole_time(decoder),
            more => Ok(Symbol::Switch(more - 1)),
        }
    }

    fn next_with_step<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Symbol> {
        let symbol = decoder.decode_symbol(&mut self.with_step)?;
        let Some(after) = symbol.checked_sub(MULTIPLES) else {
            self.multiple(symbol, decoder)?;
            return Ok(Symbol::Time);
        };
        match after.checked_sub(self.repeats) {
            None => Ok(Symbol::Time),
            Some(0) => self.whole_time(decoder),
            Some(by) => Ok(Symbol::Switch(by)),
        }
    }

    /// A time that differs from the last one by about a multiple of the step.
    fn multiple<R: Read>(&mut self, symbol: u32, decoder: &mut ArithmeticDecoder<R>) -> io::Result<()> {
        let (multiple, context) = match symbol {
            0 => (0, correction::ZERO),
            1 => (1, correction::SAME),
            2..10 => (symbol as i32, correction::SMALL_MULTIPLE),
            10..LARGEST_MULTIPLE => (symbol as i32, correction::LARGE_MULTIPLE),
            LARGEST_MULTIPLE => (symbol as i32, correction::LARGEST_MULTIPLE),
            _ => match LARGEST_MULTIPLE as i32 - symbol as i32 {
                SMALLEST_MULTIPLE => (SMALLEST_MULTIPLE, correction::SMALLEST_MULTIPLE),
                negative => (negative, correction::NEGATIVE_MULTIPLE),
            },
        };
        let sequence = &mut self.sequences[self.current];
        let expected = sequence.step.wrapping_mul(multiple);
        let difference = self.corrections.decompress(decoder, expected, context)?;
        sequence.advance(difference);
        match context {
            correction::SAME => sequence.extremes = 0,
            correction::ZERO | correction::LARGEST_MULTIPLE | correction::SMALLEST_MULTIPLE => {
                sequence.count_extreme(difference);
            }
            _ => {}
        }
        Ok(())
    }

    /// A time far from the last one: it restarts the oldest sequence.
    fn whole_time<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Symbol> {
        let expected = (self.sequences[self.current].time >> 32) as i32;
        let high = self
            .corrections
            .decompress(decoder, expected, correction::HIGH_HALF)?;
        let low = decoder.read_int()?;
        self.newest = (self.newest + 1) % SEQUENCES;
        self.current = self.newest;
        self.sequences[self.current] = Sequence {
            time: i64::from(high) << 32 | i64::from(low),
            ..Sequence::default()
        };
        Ok(Symbol::Time)
    }
}

impl Sequence {
    fn advance(&mut self, difference: i32) {
        self.time = self.time.wrapping_add(i64::from(difference));
    }

    fn count_extreme(&mut self, difference: i32) {
        self.extremes += 1;
        if self.extremes > MOST_EXTREMES {
            self.step = difference;
            self.extremes = 0;
        }
    }
}

/// The times of points without layers: item GPSTIME11, version 2.
pub struct GpsTimeItem(GpsTimes);

impl GpsTimeItem {
    pub fn new() -> Self {
        Self(GpsTimes::of_every_point())
    }
}

impl<R: Read> FieldDecompressor<R> for GpsTimeItem {
    fn size_of_field(&self) -> usize {
        size_of::<f64>()
    }

    fn decompress_first(&mut self, source: &mut R, first: &mut [u8]) -> io::Result<()> {
        let mut bytes = [0; size_of::<f64>()];
        source.read_exact(&mut bytes)?;
        first.copy_from_slice(&bytes);
        self.0.begin(f64::from_le_bytes(bytes));
        Ok(())
    }

    fn decompress_with(&mut self, decoder: &mut ArithmeticDecoder<R>, time: &mut [u8]) -> io::Result<()> {
        time.copy_from_slice(&self.0.next(decoder)?.to_le_bytes());
        Ok(())
    }
}
