//! Residual networks (He et al. 2016) of 18, 34 and 50 layers; strides sit at the 3 x 3 convolutions, as in
//! torchvision.

use super::config::{BackboneConfig, ResnetDepth};
use super::init::Init;
use super::kernels::{ModelBackend, float, primitive};
use super::layers::{Conv, ConvBlock, Norm, Spread, fold, normalised};
use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;
use burn::tensor::backend::Backend;

/// Two 3 x 3 convolutions, or a 3 x 3 between two 1 x 1, around which the input is passed.
#[derive(Module, Debug)]
struct Block<B: Backend> {
    conv1: Conv<B>,
    bn1: Option<Norm<B>>,
    conv2: Conv<B>,
    bn2: Option<Norm<B>>,
    conv3: Option<Conv<B>>,
    bn3: Option<Norm<B>>,
    downsample: Option<ConvBlock<B>>,
}

impl<B: ModelBackend> Block<B> {
    fn new(init: &mut Init<B>, config: &BackboneConfig, inputs: usize, width: usize, stride: usize) -> Self {
        let conv = |init: &mut Init<B>, channels, size, stride| {
            Conv::new(init, channels, size, stride, Spread::KaimingNormal, false)
        };
        let norm = |init: &mut Init<B>, channels, scale| Some(Norm::new(init, config.norm, channels, scale));
        let outputs = width * expansion(config.depth);
        let is_basic = expansion(config.depth) == 1;
        let (first_size, strides) = if is_basic {
            (3, [stride, 1])
        } else {
            (1, [1, stride])
        };
        // A block begins as the identity (Goyal et al. 2017, section 5.1).
        let (scale2, scale3) = if is_basic { (0.0, 1.0) } else { (1.0, 0.0) };
        Self {
            conv1: conv(init, [inputs, width], first_size, strides[0]),
            bn1: norm(init, width, 1.0),
            conv2: conv(init, [width, width], 3, strides[1]),
            bn2: norm(init, width, scale2),
            conv3: (!is_basic).then(|| conv(init, [width, outputs], 1, 1)),
            bn3: if is_basic {
                None
            } else {
                norm(init, outputs, scale3)
            },
            downsample: (stride != 1 || inputs != outputs).then(|| ConvBlock {
                conv: conv(init, [inputs, outputs], 1, stride),
                norm: norm(init, outputs, 1.0),
            }),
        }
    }

    fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        let shortcut = match &self.downsample {
            Some(downsample) => downsample.forward(x.clone()),
            None => x.clone(),
        };
        let x = relu(normalised(&self.conv1, &self.bn1, x));
        let x = normalised(&self.conv2, &self.bn2, x);
        let x = match &self.conv3 {
            Some(conv3) => normalised(conv3, &self.bn3, relu(x)),
            None => x,
        };
        relu(x + shortcut)
    }

    fn fold(&mut self) {
        fold(&mut self.conv1, &mut self.bn1);
        fold(&mut self.conv2, &mut self.bn2);
        if let Some(conv3) = &mut self.conv3 {
            fold(conv3, &mut self.bn3);
        }
        if let Some(downsample) = &mut self.downsample {
            fold(&mut downsample.conv, &mut downsample.norm);
        }
    }

    fn prepare(&mut self) {
        self.conv1.prepare();
        self.conv2.prepare();
        if let Some(conv3) = &mut self.conv3 {
            conv3.prepare();
        }
    }
}

/// A residual network without its classifier.
#[derive(Module, Debug)]
pub struct Resnet<B: Backend> {
    conv1: Conv<B>,
    bn1: Option<Norm<B>>,
    layer1: Vec<Block<B>>,
    layer2: Vec<Block<B>>,
    layer3: Vec<Block<B>>,
    layer4: Vec<Block<B>>,
    relief: Option<Conv<B>>,
}

impl<B: ModelBackend> Resnet<B> {
    /// `relief`: channels beside colour; their weights begin as zeros.
    pub fn new(init: &mut Init<B>, config: &BackboneConfig, relief: usize) -> Self {
        let blocks = match config.depth {
            ResnetDepth::R18 => [2, 2, 2, 2],
            ResnetDepth::R34 | ResnetDepth::R50 => [3, 4, 6, 3],
        };
        let conv1 = Conv::new(init, [3, config.width], 7, 2, Spread::KaimingNormal, false);
        let bn1 = Some(Norm::new(init, config.norm, config.width, 1.0));
        let mut inputs = config.width;
        let mut stage = |stage: usize| -> Vec<Block<B>> {
            let width = config.width << stage;
            let block = |place: usize| {
                let stride = if place == 0 && stage > 0 { 2 } else { 1 };
                let block = Block::new(init, config, inputs, width, stride);
                inputs = width * expansion(config.depth);
                block
            };
            (0..blocks[stage]).map(block).collect()
        };
        let [layer1, layer2, layer3, layer4] = [0, 1, 2, 3].map(&mut stage);
        let relief = (relief > 0).then(|| Conv::new(init, [relief, config.width], 7, 2, Spread::Zero, false));
        Self {
            conv1,
            bn1,
            layer1,
            layer2,
            layer3,
            layer4,
            relief,
        }
    }

    /// Whether relief makes a difference.
    pub fn takes_relief(&self) -> bool {
        self.relief.is_some()
    }

    /// Features at strides 4, 8, 16 and 32 of an image batch [batch, 3, rows, columns] and, where there is
    /// any, its relief [batch, relief, rows, columns].
    pub fn forward(&self, x: Tensor<B, 4>, relief: Option<Tensor<B, 4>>) -> [Tensor<B, 4>; 4] {
        let colour = self.conv1.forward(x);
        let x = match (&self.relief, relief) {
            (Some(conv), Some(relief)) => colour + conv.forward(relief),
            _ => colour,
        };
        let x = relu(match &self.bn1 {
            Some(norm) => norm.forward(x),
            None => x,
        });
        let mut x = float(B::halved(primitive(x)));
        [&self.layer1, &self.layer2, &self.layer3, &self.layer4].map(|layer| {
            for block in layer {
                x = block.forward(x.clone());
            }
            x.clone()
        })
    }

    /// Moves stored statistics into the convolutions and makes these faster as long as the weights stay as
    /// they are.
    pub fn prepare(&mut self) {
        fold(&mut self.conv1, &mut self.bn1);
        for layer in [
            &mut self.layer1,
            &mut self.layer2,
            &mut self.layer3,
            &mut self.layer4,
        ] {
            for block in layer {
                block.fold();
                block.prepare();
            }
        }
    }
}

/// Channels of the four stages' features.
pub fn channels(config: &BackboneConfig) -> [usize; 4] {
    [0, 1, 2, 3].map(|stage| (config.width << stage) * expansion(config.depth))
}

/// A block's output channels over its inner ones.
fn expansion(depth: ResnetDepth) -> usize {
    match depth {
        ResnetDepth::R18 | ResnetDepth::R34 => 1,
        ResnetDepth::R50 => 4,
    }
}
