//! Residual networks (He et al. 2016) of 18, 34 and 50 layers; strides sit at the 3 x 3 convolutions, as in
//! torchvision.

use super::config::{ResnetConfig, ResnetDepth};
use super::init::Init;
use super::layers::{Conv, ConvBlock, Norm, Spread};
use super::parameter::{Parameters, part};
use crate::engine::Tensor;

/// Two 3 x 3 convolutions, or a 3 x 3 between two 1 x 1, around which the input is passed.
#[derive(Clone, Debug)]
struct Block {
    layers: Vec<ConvBlock>,
    downsample: Option<ConvBlock>,
}

impl Block {
    fn new(init: &mut Init, config: &ResnetConfig, inputs: usize, width: usize, stride: usize) -> Self {
        let outputs = width * expansion(config.depth);
        let mut layer = |channels: [usize; 2], size, stride, scale| ConvBlock {
            conv: Conv::new(init, channels, size, stride, Spread::KaimingNormal, false),
            norm: Some(Norm::new(config.norm, channels[1], scale)),
        };
        // A block begins as the identity (Goyal et al. 2017, section 5.1).
        let layers = if expansion(config.depth) == 1 {
            vec![
                layer([inputs, width], 3, stride, 1.0),
                layer([width, width], 3, 1, 0.0),
            ]
        } else {
            vec![
                layer([inputs, width], 1, 1, 1.0),
                layer([width, width], 3, stride, 1.0),
                layer([width, outputs], 1, 1, 0.0),
            ]
        };
        let downsample = stride != 1 || inputs != outputs;
        Self {
            layers,
            downsample: downsample.then(|| layer([inputs, outputs], 1, stride, 1.0)),
        }
    }

    fn forward(&self, x: &Tensor) -> Tensor {
        let shortcut = match &self.downsample {
            Some(downsample) => downsample.forward(x.clone()),
            None => x.clone(),
        };
        let mut y = self.layers[0].forward(x.clone());
        for layer in &self.layers[1..] {
            y = layer.forward(y.relu());
        }
        y.plus(&shortcut).relu()
    }

    fn prepare(&mut self) {
        let layers = self.layers.iter_mut().chain(&mut self.downsample);
        layers.for_each(ConvBlock::prepare);
    }

    fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        for (place, layer) in self.layers.iter_mut().enumerate() {
            let names = ["conv", "bn"].map(|kind| part(name, format!("{kind}{}", place + 1)));
            layer.parameters([&names[0], &names[1]], found);
        }
        if let Some(downsample) = &mut self.downsample {
            downsample.numbered_parameters(&part(name, "downsample"), found);
        }
    }
}

/// A residual network without its classifier.
#[derive(Clone, Debug)]
pub struct Resnet {
    stem: ConvBlock,
    stages: [Vec<Block>; 4],
    relief: Option<Conv>,
}

impl Resnet {
    /// `relief`: channels beside colour; their weights begin as zeros.
    pub fn new(init: &mut Init, config: &ResnetConfig, relief: usize) -> Self {
        let blocks = match config.depth {
            ResnetDepth::R18 => [2, 2, 2, 2],
            ResnetDepth::R34 | ResnetDepth::R50 => [3, 4, 6, 3],
        };
        let stem = ConvBlock {
            conv: Conv::new(init, [3, config.width], 7, 2, Spread::KaimingNormal, false),
            norm: Some(Norm::new(config.norm, config.width, 1.0)),
        };
        let mut inputs = config.width;
        let stages = [0, 1, 2, 3].map(|stage| {
            let width = config.width << stage;
            let block = |place: usize| {
                let stride = if place == 0 && stage > 0 { 2 } else { 1 };
                let block = Block::new(init, config, inputs, width, stride);
                inputs = width * expansion(config.depth);
                block
            };
            (0..blocks[stage]).map(block).collect()
        });
        let relief = (relief > 0).then(|| Conv::new(init, [relief, config.width], 7, 2, Spread::Zero, false));
        Self { stem, stages, relief }
    }

    /// Whether relief makes a difference.
    pub fn takes_relief(&self) -> bool {
        self.relief.is_some()
    }

    /// Features at strides 4, 8, 16 and 32 of an image batch [batch, 3, rows, columns] and, where there is
    /// any, its relief [batch, relief, rows, columns].
    pub fn forward(&self, x: &Tensor, relief: Option<&Tensor>) -> [Tensor; 4] {
        let colour = self.stem.conv.forward(x);
        let x = match (&self.relief, relief) {
            (Some(conv), Some(relief)) => colour.plus(&conv.forward(relief)),
            _ => colour,
        };
        let x = match &self.stem.norm {
            Some(norm) => norm.forward(x),
            None => x,
        };
        let mut x = x.relu().halved();
        self.stages.each_ref().map(|stage| {
            for block in stage {
                x = block.forward(&x);
            }
            x.clone()
        })
    }

    /// Moves stored statistics into the convolutions and makes these faster as long as the weights stay as
    /// they are.
    pub fn prepare(&mut self) {
        self.stem.prepare();
        self.stages.iter_mut().flatten().for_each(Block::prepare);
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        self.stem
            .parameters([&part(name, "conv1"), &part(name, "bn1")], found);
        for (stage, blocks) in self.stages.iter_mut().enumerate() {
            let name = part(name, format!("layer{}", stage + 1));
            for (place, block) in blocks.iter_mut().enumerate() {
                block.parameters(&part(&name, place), found);
            }
        }
        if let Some(relief) = &mut self.relief {
            relief.parameters(&part(name, "relief"), found);
        }
    }
}

/// Channels of the four stages' features.
pub fn channels(config: &ResnetConfig) -> [usize; 4] {
    [0, 1, 2, 3].map(|stage| (config.width << stage) * expansion(config.depth))
}

/// A block's output channels over its inner ones.
fn expansion(depth: ResnetDepth) -> usize {
    match depth {
        ResnetDepth::R18 | ResnetDepth::R34 => 1,
        ResnetDepth::R50 => 4,
    }
}
