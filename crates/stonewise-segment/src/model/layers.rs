//! Layers with the parameters that torchvision gives them.

use super::config::Norm as NormConfig;
use super::init::Init;
use super::kernels::{Filters, ModelBackend, float, primitive};
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;

/// How a layer's weights are drawn.
#[derive(Clone, Copy, Debug)]
pub enum Spread {
    /// Normal, variance 2 / outputs that an input reaches (He et al. 2015).
    KaimingNormal,
    /// Uniform, variance 1 / inputs of an output.
    KaimingUniform,
    /// Normal with this standard deviation.
    Normal(f32),
    /// Uniform within one over the root of an output's inputs.
    Default,
    /// All zero: an input that makes no difference before it has been learnt.
    Zero,
}

/// Convolution: weight [out, in, size, size].
#[derive(Module, Debug)]
pub struct Conv<B: Backend> {
    pub weight: Param<Tensor<B, 4>>,
    pub bias: Option<Param<Tensor<B, 1>>>,
    stride: usize,
    /// The weights in the form that is fastest in use.
    #[module(skip)]
    filters: Option<Filters>,
}

impl<B: ModelBackend> Conv<B> {
    /// A square kernel of odd size, padded so that stride 1 keeps the size of the image.
    pub fn new(
        init: &mut Init<B>,
        channels: [usize; 2],
        size: usize,
        stride: usize,
        spread: Spread,
        bias: bool,
    ) -> Self {
        let [inputs, outputs] = channels;
        let shape = [outputs, inputs, size, size];
        let fan_in = (inputs * size * size) as f32;
        let fan_out = (outputs * size * size) as f32;
        let weight = match spread {
            Spread::KaimingNormal => init.normal(shape, (2.0 / fan_out).sqrt()),
            Spread::KaimingUniform => init.uniform(shape, (3.0 / fan_in).sqrt()),
            Spread::Normal(std) => init.normal(shape, std),
            Spread::Default => init.uniform(shape, 1.0 / fan_in.sqrt()),
            Spread::Zero => init.constant(shape, 0.0),
        };
        Self {
            weight,
            bias: bias.then(|| init.constant([outputs], 0.0)),
            stride,
            filters: None,
        }
    }

    /// [batch, in, rows, columns] to [batch, out, rows / stride, columns / stride], rounded up.
    pub fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        let bias = self.bias.as_ref().map(|bias| primitive(bias.val()));
        let (x, weight) = (primitive(x), primitive(self.weight.val()));
        float(match &self.filters {
            Some(filters) => B::convolve_filtered(x, (weight, filters), bias),
            None => B::convolve(x, weight, bias, self.stride),
        })
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.filters = B::filters(primitive(self.weight.val()), self.stride);
    }
}

/// Transposed convolution that doubles an image: weight [in, out, 2, 2], stride 2.
#[derive(Module, Debug)]
pub struct Doubling<B: Backend> {
    pub weight: Param<Tensor<B, 4>>,
    pub bias: Param<Tensor<B, 1>>,
}

impl<B: ModelBackend> Doubling<B> {
    pub fn new(init: &mut Init<B>, [inputs, outputs]: [usize; 2]) -> Self {
        Self {
            weight: init.normal([inputs, outputs, 2, 2], (2.0 / (inputs * 4) as f32).sqrt()),
            bias: init.constant([outputs], 0.0),
        }
    }

    /// [batch, in, rows, columns] to the four pixels that each becomes: [4 batch, out, rows, columns], those
    /// of an image one after another, row by row. Nothing overlaps: operations on single pixels may
    /// come before [`assembled`].
    pub fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        let [inputs, outputs, ..] = self.weight.dims();
        let [batch, _, rows, columns] = x.dims();
        let weight = self.weight.val().permute([2, 3, 1, 0]);
        let weight = weight.reshape([4 * outputs, inputs, 1, 1]);
        let bias = self
            .bias
            .val()
            .unsqueeze_dim::<2>(0)
            .repeat_dim(0, 4)
            .flatten::<1>(0, 1);
        let x = float::<B, 4>(B::convolve(
            primitive(x),
            primitive(weight),
            Some(primitive(bias)),
            1,
        ));
        x.reshape([4 * batch, outputs, rows, columns])
    }
}

/// Assembles images [batch, channels, 2 rows, 2 columns] from the four pixels of each [4 batch, channels, rows,
/// columns].
pub fn assembled<B: Backend>(x: Tensor<B, 4>) -> Tensor<B, 4> {
    let [fours, channels, rows, columns] = x.dims();
    let batch = fours / 4;
    x.reshape([batch, 2, 2, channels, rows, columns])
        .permute([0, 3, 4, 1, 5, 2])
        .reshape([batch, channels, 2 * rows, 2 * columns])
}

/// Fully connected layer: weight [out, in].
#[derive(Module, Debug)]
pub struct Linear<B: Backend> {
    pub weight: Param<Tensor<B, 2>>,
    pub bias: Param<Tensor<B, 1>>,
}

