//! Sparse products out of burn's own operations, and how they are differentiated.

use super::{ModelBackend, SparseMatrix};
use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::tensor::ops::FloatTensor;
#[cfg(any(feature = "tch", test))]
use burn::tensor::{IndexingUpdateOp, Int, Tensor, TensorData, backend::Backend};
use std::sync::Arc;

/// Entries gathered at a time: 256 MB at 256 channels.
#[cfg(any(feature = "tch", test))]
const ENTRIES_AT_ONCE: usize = 1 << 18;

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

/// A sparse product that can be differentiated with regard to the dense matrix.
pub fn tracked<B: ModelBackend, C: CheckpointStrategy>(
    matrix: &Arc<SparseMatrix>,
    dense: FloatTensor<Autodiff<B, C>>,
) -> FloatTensor<Autodiff<B, C>> {
    let node = dense.node.clone();
    let product = B::sparse_product(matrix, dense.primitive);
    match SparseProduct.prepare::<C>([node]).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => prepared.finish(matrix.clone(), product),
        OpsKind::UnTracked(prepared) => prepared.finish(product),
    }
}

/// The product out of gathered rows, for a backend without an operation of its own.
#[cfg(any(feature = "tch", test))]
pub fn gathered<B: Backend>(matrix: &SparseMatrix, dense: Tensor<B, 2>) -> Tensor<B, 2> {
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

#[cfg(test)]
mod tests {
    use super::super::{float, primitive};
    use super::*;
    use burn::backend::Flex;

    #[test]
    fn both_products_agree_with_the_definition() {
        let mut matrix = SparseMatrix::new(5);
        for row in 0..7u32 {
            // Rows of 0 to 3 entries, one column twice.
            let entries = (0..row % 4).map(|i| ((row * 3 + i * i) % 5, 0.5 + i as f32 - row as f32));
            matrix.push_row(entries.chain((row == 6).then_some((2, 0.25))));
        }
        let values: Vec<f32> = (0..15).map(|i| (i as f32 * 0.7).sin()).collect();
        let mut expected = vec![0.0f32; 7 * 3];
        for row in 0..7 {
            for &(column, weight) in matrix.row(row) {
                for channel in 0..3 {
                    expected[row * 3 + channel] += weight * values[column as usize * 3 + channel];
                }
            }
        }
        let dense = Tensor::<Flex, 2>::from_data(TensorData::new(values, [5, 3]), &Default::default());
        let own = float::<Flex, 2>(Flex::sparse_product(
            &Arc::new(matrix.clone()),
            primitive(dense.clone()),
        ));
        for product in [own, gathered(&matrix, dense)] {
            let product: Vec<f32> = product.into_data().to_vec().unwrap();
            assert!(
                product.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5),
                "{product:?}"
            );
        }
    }
}
