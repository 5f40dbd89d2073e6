//! The operations on burn's pure-Rust backend, and how they are differentiated there.

use super::convolution::{Geometry, backward, channel_sums, forward};
use super::{Filters, ModelBackend, SparseMatrix, group_norm, pool, sparse_product, winograd};
use burn::backend::autodiff::NodeId;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::{Autodiff, Flex};
use burn::tensor::backend::AutodiffBackend;
use burn::tensor::ops::FloatTensor;
use burn::tensor::{Shape, TensorData};
use burn_flex::FlexTensor;
use pulp::Arch;
use rayon::prelude::*;
use std::sync::Arc;

/// Rows of a sparse product that one thread takes at a time.
const ROWS_AT_ONCE: usize = 64;
/// Side of the blocks in which a matrix is transposed: what lies in it stays in the first-level cache.
const BLOCK_SIDE: usize = 16;

impl ModelBackend for Flex {
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FlexTensor) -> FlexTensor {
        let dense = dense.to_contiguous();
        let channels = dense.layout().shape()[1];
        let values: &[f32] = dense.storage();
        let mut product = vec![0.0f32; matrix.rows() * channels];
        let rows = product
            .par_chunks_mut(channels.max(1))
            .with_min_len(ROWS_AT_ONCE)
            .enumerate();
        let arch = Arch::new();
        rows.for_each(|(row, sums)| {
            arch.dispatch(
                #[inline(always)]
                || {
                    for &(column, weight) in matrix.row(row) {
                        let source = &values[column as usize * channels..][..channels];
                        for (sum, value) in sums.iter_mut().zip(source) {
                            *sum += weight * value;
                        }
                    }
                },
            );
        });
        tensor(product, [matrix.rows(), channels])
    }

    fn convolve(x: FlexTensor, weight: FlexTensor, bias: Option<FlexTensor>, stride: usize) -> FlexTensor {
        let geometry = geometry(&x, &weight, stride);
        let (x, weight) = (x.to_contiguous(), weight.to_contiguous());
        let bias = bias.map(|bias| bias.to_contiguous());
        let bias = bias.as_ref().map(FlexTensor::storage);
        tensor(
            forward(x.storage(), weight.storage(), bias, &geometry),
            geometry.output_shape(),
        )
    }

    fn filters(weight: FlexTensor, stride: usize) -> Option<Filters> {
        let weight = weight.to_contiguous();
        let is_fast = stride == 1 && weight.layout().shape()[2] == 3;
        is_fast.then(|| Filters::new(weight.storage()))
    }

    fn convolve_filtered(
        x: FlexTensor,
        (weight, filters): (FlexTensor, &Filters),
        bias: Option<FlexTensor>,
    ) -> FlexTensor {
        let geometry = geometry(&x, &weight, 1);
        let x = x.to_contiguous();
        let bias = bias.map(|bias| bias.to_contiguous());
        let bias = bias.as_ref().map(FlexTensor::storage);
        let y = winograd::forward(x.storage(), filters, bias, &geometry);
        tensor(y, geometry.output_shape())
    }

    fn halved(x: FlexTensor) -> FlexTensor {
        let x = x.to_contiguous();
        let shape = x.layout().shape();
        let [rows, columns] = [shape[2], shape[3]];
        let y = pool::halve(x.storage(), [rows, columns]);
        tensor(y, [shape[0], shape[1], rows.div_ceil(2), columns.div_ceil(2)])
    }

    fn exchanged(x: FlexTensor) -> FlexTensor {
        let x = x.to_contiguous();
        let shape = x.layout().shape();
        let [batch, rows, columns] = [shape[0], shape[1], shape[2]];
        let values: &[f32] = x.storage();
        let mut y = vec![0.0f32; values.len()];
        let size = (rows * columns).max(1);
        let images = y.par_chunks_mut(size).zip(values.par_chunks(size));
        images.for_each(|(y, x)| exchange(x, y, [rows, columns]));
        tensor(y, [batch, columns, rows])
    }

    fn group_norm(
        x: FlexTensor,
        scale: FlexTensor,
        shift: FlexTensor,
        groups: usize,
        epsilon: f64,
    ) -> FlexTensor {
        normalise(&x, &scale, &shift, groups, epsilon).0
    }
}

