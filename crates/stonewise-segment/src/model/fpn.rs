//! Feature pyramid (Lin et al. 2017, section 3).

use super::config::Norm;
use super::init::Init;
use super::kernels::ModelBackend;
use super::layers::{ConvBlock, Spread};
use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;
use burn::tensor::module::{interpolate, max_pool2d};
use burn::tensor::ops::{InterpolateMode, InterpolateOptions};

/// Brings all levels of a backbone to the same channels, coarse levels added to the finer ones.
#[derive(Module, Debug)]
pub struct Fpn<B: Backend> {
    inner_blocks: Vec<ConvBlock<B>>,
    layer_blocks: Vec<ConvBlock<B>>,
}

impl<B: ModelBackend> Fpn<B> {
    pub fn new(init: &mut Init<B>, inputs: [usize; 4], channels: usize, norm: Option<Norm>) -> Self {
        let mut block =
            |inputs, size| ConvBlock::new(init, [inputs, channels], size, Spread::KaimingUniform, norm);
        Self {
            inner_blocks: inputs.iter().map(|&inputs| block(inputs, 1)).collect(),
            layer_blocks: inputs.iter().map(|_| block(channels, 3)).collect(),
        }
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.layer_blocks.iter_mut().for_each(ConvBlock::prepare);
    }

    /// Levels of strides 4, 8, 16, 32 and 64, finest first. The image's sides must be multiples of 32.
    pub fn forward(&self, features: [Tensor<B, 4>; 4]) -> Vec<Tensor<B, 4>> {
        let mut levels = Vec::with_capacity(5);
        let mut above: Option<Tensor<B, 4>> = None;
        let blocks = self.inner_blocks.iter().zip(&self.layer_blocks);
        for (feature, (inner, layer)) in features.into_iter().zip(blocks).rev() {
            let lateral = inner.forward(feature);
            let merged = match above {
                Some(above) => {
                    let [_, _, rows, columns] = lateral.dims();
                    let options = InterpolateOptions::new(InterpolateMode::Nearest).with_align_corners(false);
                    lateral + interpolate(above, [rows, columns], options)
                }
                None => lateral,
            };
            levels.insert(0, layer.forward(merged.clone()));
            above = Some(merged);
        }
        let coarsest = levels[levels.len() - 1].clone();
        levels.push(max_pool2d(coarsest, [1; 2], [2; 2], [0; 2], [1; 2], false));
        levels
    }
}
