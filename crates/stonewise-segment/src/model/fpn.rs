//! Feature pyramid (Lin et al. 2017, section 3).

use super::backbone::Features;
use super::config::Norm;
use super::init::Init;
use super::layers::{ConvBlock, Spread};
use super::parameter::{Parameters, part};
use crate::engine::Tensor;

/// Brings all levels of a backbone to the same channels, coarse levels added to the finer ones.
#[derive(Clone, Debug)]
pub struct Fpn {
    inner_blocks: Vec<ConvBlock>,
    layer_blocks: Vec<ConvBlock>,
}

impl Fpn {
    pub fn new(init: &mut Init, inputs: [usize; 4], channels: usize, norm: Option<Norm>) -> Self {
        let mut block =
            |inputs, size| ConvBlock::new(init, [inputs, channels], size, Spread::KaimingUniform, norm);
        Self {
            inner_blocks: inputs.iter().map(|&inputs| block(inputs, 1)).collect(),
            layer_blocks: inputs.iter().map(|_| block(channels, 3)).collect(),
        }
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        let blocks = self.inner_blocks.iter_mut().chain(&mut self.layer_blocks);
        blocks.for_each(ConvBlock::prepare);
    }

    /// Levels of strides 4, 8, 16, 32 and 64, finest first. The image's sides must be multiples of 32. The
    /// contributions of relief are added before coarse levels are added to finer ones.
    pub fn forward(&self, features: Features) -> Vec<Tensor> {
        let mut relief = features.relief.into_iter().rev();
        let mut levels = Vec::with_capacity(5);
        let mut above: Option<Tensor> = None;
        let blocks = self.inner_blocks.iter().zip(&self.layer_blocks);
        for (feature, (inner, layer)) in features.images.into_iter().zip(blocks).rev() {
            let lateral = inner.forward(feature);
            let lateral = match relief.next() {
                Some(relief) => lateral.plus(&relief),
                None => lateral,
            };
            let merged = match above {
                Some(above) => lateral.plus_doubled(&above),
                None => lateral,
            };
            levels.insert(0, layer.forward(merged.clone()));
            above = Some(merged);
        }
        levels.push(levels[levels.len() - 1].every_second());
        levels
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        for (list, blocks) in [
            ("inner_blocks", &mut self.inner_blocks),
            ("layer_blocks", &mut self.layer_blocks),
        ] {
            for (place, block) in blocks.iter_mut().enumerate() {
                block.numbered_parameters(&part(&part(name, list), place), found);
            }
        }
    }
}