impl<B: ModelBackend> Linear<B> {
    pub fn new(init: &mut Init<B>, [inputs, outputs]: [usize; 2]) -> Self {
        let bound = 1.0 / (inputs as f32).sqrt();
        Self {
            weight: init.uniform([outputs, inputs], bound),
            bias: init.uniform([outputs], bound),
        }
    }

    /// [batch, in] to [batch, out].
    pub fn forward(&self, x: Tensor<B, 2>) -> Tensor<B, 2> {
        x.matmul(self.weight.val().transpose()) + self.bias.val().unsqueeze()
    }
}

/// Normalisation of channels, then a scale and a shift of each: over stored statistics where there are such,
/// else over groups of channels of each image.
#[derive(Module, Debug)]
pub struct Norm<B: Backend> {
    pub weight: Param<Tensor<B, 1>>,
    pub bias: Param<Tensor<B, 1>>,
    pub running_mean: Option<Param<Tensor<B, 1>>>,
    pub running_var: Option<Param<Tensor<B, 1>>>,
    groups: usize,
    epsilon: f64,
}

/// Added to the variance of a group (Wu & He 2018).
const GROUP_EPSILON: f64 = 1e-5;

impl<B: ModelBackend> Norm<B> {
    /// `scale`: the first value of every channel's scale.
    pub fn new(init: &mut Init<B>, config: NormConfig, channels: usize, scale: f32) -> Self {
        let (groups, epsilon, frozen) = match config {
            NormConfig::FrozenBatch { epsilon } => (1, epsilon, true),
            NormConfig::Group { groups } => (groups, GROUP_EPSILON, false),
        };
        let mut fixed = |value: f32| init.constant([channels], value).set_require_grad(!frozen);
        Self {
            weight: fixed(scale),
            bias: fixed(0.0),
            running_mean: frozen.then(|| fixed(0.0)),
            running_var: frozen.then(|| fixed(1.0)),
            groups,
            epsilon,
        }
    }

    /// [batch, channels, rows, columns], the same shape.
    pub fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        match self.frozen() {
            Some([scale, shift]) => x * per_channel(scale) + per_channel(shift),
            None => {
                let (scale, shift) = (primitive(self.weight.val()), primitive(self.bias.val()));
                float(B::group_norm(
                    primitive(x),
                    scale,
                    shift,
                    self.groups,
                    self.epsilon,
                ))
            }
        }
    }

    /// Scale and shift of each channel where the statistics are stored.
    fn frozen(&self) -> Option<[Tensor<B, 1>; 2]> {
        let (mean, variance) = (
            self.running_mean.as_ref()?.val(),
            self.running_var.as_ref()?.val(),
        );
        let scale = self.weight.val() / (variance + self.epsilon).sqrt();
        let shift = self.bias.val() - mean * scale.clone();
        Some([scale, shift])
    }
}

fn per_channel<B: Backend>(values: Tensor<B, 1>) -> Tensor<B, 4> {
    let channels = values.dims()[0];
    values.reshape([1, channels, 1, 1])
}

/// Moves a normalisation over stored statistics into the convolution before it.
pub fn fold<B: ModelBackend>(conv: &mut Conv<B>, norm: &mut Option<Norm<B>>) {
    let Some([scale, shift]) = norm.as_ref().and_then(Norm::frozen) else {
        return;
    };
    let outputs = scale.dims()[0];
    let bias = match &conv.bias {
        Some(bias) => bias.val() * scale.clone() + shift,
        None => shift,
    };
    conv.weight = Param::from_tensor(conv.weight.val() * scale.reshape([outputs, 1, 1, 1]));
    conv.bias = Some(Param::from_tensor(bias));
    *norm = None;
}

/// A convolution and perhaps a normalisation.
#[derive(Module, Debug)]
pub struct ConvBlock<B: Backend> {
    pub conv: Conv<B>,
    pub norm: Option<Norm<B>>,
}

impl<B: ModelBackend> ConvBlock<B> {
    /// A convolution of stride 1 with a bias, or with a normalisation instead.
    pub fn new(
        init: &mut Init<B>,
        channels: [usize; 2],
        size: usize,
        spread: Spread,
        norm: Option<NormConfig>,
    ) -> Self {
        Self {
            conv: Conv::new(init, channels, size, 1, spread, norm.is_none()),
            norm: norm.map(|norm| Norm::new(init, norm, channels[1], 1.0)),
        }
    }

    pub fn forward(&self, x: Tensor<B, 4>) -> Tensor<B, 4> {
        normalised(&self.conv, &self.norm, x)
    }

    /// Prepares the weights for inference, which is then faster; they must not change afterwards.
    pub fn prepare(&mut self) {
        self.conv.prepare();
    }
}

/// A convolution, then its normalisation where it has one.
pub fn normalised<B: ModelBackend>(conv: &Conv<B>, norm: &Option<Norm<B>>, x: Tensor<B, 4>) -> Tensor<B, 4> {
    let x = conv.forward(x);
    match norm {
        Some(norm) => norm.forward(x),
        None => x,
    }
}
