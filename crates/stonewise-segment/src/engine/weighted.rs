//! Operations with weights.

use super::kernels::convolution::{self, Geometry};
use super::kernels::depthwise::{self, Depthwise};
use super::kernels::product::product;
use super::kernels::{Filters, group_norm, sparse_product, winograd};
use super::sparse::SparseMatrix;
use super::tensor::Tensor;
use faer::MatRef;

impl Tensor {
    /// Convolution of [batch, in, rows, columns] with [out, in, size, size], odd size, padded by half of it
    /// with zeros, plus a bias for each output.
    pub fn convolved(&self, weight: &Self, bias: Option<&Self>, stride: usize) -> Self {
        self.convolved_as(weight, bias, geometry(self, weight, stride))
    }

    /// As [`Tensor::convolved`], with the padding that TensorFlow calls `SAME`: an odd row or column of zeros lies
    /// below or right.
    pub fn convolved_same(&self, weight: &Self, bias: Option<&Self>, stride: usize) -> Self {
        let geometry = Geometry {
            is_same: true,
            ..geometry(self, weight, stride)
        };
        self.convolved_as(weight, bias, geometry)
    }

    fn convolved_as(&self, weight: &Self, bias: Option<&Self>, geometry: Geometry) -> Self {
        let y = convolution::forward(self.values(), weight.values(), bias.map(Self::values), &geometry);
        let nodes = [self.node(), weight.node(), bias.and_then(Self::node)];
        let (x, weight) = (self.shared(), weight.shared());
        Self::derived(geometry.output_shape(), y, &nodes, move |grad, wanted| {
            let [x_grad, weight_grad] =
                convolution::backward(&x, &weight, &grad, &geometry, [wanted[0], wanted[1]]);
            let bias_grad = if wanted[2] {
                convolution::channel_sums(&grad, &geometry)
            } else {
                Vec::new()
            };
            vec![x_grad, weight_grad, bias_grad]
        })
    }

    /// Convolution with 3 x 3 weights and stride 1, given in both forms, which is faster; not recorded.
    pub fn filtered(&self, weight: &Self, filters: &Filters, bias: Option<&Self>) -> Self {
        let geometry = geometry(self, weight, 1);
        let y = winograd::forward(self.values(), filters, bias.map(Self::values), &geometry);
        Self::new(geometry.output_shape(), y)
    }

    /// ReLU6, depthwise convolution with weights [channels, 1, size, size], odd size, and padding `SAME`, plus a bias
    /// for each channel, ReLU6; not recorded.
    pub fn depthwise_between_relu6(&self, weight: &Self, bias: &Self, stride: usize) -> Self {
        let [batch, channels, rows, columns] = self.dims();
        let shape = Depthwise {
            channels,
            rows,
            columns,
            size: weight.dims::<3>()[2],
            stride,
        };
        let y = depthwise::forward(self.values(), weight.values(), bias.values(), &shape);
        let [rows, columns] = shape.output_size();
        Self::new([batch, channels, rows, columns], y)
    }

    /// The product of [items, in] with weights [out, in], plus a bias for each output: [items, out].
    pub fn linear(&self, weight: &Self, bias: &Self) -> Self {
        let items = self.dims::<1>()[0];
        let outputs = weight.dims::<1>()[0];
        let of_weight = matrix(weight.values(), outputs);
        let mut y = product(matrix(self.values(), items), of_weight.transpose());
        for y in y.chunks_mut(outputs.max(1)) {
            y.iter_mut().zip(bias.values()).for_each(|(y, bias)| *y += bias);
        }
        let nodes = [self.node(), weight.node(), bias.node()];
        let (x, weight) = (self.shared(), weight.shared());
        Self::derived([items, outputs], y, &nodes, move |grad, wanted| {
            let of_grad = matrix(&grad, items);
            let wanted_product = |is_wanted: bool, a, b| if is_wanted { product(a, b) } else { Vec::new() };
            let x_grad = wanted_product(wanted[0], of_grad, matrix(&weight, outputs));
            let weight_grad = wanted_product(wanted[1], of_grad.transpose(), matrix(&x, items));
            let mut bias_grad = vec![0.0f32; outputs];
            for grad in grad.chunks(outputs.max(1)) {
                bias_grad
                    .iter_mut()
                    .zip(grad)
                    .for_each(|(sum, grad)| *sum += grad);
            }
            vec![x_grad, weight_grad, bias_grad]
        })
    }

