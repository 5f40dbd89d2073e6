//! Operations that bring values to other places.

use super::kernels::{exchange::exchange, pool};
use super::tensor::Tensor;

impl Tensor {
    /// Rows and columns exchanged: [batch, rows, columns] to [batch, columns, rows].
    pub fn exchanged(&self) -> Self {
        let [batch, rows, columns] = self.dims();
        let y = exchange(self.values(), [rows, columns]);
        Self::derived([batch, columns, rows], y, &[self.node()], move |grad, _| {
            vec![exchange(&grad, [columns, rows])]
        })
    }

    /// The parts of the first side at these places, in their order; a place may come more than once.
    pub fn selected(&self, places: Vec<usize>) -> Self {
        let mut shape = self.shape().to_vec();
        let count = self.values().len();
        let width = (count / shape[0].max(1)).max(1);
        shape[0] = places.len();
        let mut y = Vec::with_capacity(places.len() * width);
        for place in &places {
            y.extend_from_slice(&self.values()[place * width..][..width]);
        }
        Self::derived(shape, y, &[self.node()], move |grad, _| {
            let mut sums = vec![0.0f32; count];
            for (place, grad) in places.into_iter().zip(grad.chunks(width)) {
                let sums = &mut sums[place * width..][..width];
                sums.iter_mut().zip(grad).for_each(|(sum, grad)| *sum += grad);
            }
            vec![sums]
        })
    }

    /// Tensors [batch, values] one after the other in each image of the batch.
    pub fn joined(parts: &[Self]) -> Self {
        let batch = parts.first().map_or(0, |part| part.shape()[0]);
        let widths: Vec<usize> = parts.iter().map(|part| part.dims::<2>()[1]).collect();
        let total: usize = widths.iter().sum();
        let mut y = Vec::with_capacity(batch * total);
        for image in 0..batch {
            for (part, width) in parts.iter().zip(&widths) {
                y.extend_from_slice(&part.values()[image * width..][..*width]);
            }
        }
        let nodes: Vec<_> = parts.iter().map(Self::node).collect();
        Self::derived([batch, total], y, &nodes, move |grad, _| {
            let mut grads: Vec<Vec<f32>> = widths
                .iter()
                .map(|width| Vec::with_capacity(batch * width))
                .collect();
            let mut rest = &grad[..];
            for _ in 0..batch {
                for (part, width) in grads.iter_mut().zip(&widths) {
                    let (of_part, after) = rest.split_at(*width);
                    part.extend_from_slice(of_part);
                    rest = after;
                }
            }
            grads
        })
    }

    /// The sum with an image [batch, channels, rows, columns] of half the size, each of whose pixels counts for
    /// two by two.
    #[must_use]
    pub fn plus_doubled(self, half: &Self) -> Self {
        let (shape, nodes) = (self.shape().to_vec(), [self.node(), half.node()]);
        let columns = half.dims::<4>()[3].max(1);
        let mut values = self.into_values();
        let pairs = values.chunks_mut(4 * columns).zip(half.values().chunks(columns));
        for (pair, half) in pairs {
            for line in pair.chunks_mut(2 * columns) {
                for (two, half) in line.as_chunks_mut::<2>().0.iter_mut().zip(half) {
                    two[0] += half;
                    two[1] += half;
                }
            }
        }
        Self::derived(shape, values, &nodes, move |grad, _| {
            let mut sums = vec![0.0f32; grad.len() / 4];
            for (sums, pair) in sums.chunks_mut(columns).zip(grad.chunks(4 * columns)) {
                for line in pair.chunks(2 * columns) {
                    let twos = line.as_chunks::<2>().0;
                    sums.iter_mut()
                        .zip(twos)
                        .for_each(|(sum, two)| *sum += two[0] + two[1]);
                }
            }
            vec![grad, sums]
        })
    }

    /// Max pooling over 3 x 3 pixels with stride 2 and a border of 1: [batch, channels, rows, columns] to
    /// [batch, channels, rows / 2, columns / 2], rounded up.
    pub fn halved(&self) -> Self {
        let [batch, channels, rows, columns] = self.dims();
        let y = pool::halve(self.values(), [rows, columns]);
        let x = self.shared();
        let shape = [batch, channels, rows.div_ceil(2), columns.div_ceil(2)];
        Self::derived(shape, y, &[self.node()], move |grad, _| {
            vec![pool::backward(&x, &grad, [rows, columns])]
        })
    }

    /// Every second pixel of every second row, from the first on; the same shapes as [`Tensor::halved`].
    pub fn every_second(&self) -> Self {
        let [batch, channels, rows, columns] = self.dims();
        let mut places = Vec::new();
        for plane in 0..batch * channels {
            for row in (0..rows).step_by(2) {
                places.extend(
                    (0..columns)
                        .step_by(2)
                        .map(|column| (plane * rows + row) * columns + column),
                );
            }
        }
        let values = self.clone().reshaped([self.values().len()]);
        let shape = [batch, channels, rows.div_ceil(2), columns.div_ceil(2)];
        values.selected(places).reshaped(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_derivatives, wave};
    use super::*;

    fn counted(shape: &[usize]) -> Tensor {
        Tensor::new(
            shape,
            (0..shape.iter().product())
                .map(|i: usize| i as f32)
                .collect::<Vec<_>>(),
        )
    }

    #[test]
    fn values_come_to_their_places() {
        assert_eq!(
            counted(&[1, 2, 3]).exchanged().values(),
            [0.0, 3.0, 1.0, 4.0, 2.0, 5.0]
        );
        assert_eq!(
            counted(&[3, 2]).selected(vec![2, 0, 2]).values(),
            [4.0, 5.0, 0.0, 1.0, 4.0, 5.0]
        );
        let joined = Tensor::joined(&[counted(&[2, 1]), counted(&[2, 2])]);
        assert_eq!(joined.values(), [0.0, 0.0, 1.0, 1.0, 2.0, 3.0]);
        let thinned = counted(&[1, 1, 3, 5]).every_second();
        assert_eq!(thinned.shape(), [1, 1, 2, 3]);
        assert_eq!(thinned.values(), [0.0, 2.0, 4.0, 10.0, 12.0, 14.0]);
        let sum = Tensor::new([1, 1, 2, 4], vec![0.0; 8]).plus_doubled(&counted(&[1, 1, 1, 2]));
        assert_eq!(sum.values(), [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn derivatives_are_differences() {
        let image = wave(&[2, 3, 4, 6], 0.7);
        assert_derivatives(&[wave(&[2, 3, 5], 0.7)], |x| x[0].exchanged());
        assert_derivatives(&[wave(&[4, 3], 0.7)], |x| x[0].selected(vec![3, 0, 3, 1]));
        assert_derivatives(&[wave(&[2, 3], 0.7), wave(&[2, 4], 1.9)], Tensor::joined);
        assert_derivatives(&[image.clone(), wave(&[2, 3, 2, 3], 1.9)], |x| {
            x[0].clone().plus_doubled(&x[1])
        });
        for shape in [[2, 3, 4, 6], [1, 2, 5, 3]] {
            // Neighbours differ by more than a step, so that the largest stays the largest.
            let count: usize = shape.iter().product();
            let values: Vec<f32> = (0..count).map(|i| (29 * i % count) as f32 / 20.0).collect();
            assert_derivatives(&[Tensor::new(shape, values)], |x| x[0].halved());
        }
        assert_derivatives(&[image], |x| x[0].every_second());
    }
}
