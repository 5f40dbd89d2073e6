//! Points of the formats 6 to 10 from their layers (LASzip: item POINT14, versions 3 and 4).

use std::io::{self, Read, Seek};

use laz::las::selective::DecompressionSelection;
use laz::record::LayeredFieldDecompressor;

use super::context::Context;
use super::layer::Layers;
use super::point::{POINT_BYTES, Point};

/// Scanner channels.
const CHANNELS: usize = 4;

/// Decoder of points.
pub struct PointItem {
    /// Version 3 passes the channel of a point to the items after it only when it changes, version 4 always.
    always_tells_channel: bool,
    layers: Layers,
    current: usize,
    channels: [Option<Box<Context>>; CHANNELS],
}

impl PointItem {
    pub fn new(version: u16) -> Self {
        Self {
            always_tells_channel: version > 3,
            layers: Layers::new(),
            current: 0,
            channels: [const { None }; CHANNELS],
        }
    }
}

impl<R: Read + Seek> LayeredFieldDecompressor<R> for PointItem {
    fn size_of_field(&self) -> usize {
        POINT_BYTES
    }

    /// All attributes are read.
    fn set_selection(&mut self, _: DecompressionSelection) {}

    fn init_first_point(&mut self, source: &mut R, first: &mut [u8], channel: &mut usize) -> io::Result<()> {
        let mut record = [0; POINT_BYTES];
        source.read_exact(&mut record)?;
        first.copy_from_slice(&record);
        let point = Point::unpack(&record);
        self.current = point.channel();
        *channel = self.current;
        self.channels = [const { None }; CHANNELS];
        self.channels[self.current] = Some(Box::new(Context::after(point)));
        Ok(())
    }

    fn decompress_field_with(&mut self, record: &mut [u8], channel: &mut usize) -> io::Result<()> {
        let Self {
            layers,
            channels,
            current,
            ..
        } = self;
        let context = existing(&mut channels[*current])?;
        let layer = layers.position()?;
        let changes = context.read_changes(layer)?;
        if changes.channel() {
            let last = context.last;
            *current = (*current + context.read_channel_step(layer)?) % CHANNELS;
            *channel = *current;
            channels[*current]
                .get_or_insert_with(|| Box::new(Context::after(last)))
                .last
                .set_channel(*current);
        }
        if self.always_tells_channel {
            *channel = *current;
        }
        let context = existing(&mut channels[*current])?;
        context.read_point(changes, layers)?;
        context.last.pack(record);
        Ok(())
    }

    fn read_layers_sizes(&mut self, source: &mut R) -> io::Result<()> {
        self.layers.read_sizes(source)
    }

    fn read_layers(&mut self, source: &mut R) -> io::Result<()> {
        self.layers.read(source)
    }
}

fn existing(context: &mut Option<Box<Context>>) -> io::Result<&mut Context> {
    let missing = || io::Error::new(io::ErrorKind::InvalidData, "a chunk has no first point");
    context.as_deref_mut().ok_or_else(missing)
}
