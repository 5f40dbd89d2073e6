//! Layers with the parameters that torchvision gives them.

use super::config::Norm as NormConfig;
use super::init::{Init, constant};
use super::parameter::{Param, Parameters, part};
use crate::engine::{Filters, Tensor};

/// How a layer's weights are drawn.
#[derive(Clone, Copy, Debug)]
pub enum Spread {
    /// Normal, variance 2 / outputs that an input reaches (He et al. 2015).
    KaimingNormal,
    /// Uniform, variance 1 / inputs of an output.
    KaimingUniform,
    /// Normal with this standard deviation.
    Normal(f32),
    /// All zero: an input that makes no difference before it has been learnt.
    Zero,
}

/// Convolution: weight [out, in, size, size].
#[derive(Clone, Debug)]
pub struct Conv {
    weight: Param,
    bias: Option<Param>,
    stride: usize,
    /// The weights in the form that is fastest in use.
    filters: Option<Filters>,
}

impl Conv {
    /// A square kernel of odd size, padded so that stride 1 keeps the size of the image.
    pub fn new(
        init: &mut Init,
        channels: [usize; 2],
        size: usize,
        stride: usize,
        spread: Spread,
        bias: bool,
    ) -> Self {
        let [inputs, outputs] = channels;
        let shape = &[outputs, inputs, size, size];
        let fan_in = (inputs * size * size) as f32;
        let fan_out = (outputs * size * size) as f32;
        let weight = match spread {
            Spread::KaimingNormal => init.normal(shape, (2.0 / fan_out).sqrt()),
            Spread::KaimingUniform => init.uniform(shape, (3.0 / fan_in).sqrt()),
            Spread::Normal(std) => init.normal(shape, std),
            Spread::Zero => constant(shape, 0.0),
        };
        Self {
            weight,
            bias: bias.then(|| constant(&[outputs], 0.0)),
            stride,
            filters: None,
        }
    }

    /// [batch, in, rows, columns] to [batch, out, rows / stride, columns / stride], rounded up.
    pub fn forward(&self, x: &Tensor) -> Tensor {
        let weight = &self.weight.tensor;
        let bias = self.bias.as_ref().map(|bias| &bias.tensor);
        match &self.filters {
            Some(filters) => x.filtered(weight, filters, bias),
            None => x.convolved(weight, bias, self.stride),
        }
    }

    /// Multiplies every output by a scale and adds a shift.
    fn scale(&mut self, scale: &[f32], shift: Vec<f32>) {
        let weight = self.weight.tensor.values_mut();
        let size = (weight.len() / scale.len().max(1)).max(1);
        for (weight, scale) in weight.chunks_mut(size).zip(scale) {
            weight.iter_mut().for_each(|weight| *weight *= scale);
        }
        let bias = self.bias.get_or_insert_with(|| constant(&[scale.len()], 0.0));
        let pairs = scale.iter().zip(shift);
        for (bias, (scale, shift)) in bias.tensor.values_mut().iter_mut().zip(pairs) {
            *bias = *bias * scale + shift;
        }
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        if self.stride == 1 && self.weight.tensor.shape()[2] == 3 {
            self.filters = Some(Filters::new(self.weight.tensor.values()));
        }
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        found.push((part(name, "weight"), &mut self.weight));
        found.extend(self.bias.as_mut().map(|bias| (part(name, "bias"), bias)));
    }
}

/// Transposed convolution that doubles an image: weight [in, out, 2, 2], stride 2.
#[derive(Clone, Debug)]
pub struct Doubling {
    weight: Param,
    bias: Param,
}

impl Doubling {
    pub fn new(init: &mut Init, [inputs, outputs]: [usize; 2]) -> Self {
        Self {
            weight: init.normal(&[inputs, outputs, 2, 2], (2.0 / (inputs * 4) as f32).sqrt()),
            bias: constant(&[outputs], 0.0),
        }
    }

    /// [batch, in, rows, columns] to the four pixels that each becomes: [4 batch, out, rows, columns], those
    /// of an image one after another, row by row. Nothing overlaps: operations on single pixels may
    /// come before [`assembled`].
    pub fn forward(&self, x: Tensor) -> Tensor {
        let [inputs, outputs] = self.weight.tensor.dims();
        let [batch, _, rows, columns] = x.dims();
        // From input, output, pixel to pixel, output, input.
        let weight = self.weight.tensor.clone().reshaped([1, inputs, 4 * outputs]);
        let weight = weight.exchanged().reshaped([4 * outputs, inputs]);
        let pixel_first = (0..4 * outputs).map(|place| place % outputs * 4 + place / outputs);
        let weight = weight.selected(pixel_first.collect());
        let weight = weight.reshaped([4 * outputs, inputs, 1, 1]);
        let bias = self
            .bias
            .tensor
            .selected((0..4 * outputs).map(|place| place % outputs).collect());
        let y = x.convolved(&weight, Some(&bias), 1);
        y.reshaped([4 * batch, outputs, rows, columns])
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        found.push((part(name, "weight"), &mut self.weight));
        found.push((part(name, "bias"), &mut self.bias));
    }
}

/// Assembles images [batch, channels, 2 rows, 2 columns] from the four pixels of each [4 batch, channels, rows,
/// columns].
pub fn assembled(x: &Tensor) -> Tensor {
    let [fours, channels, rows, columns] = x.dims();
    let mut places = Vec::with_capacity(x.values().len());
    for image in 0..fours / 4 {
        for (channel, row) in (0..channels).flat_map(|channel| (0..2 * rows).map(move |row| (channel, row))) {
            let pixel = |column: usize| 4 * image + row % 2 * 2 + column % 2;
            let line = |column| (pixel(column) * channels + channel) * rows + row / 2;
            places.extend((0..2 * columns).map(|column| line(column) * columns + column / 2));
        }
    }
    let values = x.clone().reshaped([x.values().len()]);
    values
        .selected(places)
        .reshaped([fours / 4, channels, 2 * rows, 2 * columns])
}

