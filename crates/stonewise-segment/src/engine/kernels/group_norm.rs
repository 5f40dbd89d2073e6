//! Group normalisation (Wu & He 2018) on slices: batch, channel, pixel.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Partial sums that are kept side by side, so that they can be added at once.
const LANES: usize = 16;

/// Mean and inverse standard deviation of a group of channels of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    mean: f32,
    inverse_std: f32,
}

/// Normalised values, times the scale of their channel plus its shift, and the moments of the groups, image
/// by image.
pub fn forward(
    x: &[f32],
    (scale, shift): (&[f32], &[f32]),
    batch: usize,
    groups: usize,
    epsilon: f32,
) -> (Vec<f32>, Vec<Moments>) {
    let channels = scale.len();
    let per_group = channels / groups;
    let group_size = x.len() / (batch * groups).max(1);
    let pixels = group_size / per_group.max(1);
    let mut y = vec![0.0f32; x.len()];
    let arch = Arch::new();

    let normalise = |(place, (x, y)): (usize, (&[f32], &mut [f32]))| {
        let first = place % groups * per_group;
        arch.dispatch(Group {
            x,
            y,
            pixels,
            scale: &scale[first..],
            shift: &shift[first..],
            epsilon,
        })
    };

    let parts = x
        .par_chunks(group_size.max(1))
        .zip(y.par_chunks_mut(group_size.max(1)));
    let moments = parts.enumerate().map(normalise).collect();
    (y, moments)
}

/// A group of channels to normalise. The loops are compiled for the widest vectors of the processor.
struct Group<'a> {
    x: &'a [f32],
    y: &'a mut [f32],
    /// Pixels of a channel.
    pixels: usize,
    /// Of each channel, those of the group first.
    scale: &'a [f32],
    shift: &'a [f32],
    epsilon: f32,
}

impl WithSimd for Group<'_> {
    type Output = Moments;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Moments {
        let moments = moments(self.x, self.epsilon);
        let planes = self.x.chunks(self.pixels).zip(self.y.chunks_mut(self.pixels));
        for ((x, y), (scale, shift)) in planes.zip(self.scale.iter().zip(self.shift)) {
            let scale = scale * moments.inverse_std;
            let shift = shift - moments.mean * scale;
            for (y, x) in y.iter_mut().zip(x) {
                *y = x * scale + shift;
            }
        }
        moments
    }
}

/// Derivatives with regard to values, scale and shift, from that with regard to the result.
pub fn backward(x: &[f32], scale: &[f32], grad: &[f32], moments: &[Moments], batch: usize) -> [Vec<f32>; 3] {
    let groups = moments.len() / batch.max(1);
    let channels = scale.len();
    let per_group = channels / groups.max(1);
    let group_size = x.len() / moments.len().max(1);
    let pixels = group_size / per_group.max(1);
    let mut x_grad = vec![0.0f32; x.len()];

    let differentiate = |(place, (x_grad, moments)): (usize, (&mut [f32], &Moments))| {
        let x = &x[place * group_size..][..group_size];
        let grad = &grad[place * group_size..][..group_size];
        let first = place % groups * per_group;
        let planes = || x.chunks(pixels).zip(grad.chunks(pixels));
        // Of each channel: sum of the derivatives, and of their products with the normalised values.
        let sums: Vec<[f32; 2]> = planes()
            .map(|(x, grad)| {
                let [total, product] = sum_with_product(grad, x);
                [total, (product - moments.mean * total) * moments.inverse_std]
            })
            .collect();
        let over_group = |of: usize| -> f32 {
            let weighted = sums
                .iter()
                .zip(&scale[first..])
                .map(|(sums, scale)| sums[of] * scale);
            weighted.sum::<f32>() / group_size as f32
        };
        let (mean, slope) = (over_group(0), over_group(1));
        for (channel, ((x, grad), x_grad)) in planes().zip(x_grad.chunks_mut(pixels)).enumerate() {
            let inverse = moments.inverse_std;
            let of_grad = scale[first + channel] * inverse;
            let of_x = -slope * inverse * inverse;
            let constant = -mean * inverse - moments.mean * of_x;
            for ((x_grad, x), grad) in x_grad.iter_mut().zip(x).zip(grad) {
                *x_grad = grad * of_grad + x * of_x + constant;
            }
        }
        sums
    };

    let parts = x_grad.par_chunks_mut(group_size.max(1)).zip(moments);
    let sums: Vec<Vec<[f32; 2]>> = parts.enumerate().map(differentiate).collect();
    let (mut scale_grad, mut shift_grad) = (vec![0.0f32; channels], vec![0.0f32; channels]);

    for (plane, [total, product]) in sums.into_iter().flatten().enumerate() {
        shift_grad[plane % channels] += total;
        scale_grad[plane % channels] += product;
    }

    [x_grad, scale_grad, shift_grad]
}

