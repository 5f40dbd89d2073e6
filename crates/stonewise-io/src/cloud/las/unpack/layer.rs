//! The layers of a chunk of points.

use std::io::{self, Cursor, Read};

use laz::decoders::ArithmeticDecoder;

/// Attributes of a point in the order of their layers.
#[derive(Clone, Copy)]
pub enum Attribute {
    /// Scanner channel, returns, x and y.
    Position,
    Height,
    Class,
    Flags,
    Intensity,
    ScanAngle,
    UserData,
    Source,
    Time,
}

const LAYERS: usize = Attribute::Time as usize + 1;

/// The layers of one chunk.
pub struct Layers {
    sizes: [u32; LAYERS],
    /// An attribute that never changes has no bytes.
    decoders: [Option<Layer>; LAYERS],
}

/// The bytes of an attribute.
pub type Layer = ArithmeticDecoder<Cursor<Vec<u8>>>;

impl Layers {
    pub fn new() -> Self {
        Self {
            sizes: [0; LAYERS],
            decoders: [const { None }; LAYERS],
        }
    }

    pub fn read_sizes(&mut self, source: &mut impl Read) -> io::Result<()> {
        for size in &mut self.sizes {
            let mut bytes = [0; 4];
            source.read_exact(&mut bytes)?;
            *size = u32::from_le_bytes(bytes);
        }
        Ok(())
    }

    pub fn read(&mut self, source: &mut impl Read) -> io::Result<()> {
        for (decoder, &size) in self.decoders.iter_mut().zip(&self.sizes) {
            *decoder = (size > 0).then(|| layer(source, size)).transpose()?;
        }
        Ok(())
    }

    /// The bytes of an attribute that changes.
    pub fn get(&mut self, attribute: Attribute) -> Option<&mut Layer> {
        self.decoders[attribute as usize].as_mut()
    }

    /// The bytes that say where the points are, which no chunk lacks.
    pub fn position(&mut self) -> io::Result<&mut Layer> {
        let missing = || io::Error::new(io::ErrorKind::InvalidData, "a chunk has no positions");
        self.get(Attribute::Position).ok_or_else(missing)
    }
}

fn layer(source: &mut impl Read, size: u32) -> io::Result<Layer> {
    let mut bytes = Vec::new();
    source.take(u64::from(size)).read_to_end(&mut bytes)?;
    if bytes.len() < size as usize {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    let mut layer = ArithmeticDecoder::new(Cursor::new(bytes));
    layer.read_init_bytes()?;
    Ok(layer)
}
