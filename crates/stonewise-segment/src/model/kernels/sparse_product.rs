//! How a sparse product is differentiated.

use super::{ModelBackend, SparseMatrix};
use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::tensor::ops::FloatTensor;
use std::sync::Arc;

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
