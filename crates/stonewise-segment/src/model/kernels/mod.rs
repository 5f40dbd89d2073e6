//! The operations that dominate the model, for every backend that runs it.

mod sparse_product;

#[cfg(feature = "flex")]
mod convolution;
#[cfg(feature = "flex")]
mod flex;
#[cfg(feature = "flex")]
mod group_norm;
#[cfg(feature = "flex")]
mod pool;
#[cfg(feature = "tch")]
mod tch;
#[cfg(feature = "flex")]
mod winograd;

mod filters;

use super::sparse::SparseMatrix;
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::ops::{ConvOptions, FloatTensor};
use burn::tensor::{Tensor, TensorPrimitive};
use std::sync::Arc;

pub use filters::Filters;

/// A backend that can run the model.
pub trait ModelBackend: Backend {
    /// The product of a sparse matrix, rows x columns, and a dense one, columns x channels.
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The weights of a convolution in the form that is fastest in use, where the backend has one.
    fn filters(_weight: FloatTensor<Self>, _stride: usize) -> Option<Filters> {
        None
    }

    /// The convolution with weights in both forms.
    fn convolve_filtered(
        x: FloatTensor<Self>,
        (weight, _filters): (FloatTensor<Self>, &Filters),
        bias: Option<FloatTensor<Self>>,
    ) -> FloatTensor<Self> {
        Self::convolve(x, weight, bias, 1)
    }

    /// Max pooling over 3 x 3 pixels with stride 2 and a border of 1: [batch, channels, rows, columns] to
    /// [batch, channels, rows / 2, columns / 2], rounded up.
    fn halved(x: FloatTensor<Self>) -> FloatTensor<Self> {
        let x = float::<Self, 4>(x);
        primitive(burn::tensor::module::max_pool2d(
            x, [3; 2], [2; 2], [1; 2], [1; 2], false,
        ))
    }

    /// Rows and columns exchanged: [batch, rows, columns] to [batch, columns, rows].
    fn exchanged(x: FloatTensor<Self>) -> FloatTensor<Self> {
        primitive(float::<Self, 3>(x).swap_dims(1, 2))
    }

    /// Convolution of [batch, in, rows, columns] with [out, in, size, size], odd size, padded by half of it
    /// with zeros, plus a bias for each output.
    fn convolve(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: Option<FloatTensor<Self>>,
        stride: usize,
    ) -> FloatTensor<Self> {
        let weight = float::<Self, 4>(weight);
        let padding = weight.dims()[2] / 2;
        let options = ConvOptions::new([stride; 2], [padding; 2], [1; 2], 1);
        primitive(burn::tensor::module::conv2d(
            float::<Self, 4>(x),
            weight,
            bias.map(float::<Self, 1>),
            options,
        ))
    }

    /// Group normalisation (Wu & He 2018) of [batch, channels, rows, columns], then a scale and a shift of
    /// each channel.
    fn group_norm(
        x: FloatTensor<Self>,
        scale: FloatTensor<Self>,
        shift: FloatTensor<Self>,
        groups: usize,
        epsilon: f64,
    ) -> FloatTensor<Self> {
        let x = float::<Self, 4>(x);
        let [batch, channels, rows, columns] = x.dims();
        let x = x.reshape([batch, groups, channels / groups * rows * columns]);
        let x = x.clone() - x.mean_dim(2);
        let variance = x.clone().square().mean_dim(2);
        let x = (x / (variance + epsilon).sqrt()).reshape([batch, channels, rows, columns]);
        let per_channel = |values| float::<Self, 1>(values).reshape([1, channels, 1, 1]);
        primitive(x * per_channel(scale) + per_channel(shift))
    }
}

/// A backend that can train the model.
pub trait TrainBackend: ModelBackend + AutodiffBackend<InnerBackend: ModelBackend> {}

impl<B: ModelBackend + AutodiffBackend<InnerBackend: ModelBackend>> TrainBackend for B {}

/// The tensor around a backend's own.
pub fn float<B: Backend, const D: usize>(tensor: FloatTensor<B>) -> Tensor<B, D> {
    Tensor::from_primitive(TensorPrimitive::Float(tensor))
}

/// The backend's own tensor.
pub fn primitive<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> FloatTensor<B> {
    tensor.into_primitive().tensor()
}
