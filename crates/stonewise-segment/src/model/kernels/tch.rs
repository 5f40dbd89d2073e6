//! The operations on libtorch.

use super::{ModelBackend, SparseMatrix, float, primitive, sparse_product};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::{Autodiff, LibTorch};
use burn::tensor::ops::FloatTensor;
use std::sync::Arc;

impl ModelBackend for LibTorch {
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self> {
        primitive(sparse_product::gathered::<Self>(matrix, float(dense)))
    }
}

impl<C: CheckpointStrategy> ModelBackend for Autodiff<LibTorch, C> {
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self> {
        sparse_product::tracked::<_, C>(matrix, dense)
    }
}
