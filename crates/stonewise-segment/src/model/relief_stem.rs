//! The stem of relief: what relief adds to the levels of a feature pyramid.

use super::config::Norm as NormConfig;
use super::init::Init;
use super::layers::{Conv, ConvBlock, Norm, Spread};
use super::parameter::{Parameters, part};
use crate::engine::Tensor;

/// Channels of the stages.
const WIDTHS: [usize; 4] = [32, 48, 64, 64];
/// Groups of channels that are normalised together.
const NORM: NormConfig = NormConfig::Group { groups: 16 };

/// Four stages, each of two 3 x 3 convolutions, of which the first halves the map.
#[derive(Clone, Debug)]
pub struct ReliefStem {
    stages: Vec<[ConvBlock; 2]>,
    laterals: Vec<Conv>,
}

impl ReliefStem {
    /// From `inputs` channels of relief to `outputs` channels of the pyramid, to which it adds nothing at first.
    pub fn new(init: &mut Init, inputs: usize, outputs: usize) -> Self {
        let (mut stages, mut laterals, mut inputs) = (Vec::new(), Vec::new(), inputs);
        for width in WIDTHS {
            let mut layer = |inputs, stride| ConvBlock {
                conv: Conv::new(init, [inputs, width], 3, stride, Spread::KaimingNormal, false),
                norm: Some(Norm::new(NORM, width, 1.0)),
            };
            stages.push([layer(inputs, 2), layer(width, 1)]);
            laterals.push(Conv::new(init, [width, outputs], 1, 1, Spread::Zero, true));
            inputs = width;
        }
        Self { stages, laterals }
    }

    /// What relief [batch, channels, rows, columns] of half an image's rows and columns adds to the levels of strides
    /// 4, 8, 16 and 32 of the image, finest first; zeros for images whose relief is not `present`.
    pub fn forward(&self, relief: &Tensor, present: &[bool]) -> Vec<Tensor> {
        let mut x = relief.clone();
        let mut levels = Vec::with_capacity(WIDTHS.len());
        for ([first, second], lateral) in self.stages.iter().zip(&self.laterals) {
            x = second.forward(first.forward(x).relu()).relu();
            let level = lateral.forward(&x);
            if present.contains(&false) {
                let [batch, channels, rows, columns] = level.dims();
                let scale = present
                    .iter()
                    .map(|present| f32::from(u8::from(*present)))
                    .collect();
                let of_images = level.reshaped([1, batch, channels * rows * columns]);
                let level = of_images.scaled(scale, &vec![0.0; batch]);
                levels.push(level.reshaped([batch, channels, rows, columns]));
            } else {
                levels.push(level);
            }
        }
        levels
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.stages.iter_mut().flatten().for_each(ConvBlock::prepare);
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        for (place, [first, second]) in self.stages.iter_mut().enumerate() {
            let name = part(&part(name, "stages"), place);
            first.parameters([&part(&name, 0), &part(&name, 1)], found);
            second.parameters([&part(&name, 3), &part(&name, 4)], found);
        }
        for (place, lateral) in self.laterals.iter_mut().enumerate() {
            lateral.parameters(&part(&part(name, "laterals"), place), found);
        }
    }
}
