//! What is remembered of the points of one scanner channel.

use std::io;

use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};

use super::gps_time::GpsTimes;
use super::layer::{Attribute, Layer, Layers};
use super::median::Median;
use super::point::Point;

/// Groups of returns for which coordinates are predicted separately.
const GROUPS: usize = 6;
/// Group of a return. Rows: number of returns of the pulse; columns: number of the return (LASzip:
/// `number_return_map_6ctx`). Impossible numbers, such as the third of two returns, have groups too.
const GROUP: [[u8; 16]; 16] = [
    [0, 1, 2, 3, 4, 5, 3, 4, 4, 5, 5, 5, 5, 5, 5, 5],
    [1, 0, 1, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3],
    [2, 1, 2, 4, 4, 4, 4, 4, 4, 4, 4, 3, 3, 3, 3, 3],
    [3, 3, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [4, 3, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [5, 3, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [3, 3, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4],
    [4, 3, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4],
    [4, 3, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4],
    [5, 3, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4],
    [5, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 4, 4, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5],
    [5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5],
];
/// Levels for which heights are predicted separately: how many returns of the pulse follow, 7 or more
/// together.
const LEVELS: u8 = 8;
/// The contexts of the corrections of y and z are numbers of bits, rounded down to even ones, up to these.
const Y_BITS: u32 = 20;
const Z_BITS: u32 = 18;

/// Which attributes of a point differ from the last one's, seven bits.
#[derive(Clone, Copy)]
pub struct Changes(pub u32);

impl Changes {
    pub fn channel(self) -> bool {
        self.0 & 1 << 6 != 0
    }

    fn source(self) -> bool {
        self.0 & 1 << 5 != 0
    }

    fn time(self) -> bool {
        self.0 & 1 << 4 != 0
    }

    fn scan_angle(self) -> bool {
        self.0 & 1 << 3 != 0
    }

    fn return_count(self) -> bool {
        self.0 & 1 << 2 != 0
    }

    fn return_number(self) -> ReturnNumber {
        match self.0 & 3 {
            0 => ReturnNumber::Same,
            1 => ReturnNumber::Next,
            2 => ReturnNumber::Previous,
            _ => ReturnNumber::Other,
        }
    }
}

enum ReturnNumber {
    Same,
    Next,
    Previous,
    Other,
}

/// Models of symbols, each made when it is first needed.
struct Models {
    symbols: u32,
    models: Vec<Option<ArithmeticModel>>,
}

impl Models {
    fn new(count: usize, symbols: u32) -> Self {
        Self {
            symbols,
            models: vec![None; count],
        }
    }

    fn get(&mut self, context: u8) -> &mut ArithmeticModel {
        let symbols = self.symbols;
        self.models[usize::from(context)].get_or_insert_with(|| model(symbols))
    }
}

fn model(symbols: u32) -> ArithmeticModel {
    ArithmeticModelBuilder::new(symbols).build()
}

fn number(bits: u32, contexts: u32) -> IntegerDecompressor {
    IntegerDecompressorBuilder::new()
        .bits(bits)
        .contexts(contexts)
        .build_initialized()
}

/// The last point of a channel, and what is known from those before it.
pub struct Context {
    pub last: Point,
    time_changed: bool,
    changes: Models,
    channel: ArithmeticModel,
    return_counts: Models,
    return_numbers: Models,
    return_steps: ArithmeticModel,
    x_steps: [Median; 2 * GROUPS],
    y_steps: [Median; 2 * GROUPS],
    x: IntegerDecompressor,
    y: IntegerDecompressor,
    heights: [i32; LEVELS as usize],
    z: IntegerDecompressor,
    classes: Models,
    flags: Models,
    intensities: [u16; 8],
    intensity: IntegerDecompressor,
    scan_angle: IntegerDecompressor,
    user_data: Models,
    source: IntegerDecompressor,
    times: GpsTimes,
}

impl Context {
    pub fn after(last: Point) -> Self {
        Self {
            last,
            time_changed: false,
            changes: Models::new(8, 128),
            channel: model(3),
            return_counts: Models::new(16, 16),
            return_numbers: Models::new(16, 16),
            return_steps: model(13),
            x_steps: [Median::new(); 2 * GROUPS],
            y_steps: [Median::new(); 2 * GROUPS],
            x: number(32, 2),
            y: number(32, Y_BITS + 2),
            heights: [last.z; LEVELS as usize],
            z: number(32, Z_BITS + 2),
            classes: Models::new(64, 256),
            flags: Models::new(64, 64),
            intensities: [last.intensity; 8],
            intensity: number(16, 4),
            scan_angle: number(16, 2),
            user_data: Models::new(64, 256),
            source: number(16, 1),
            times: GpsTimes::of_changes(last.time),
        }
    }

    /// What changes from the last point to the next one.
    pub fn read_changes(&mut self, layer: &mut Layer) -> io::Result<Changes> {
        let last = &self.last;
        let first_return = u8::from(last.return_number == 1);
        let last_return = u8::from(last.return_number >= last.return_count);
        let context = first_return | last_return << 1 | u8::from(self.time_changed) << 2;
        layer.decode_symbol(self.changes.get(context)).map(Changes)
    }

    /// By how many channels, counted around all four, the next point's channel differs from this one.
    pub fn read_channel_step(&mut self, layer: &mut Layer) -> io::Result<usize> {
        Ok(layer.decode_symbol(&mut self.channel)? as usize + 1)
    }

    /// Replaces the last point by the next one.
    pub fn read_point(&mut self, changes: Changes, layers: &mut Layers) -> io::Result<()> {
        let layer = layers.position()?;
        self.read_returns(changes, layer)?;
        self.read_xy(changes, layer)?;
        if let Some(layer) = layers.get(Attribute::Height) {
            self.read_z(layer)?;
        }
        self.read_class(layers)?;
        if let Some(layer) = layers.get(Attribute::Intensity) {
            self.read_intensity(changes, layer)?;
        }
        self.read_origin(changes, layers)?;
        self.time_changed = changes.time();
        if let Some(layer) = layers.get(Attribute::Time).filter(|_| changes.time()) {
            self.last.time = self.times.next(layer)?;
        }
        Ok(())
    }

    fn read_returns(&mut self, changes: Changes, layer: &mut Layer) -> io::Result<()> {
        let last = &mut self.last;
        if changes.return_count() {
            let model = self.return_counts.get(last.return_count);
            last.return_count = layer.decode_symbol(model)? as u8;
        }
        let number = last.return_number;
        let next = match changes.return_number() {
            ReturnNumber::Same => number,
            ReturnNumber::Next => number + 1,
            ReturnNumber::Previous => number + 15,
            ReturnNumber::Other if changes.time() => {
                layer.decode_symbol(self.return_numbers.get(number))? as u8
            }
            ReturnNumber::Other => number + 2 + layer.decode_symbol(&mut self.return_steps)? as u8,
        };
        last.return_number = next % 16;
        Ok(())
    }

    fn read_xy(&mut self, changes: Changes, layer: &mut Layer) -> io::Result<()> {
        let last = &mut self.last;
        let group = GROUP[usize::from(last.return_count)][usize::from(last.return_number)];
        let group = usize::from(group) << 1 | usize::from(changes.time());
        let single = u32::from(last.return_count == 1);

        let steps = &mut self.x_steps[group];
        let step = self.x.decompress(layer, steps.get(), single)?;
        steps.add(step);
        last.x = last.x.wrapping_add(step);

        let steps = &mut self.y_steps[group];
        let step = self
            .y
            .decompress(layer, steps.get(), single + pair_of_bits(self.x.k(), Y_BITS))?;
        steps.add(step);
        last.y = last.y.wrapping_add(step);
        Ok(())
    }

    fn read_z(&mut self, layer: &mut Layer) -> io::Result<()> {
        let last = &mut self.last;
        let level = last.return_count.abs_diff(last.return_number).min(LEVELS - 1);
        let height = &mut self.heights[usize::from(level)];
        let bits = u32::midpoint(self.x.k(), self.y.k());
        let context = u32::from(last.return_count == 1) + pair_of_bits(bits, Z_BITS);
        last.z = self.z.decompress(layer, *height, context)?;
        *height = last.z;
        Ok(())
    }

    fn read_class(&mut self, layers: &mut Layers) -> io::Result<()> {
        let single = self.is_last_return() && self.last.return_number == 1;
        let last = &mut self.last;
        if let Some(layer) = layers.get(Attribute::Class) {
            let context = (last.class & 31) << 1 | u8::from(single);
            last.class = layer.decode_symbol(self.classes.get(context))? as u8;
        }
        if let Some(layer) = layers.get(Attribute::Flags) {
            let model = self.flags.get(last.flags());
            last.set_flags(layer.decode_symbol(model)? as u8);
        }
        Ok(())
    }

    fn read_intensity(&mut self, changes: Changes, layer: &mut Layer) -> io::Result<()> {
        let context = u8::from(self.last.return_number == 1) << 1 | u8::from(self.is_last_return());
        let expected = &mut self.intensities[usize::from(context << 1 | u8::from(changes.time()))];
        let value = self
            .intensity
            .decompress(layer, i32::from(*expected), u32::from(context))?;
        self.last.intensity = value as u16;
        *expected = self.last.intensity;
        Ok(())
    }

    /// Scan angle, user data and point source.
    fn read_origin(&mut self, changes: Changes, layers: &mut Layers) -> io::Result<()> {
        let last = &mut self.last;
        if let Some(layer) = layers.get(Attribute::ScanAngle).filter(|_| changes.scan_angle()) {
            let expected = i32::from(last.scan_angle);
            let value = self
                .scan_angle
                .decompress(layer, expected, changes.time().into())?;
            last.scan_angle = value as i16;
        }
        if let Some(layer) = layers.get(Attribute::UserData) {
            let model = self.user_data.get(last.user_data / 4);
            last.user_data = layer.decode_symbol(model)? as u8;
        }
        if let Some(layer) = layers.get(Attribute::Source).filter(|_| changes.source()) {
            let value = self.source.decompress(layer, i32::from(last.source), 0)?;
            last.source = value as u16;
        }
        Ok(())
    }

    fn is_last_return(&self) -> bool {
        self.last.return_number >= self.last.return_count
    }
}

/// A number of bits, rounded down to an even one, at most `most`.
fn pair_of_bits(bits: u32, most: u32) -> u32 {
    if bits < most { bits & !1 } else { most }
}