/// Fully connected layer: weight [out, in].
#[derive(Clone, Debug)]
pub struct Linear {
    weight: Param,
    bias: Param,
}

impl Linear {
    pub fn new(init: &mut Init, [inputs, outputs]: [usize; 2]) -> Self {
        let bound = 1.0 / (inputs as f32).sqrt();
        Self {
            weight: init.uniform(&[outputs, inputs], bound),
            bias: init.uniform(&[outputs], bound),
        }
    }

    /// [batch, in] to [batch, out].
    pub fn forward(&self, x: &Tensor) -> Tensor {
        x.linear(&self.weight.tensor, &self.bias.tensor)
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        found.push((part(name, "weight"), &mut self.weight));
        found.push((part(name, "bias"), &mut self.bias));
    }
}

/// Normalisation of channels, then a scale and a shift of each: over stored statistics where there are such,
/// else over groups of channels of each image.
#[derive(Clone, Debug)]
pub struct Norm {
    weight: Param,
    bias: Param,
    /// Mean and variance of each channel.
    statistics: Option<[Param; 2]>,
    groups: usize,
    epsilon: f32,
}

/// Added to the variance of a group (Wu & He 2018).
const GROUP_EPSILON: f32 = 1e-5;

impl Norm {
    /// `scale`: the first value of every channel's scale.
    pub fn new(config: NormConfig, channels: usize, scale: f32) -> Self {
        let (groups, epsilon, is_fixed) = match config {
            NormConfig::FrozenBatch { epsilon } => (1, epsilon as f32, true),
            NormConfig::Group { groups } => (groups, GROUP_EPSILON, false),
        };
        let param = |value| Param {
            is_fixed,
            ..constant(&[channels], value)
        };
        Self {
            weight: param(scale),
            bias: param(0.0),
            statistics: is_fixed.then(|| [param(0.0), param(1.0)]),
            groups,
            epsilon,
        }
    }

    /// [batch, channels, rows, columns], the same shape.
    pub fn forward(&self, x: Tensor) -> Tensor {
        match self.stored() {
            Some([scale, shift]) => x.scaled(scale, &shift),
            None => x.group_normalised(&self.weight.tensor, &self.bias.tensor, self.groups, self.epsilon),
        }
    }

    /// Scale and shift of each channel where the statistics are stored.
    fn stored(&self) -> Option<[Vec<f32>; 2]> {
        let [mean, variance] = self
            .statistics
            .as_ref()?
            .each_ref()
            .map(|param| param.tensor.values());
        let [weight, bias] = [&self.weight, &self.bias].map(|param| param.tensor.values());
        let scale = weight
            .iter()
            .zip(variance)
            .map(|(w, v)| w / (v + self.epsilon).sqrt());
        let scale: Vec<f32> = scale.collect();
        let shift = bias
            .iter()
            .zip(mean.iter().zip(&scale))
            .map(|(b, (m, s))| b - m * s);
        let shift = shift.collect();
        Some([scale, shift])
    }

    /// Its parameters under its name.
    pub fn parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        found.push((part(name, "weight"), &mut self.weight));
        found.push((part(name, "bias"), &mut self.bias));
        if let Some([mean, variance]) = &mut self.statistics {
            found.push((part(name, "running_mean"), mean));
            found.push((part(name, "running_var"), variance));
        }
    }
}

/// A convolution and perhaps a normalisation.
#[derive(Clone, Debug)]
pub struct ConvBlock {
    pub conv: Conv,
    pub norm: Option<Norm>,
}

impl ConvBlock {
    /// A convolution of stride 1 with a bias, or with a normalisation instead.
    pub fn new(
        init: &mut Init,
        channels: [usize; 2],
        size: usize,
        spread: Spread,
        norm: Option<NormConfig>,
    ) -> Self {
        Self {
            conv: Conv::new(init, channels, size, 1, spread, norm.is_none()),
            norm: norm.map(|norm| Norm::new(norm, channels[1], 1.0)),
        }
    }

    pub fn forward(&self, x: Tensor) -> Tensor {
        let y = self.conv.forward(&x);
        // Its memory is free before the normalisation takes some.
        drop(x);
        match &self.norm {
            Some(norm) => norm.forward(y),
            None => y,
        }
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards. A
    /// normalisation over stored statistics becomes part of the convolution.
    pub fn prepare(&mut self) {
        if let Some([scale, shift]) = self.norm.as_ref().and_then(Norm::stored) {
            self.conv.scale(&scale, shift);
            self.norm = None;
        }
        self.conv.prepare();
    }

    /// Its parameters under the names of convolution and normalisation.
    pub fn parameters<'a>(&'a mut self, [conv, norm]: [&str; 2], found: &mut Parameters<'a>) {
        self.conv.parameters(conv, found);
        if let Some(layer) = &mut self.norm {
            layer.parameters(norm, found);
        }
    }

    /// The parameters under torchvision's names for a list, which numbers both layers.
    pub fn numbered_parameters<'a>(&'a mut self, name: &str, found: &mut Parameters<'a>) {
        self.parameters([&part(name, 0), &part(name, 1)], found);
    }
}
