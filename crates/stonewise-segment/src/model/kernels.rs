//! Operations that burn lacks, for every backend that runs the model.

use super::sparse::SparseMatrix;
use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::ops::FloatTensor;
use std::sync::Arc;

/// A backend that can run the model.
pub trait ModelBackend: Backend {
    /// The product of a sparse matrix, rows x columns, and a dense one, columns x channels.
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// A backend that can train the model.
pub trait TrainBackend: ModelBackend + AutodiffBackend<InnerBackend: ModelBackend> {}

impl<B: ModelBackend + AutodiffBackend<InnerBackend: ModelBackend>> TrainBackend for B {}

/// The derivative of a sparse product is the product with the transposed matrix.
#[derive(Debug)]
struct SparseProduct;

impl<B: ModelBackend> Backward<B, 1> for SparseProduct {
    type State = Arc<SparseMatrix>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let matrix = ops.state;
        unary::<B, _>(ops.parents, ops.node, grads, |grad| {
            B::sparse_product(&Arc::new(matrix.transposed()), grad)
        });
    }
}

impl<B: ModelBackend, C: CheckpointStrategy> ModelBackend for Autodiff<B, C> {
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self> {
        let node = dense.node.clone();
        let product = B::sparse_product(matrix, dense.primitive);
        match SparseProduct.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish(matrix.clone(), product),
            OpsKind::UnTracked(prepared) => prepared.finish(product),
        }
    }
}

#[cfg(feature = "flex")]
mod flex {
    use super::{ModelBackend, SparseMatrix};
    use burn::backend::Flex;
    use burn::tensor::TensorData;
    use burn_flex::FlexTensor;
    use rayon::prelude::*;
    use std::sync::Arc;

    impl ModelBackend for Flex {
        fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FlexTensor) -> FlexTensor {
            let dense = dense.to_contiguous();
            let channels = dense.layout().shape()[1];
            let values: &[f32] = dense.storage();
            let mut product = vec![0.0f32; matrix.rows() * channels];
            product
                .par_chunks_mut(channels.max(1))
                .with_min_len(64)
                .enumerate()
                .for_each(|(row, sums)| {
                    for &(column, weight) in matrix.row(row) {
                        let start = column as usize * channels;
                        let source = &values[start..start + channels];
                        for (sum, value) in sums.iter_mut().zip(source) {
                            *sum += weight * value;
                        }
                    }
                });
            FlexTensor::from_data(TensorData::new(product, [matrix.rows(), channels]))
        }
    }
}

#[cfg(feature = "tch")]
mod tch {
    use super::{ModelBackend, SparseMatrix};
    use burn::backend::LibTorch;
    use burn::tensor::backend::Backend;
    use burn::tensor::ops::FloatTensor;
    use burn::tensor::{Int, Tensor, TensorData, TensorPrimitive};
    use std::sync::Arc;

    /// Entries gathered at a time: 256 MB at 256 channels.
    const ENTRIES_AT_ONCE: usize = 1 << 18;

    impl ModelBackend for LibTorch {
        fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self> {
            gather_product::<Self>(matrix, Tensor::from_primitive(TensorPrimitive::Float(dense)))
                .into_primitive()
                .tensor()
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
            product = product.select_assign(0, rows, gathered, burn::tensor::IndexingUpdateOp::Add);
        }
        product
    }
}
