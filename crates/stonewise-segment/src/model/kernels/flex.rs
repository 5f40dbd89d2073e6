//! The operations on burn's pure-Rust backend, and how they are differentiated there.

use super::convolution::{Geometry, backward, channel_sums, forward};
use super::{ModelBackend, SparseMatrix, group_norm, sparse_product};
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
use rayon::prelude::*;
use std::sync::Arc;

/// Rows of a sparse product that one thread takes at a time.
const ROWS_AT_ONCE: usize = 64;

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
        rows.for_each(|(row, sums)| {
            for &(column, weight) in matrix.row(row) {
                let source = &values[column as usize * channels..][..channels];
                for (sum, value) in sums.iter_mut().zip(source) {
                    *sum += weight * value;
                }
            }
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