impl<C: CheckpointStrategy> ModelBackend for Autodiff<Flex, C> {
    fn sparse_product(matrix: &Arc<SparseMatrix>, dense: FloatTensor<Self>) -> FloatTensor<Self> {
        sparse_product::tracked::<_, C>(matrix, dense)
    }

    fn convolve(
        x: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: Option<FloatTensor<Self>>,
        stride: usize,
    ) -> FloatTensor<Self> {
        let outputs = weight.primitive.layout().shape()[0];
        let none = || Self::from_inner(tensor(vec![0.0; outputs], [outputs]));
        let bias = bias.unwrap_or_else(none);
        let nodes = [x.node.clone(), weight.node.clone(), bias.node.clone()];
        let y = Flex::convolve(
            x.primitive.clone(),
            weight.primitive.clone(),
            Some(bias.primitive),
            stride,
        );
        match Convolve.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(mut prepared) => {
                let state = (prepared.checkpoint(&x), prepared.checkpoint(&weight), stride);
                prepared.finish(state, y)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }

    fn group_norm(
        x: FloatTensor<Self>,
        scale: FloatTensor<Self>,
        shift: FloatTensor<Self>,
        groups: usize,
        epsilon: f64,
    ) -> FloatTensor<Self> {
        let nodes = [x.node.clone(), scale.node.clone(), shift.node.clone()];
        let (y, moments) = normalise(&x.primitive, &scale.primitive, &shift.primitive, groups, epsilon);
        match GroupNorm.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(mut prepared) => {
                let state = (
                    prepared.checkpoint(&x),
                    prepared.checkpoint(&scale),
                    Arc::new(moments),
                );
                prepared.finish(state, y)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }
}

/// Derivative of a convolution with regard to image, weight and bias.
#[derive(Debug)]
struct Convolve;

impl Backward<Flex, 3> for Convolve {
    /// Image, weight, stride.
    type State = (NodeId, NodeId, usize);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, checkpointer: &mut Checkpointer) {
        let (x, weight, stride) = ops.state;
        let x: FlexTensor = checkpointer.retrieve_node_output(x);
        let weight: FlexTensor = checkpointer.retrieve_node_output(weight);
        let grad = grads.consume::<Flex>(&ops.node).to_contiguous();
        let geometry = geometry(&x, &weight, stride);
        let [x_node, weight_node, bias_node] = ops.parents;
        let wanted = [x_node.is_some(), weight_node.is_some()];
        let (x, weight) = (x.to_contiguous(), weight.to_contiguous());
        let [x_grad, weight_grad] =
            backward(x.storage(), weight.storage(), grad.storage(), &geometry, wanted);
        if let Some(node) = x_node {
            grads.register::<Flex>(node.id, tensor(x_grad, geometry.input_shape()));
        }
        if let Some(node) = weight_node {
            grads.register::<Flex>(node.id, tensor(weight_grad, geometry.weight_shape()));
        }
        if let Some(node) = bias_node {
            let sums = channel_sums(grad.storage(), &geometry);
            grads.register::<Flex>(node.id, tensor(sums, [geometry.outputs]));
        }
    }
}

/// Derivative of group normalisation with regard to image, scale and shift.
#[derive(Debug)]
struct GroupNorm;

impl Backward<Flex, 3> for GroupNorm {
    /// Image, scale, moments of the groups.
    type State = (NodeId, NodeId, Arc<Vec<group_norm::Moments>>);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, checkpointer: &mut Checkpointer) {
        let (x, scale, moments) = ops.state;
        let x: FlexTensor = checkpointer.retrieve_node_output(x);
        let scale: FlexTensor = checkpointer.retrieve_node_output(scale);
        let grad = grads.consume::<Flex>(&ops.node).to_contiguous();
        let (x, scale) = (x.to_contiguous(), scale.to_contiguous());
        let shape = x.layout().shape().clone();
        let channels = shape[1];
        let [x_grad, scale_grad, shift_grad] =
            group_norm::backward(x.storage(), scale.storage(), grad.storage(), &moments, shape[0]);
        let [x_node, scale_node, shift_node] = ops.parents;
        if let Some(node) = x_node {
            grads.register::<Flex>(node.id, tensor(x_grad, shape));
        }
        if let Some(node) = scale_node {
            grads.register::<Flex>(node.id, tensor(scale_grad, [channels]));
        }
        if let Some(node) = shift_node {
            grads.register::<Flex>(node.id, tensor(shift_grad, [channels]));
        }
    }
}

