//! The operations on libtorch.

use super::{ModelBackend, SparseMatrix, float, primitive, sparse_product};
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::{Autodiff, LibTorch};
use burn::tensor::backend::Backend;
use burn::tensor::ops::FloatTensor;
use burn::tensor::{IndexingUpdateOp, Int, Tensor, TensorData};
use std::sync::Arc;

/// Entries gathered at a time: 256 MB at 256 channels.
const ENTRIES_AT_ONCE: usize = 1 << 18;

impl ModelBackend for LibTorch {
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self> {
        primitive(gather_product::<Self>(matrix, float(dense)))
    }
}

impl<C: CheckpointStrategy> ModelBackend for Autodiff<LibTorch, C> {
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self> {
        sparse_product::tracked::<_, C>(matrix, dense)
    }
}

/// The product out of gathered rows, for a backend without an operation of its own.
fn gather_product<B: Backend>(matrix: &SparseMatrix, dense: Tensor<B, 2>) -> Tensor<B, 2> {
    let device = dense.device();
    let [_, channels] = dense.dims();
    let mut product = Tensor::zeros([matrix.rows(), channels], &device);
    let entries: Vec<(usize, u32, f32)> = (0..matrix.rows())
        .flat_map(|row| {
            matrix
                .row(row)
                .iter()
                .map(move |&(column, value)| (row, column, value))
        })
        .collect();
    for chunk in entries.chunks(ENTRIES_AT_ONCE) {
        let indices = |of: fn(&(usize, u32, f32)) -> i32| {
            let indices: Vec<i32> = chunk.iter().map(of).collect();
            Tensor::<B, 1, Int>::from_data(TensorData::new(indices, [chunk.len()]), &device)
        };
        let weights: Vec<f32> = chunk.iter().map(|entry| entry.2).collect();
        let weights = Tensor::<B, 2>::from_data(TensorData::new(weights, [chunk.len(), 1]), &device);
        let gathered = dense.clone().select(0, indices(|entry| entry.1 as i32)) * weights;
        let rows = indices(|entry| entry.0 as i32);
        product = product.select_assign(0, rows, gathered, IndexingUpdateOp::Add);
    }
    product
}