    /// Group normalisation (Wu & He 2018) of [batch, channels, rows, columns], then a scale and a shift of
    /// each channel.
    pub fn group_normalised(&self, scale: &Self, shift: &Self, groups: usize, epsilon: f32) -> Self {
        let batch = self.dims::<1>()[0];
        let affine = (scale.values(), shift.values());
        let (y, moments) = group_norm::forward(self.values(), affine, batch, groups, epsilon);
        let nodes = [self.node(), scale.node(), shift.node()];
        let (x, scale) = (self.shared(), scale.shared());
        Self::derived(self.shape(), y, &nodes, move |grad, _| {
            group_norm::backward(&x, &scale, &grad, &moments, batch).into()
        })
    }

    /// The product of a sparse matrix, rows x columns, and [columns, channels].
    pub fn gathered(&self, matrix: SparseMatrix) -> Self {
        let channels = self.dims::<2>()[1];
        let y = sparse_product::forward(&matrix, self.values(), channels);
        Self::derived([matrix.rows(), channels], y, &[self.node()], move |grad, _| {
            vec![sparse_product::forward(&matrix.transposed(), &grad, channels)]
        })
    }
}

/// The matrix of this number of rows.
fn matrix(values: &[f32], rows: usize) -> MatRef<'_, f32> {
    MatRef::from_row_major_slice(values, rows, values.len() / rows.max(1))
}

fn geometry(x: &Tensor, weight: &Tensor, stride: usize) -> Geometry {
    let [batch, inputs, rows, columns] = x.dims();
    let [outputs, _, size] = weight.dims();
    Geometry {
        batch,
        inputs,
        rows,
        columns,
        outputs,
        size,
        stride,
        is_same: false,
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_derivatives, wave};
    use super::*;

    #[test]
    fn derivatives_are_differences() {
        let image = wave(&[2, 4, 5, 6], 0.7);
        let [weight, bias] = [wave(&[3, 4, 3, 3], 1.3), wave(&[3], 2.1)];
        assert_derivatives(&[image.clone(), weight.clone(), bias], |x| {
            x[0].convolved(&x[1], Some(&x[2]), 2)
        });
        assert_derivatives(&[weight], |x| image.convolved(&x[0], None, 1));
        assert_derivatives(&[wave(&[5, 4], 0.7), wave(&[3, 4], 1.3), wave(&[3], 2.1)], |x| {
            x[0].linear(&x[1], &x[2])
        });
        assert_derivatives(&[image.clone(), wave(&[4], 1.3), wave(&[4], 2.1)], |x| {
            x[0].group_normalised(&x[1], &x[2], 2, 1e-5)
        });
        let mut matrix = SparseMatrix::new(4);
        matrix.push_row([(3, 1.0), (0, 2.0), (3, 0.5)]);
        matrix.push_row([]);
        matrix.push_row([(0, -1.0)]);
        assert_derivatives(&[wave(&[4, 2], 0.7)], |x| x[0].gathered(matrix.clone()));
    }

    #[test]
    fn a_linear_layer_agrees_with_its_definition() {
        let (x, weight, bias) = (wave(&[70, 33], 0.7), wave(&[5, 33], 1.3), wave(&[5], 2.1));
        let y = x.linear(&weight, &bias);
        for (place, y) in y.values().iter().enumerate() {
            let (item, output) = (place / 5, place % 5);
            let products = (0..33).map(|i| x.values()[item * 33 + i] * weight.values()[output * 33 + i]);
            assert!((products.sum::<f32>() + bias.values()[output] - y).abs() < 1e-4);
        }
    }
}