#[inline(always)]
fn moments(x: &[f32], epsilon: f32) -> Moments {
    let count = x.len() as f32;
    let mean = sum_with_product(x, &[])[0] / count;
    let mut squares = [0.0f32; LANES];
    let (blocks, rest) = x.as_chunks::<LANES>();
    for block in blocks {
        for (sum, x) in squares.iter_mut().zip(block) {
            *sum += (x - mean) * (x - mean);
        }
    }
    let rest: f32 = rest.iter().map(|x| (x - mean) * (x - mean)).sum();
    let variance = (squares.iter().sum::<f32>() + rest) / count;
    Moments {
        mean,
        inverse_std: 1.0 / (variance + epsilon).sqrt(),
    }
}

/// Sum of values, and of their products with others.
#[inline(always)]
fn sum_with_product(values: &[f32], others: &[f32]) -> [f32; 2] {
    let (mut sums, mut products) = ([0.0f32; LANES], [0.0f32; LANES]);
    let (blocks, rest) = values.as_chunks::<LANES>();
    for block in blocks {
        for (sum, value) in sums.iter_mut().zip(block) {
            *sum += value;
        }
    }
    let (other_blocks, other_rest) = others.as_chunks::<LANES>();
    for (block, other) in blocks.iter().zip(other_blocks) {
        for ((sum, value), other) in products.iter_mut().zip(block).zip(other) {
            *sum += value * other;
        }
    }
    let products_of_rest: f32 = rest
        .iter()
        .zip(other_rest)
        .map(|(value, other)| value * other)
        .sum();
    [
        sums.iter().sum::<f32>() + rest.iter().sum::<f32>(),
        products.iter().sum::<f32>() + products_of_rest,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_are_differences() {
        let (batch, channels, pixels, groups) = (2, 4, 21, 2);
        let wave =
            |count: usize, pace: f32| -> Vec<f32> { (0..count).map(|i| (i as f32 * pace).sin()).collect() };
        let x = wave(batch * channels * pixels, 0.37);
        let scale = wave(channels, 1.9);
        let shift = wave(channels, 2.3);
        let grad = wave(x.len(), 1.1);
        let loss = |x: &[f32], scale: &[f32], shift: &[f32]| -> f64 {
            let (y, _) = forward(x, (scale, shift), batch, groups, 1e-5);
            y.iter().zip(&grad).map(|(y, g)| f64::from(y * g)).sum()
        };
        let (y, moments) = forward(&x, (&[1.0; 4], &[0.0; 4]), batch, groups, 1e-5);
        let first = &y[..2 * pixels];
        let mean: f32 = first.iter().sum::<f32>() / first.len() as f32;
        let variance: f32 = first.iter().map(|v| v * v).sum::<f32>() / first.len() as f32;
        assert!(
            mean.abs() < 1e-5 && (variance - 1.0).abs() < 1e-3,
            "{mean} {variance}"
        );
        let [x_grad, scale_grad, shift_grad] = backward(&x, &scale, &grad, &moments, batch);
        let difference = |values: &[f32], place: usize, loss: &dyn Fn(&[f32]) -> f64| {
            let moved = |step: f32| {
                let mut values = values.to_vec();
                values[place] += step;
                loss(&values)
            };
            ((moved(0.01) - moved(-0.01)) / 0.02) as f32
        };
        let close = |a: f32, b: f32| assert!((a - b).abs() < 3e-3, "{a} {b}");
        for place in [0, 20, 50, 83, 100, 167] {
            close(x_grad[place], difference(&x, place, &|x| loss(x, &scale, &shift)));
        }
        for place in 0..channels {
            close(
                scale_grad[place],
                difference(&scale, place, &|scale| loss(&x, scale, &shift)),
            );
            close(
                shift_grad[place],
                difference(&shift, place, &|shift| loss(&x, &scale, shift)),
            );
        }
    }
}