/// Writes the transpose of a matrix of rows x columns.
fn exchange(x: &[f32], y: &mut [f32], [rows, columns]: [usize; 2]) {
    for first_row in (0..rows).step_by(BLOCK_SIDE) {
        let some_rows = BLOCK_SIDE.min(rows - first_row);
        for first_column in (0..columns).step_by(BLOCK_SIDE) {
            let some_columns = BLOCK_SIDE.min(columns - first_column);
            for column in first_column..first_column + some_columns {
                let target = &mut y[column * rows + first_row..][..some_rows];
                let source = x[first_row * columns + column..].iter().step_by(columns);
                target.iter_mut().zip(source).for_each(|(to, from)| *to = *from);
            }
        }
    }
}

fn normalise(
    x: &FlexTensor,
    scale: &FlexTensor,
    shift: &FlexTensor,
    groups: usize,
    epsilon: f64,
) -> (FlexTensor, Vec<group_norm::Moments>) {
    let [x, scale, shift] = [x, scale, shift].map(FlexTensor::to_contiguous);
    let shape = x.layout().shape().clone();
    let affine = (scale.storage(), shift.storage());
    let (y, moments) = group_norm::forward(x.storage(), affine, shape[0], groups, epsilon as f32);
    (tensor(y, shape), moments)
}

fn geometry(x: &FlexTensor, weight: &FlexTensor, stride: usize) -> Geometry {
    let (x, weight) = (x.layout().shape(), weight.layout().shape());
    Geometry {
        batch: x[0],
        inputs: x[1],
        rows: x[2],
        columns: x[3],
        outputs: weight[0],
        size: weight[2],
        stride,
    }
}

fn tensor(values: Vec<f32>, shape: impl Into<Shape>) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape.into()))
}

#[cfg(test)]
mod tests {
    use super::super::{float, primitive};
    use super::*;
    use burn::tensor::Tensor;
    use burn::tensor::module::max_pool2d;

    #[test]
    fn the_largest_neighbours_are_those_of_burn() {
        for [batch, channels, rows, columns] in [[1, 1, 1, 1], [2, 3, 6, 8], [1, 2, 7, 33], [1, 1, 2, 5]] {
            let count = batch * channels * rows * columns;
            let values: Vec<f32> = (0..count).map(|i| (i as f32 * 1.7).sin()).collect();
            let x = Tensor::<Flex, 4>::from_data(
                TensorData::new(values, [batch, channels, rows, columns]),
                &Default::default(),
            );
            let own = float::<Flex, 4>(Flex::halved(primitive(x.clone())));
            let theirs = max_pool2d(x, [3; 2], [2; 2], [1; 2], [1; 2], false);
            assert_eq!(own.into_data(), theirs.into_data());
        }
    }

    #[test]
    fn exchanging_rows_and_columns_agrees_with_burn() {
        for [batch, rows, columns] in [[1, 1, 1], [2, 16, 33], [3, 49, 20]] {
            let count = batch * rows * columns;
            let values: Vec<f32> = (0..count).map(|i| i as f32).collect();
            let x = Tensor::<Flex, 3>::from_data(
                TensorData::new(values, [batch, rows, columns]),
                &Default::default(),
            );
            let own = float::<Flex, 3>(Flex::exchanged(primitive(x.clone())));
            assert_eq!(own.into_data(), x.swap_dims(1, 2).into_data());
        }
    }
}
