//! Gaussian windows over grids.

use super::params::WINDOW_SDS;

/// A Gaussian window of this reach (standard deviation, cells) over a grid, zero outside it.
pub(crate) fn blur(values: &[f64], columns: usize, rows: usize, reach: f64) -> Vec<f64> {
    let radius = (WINDOW_SDS * reach).ceil().max(1.0) as isize;
    let kernel: Vec<f64> = (-radius..=radius)
        .map(|k| (-0.5 * (k as f64 / reach).powi(2)).exp())
        .collect();
    let sum: f64 = kernel.iter().sum();
    let kernel: Vec<f64> = kernel.iter().map(|k| k / sum).collect();
    let pass = |from: &[f64], count: usize, lines: usize, step: usize, stride: usize| -> Vec<f64> {
        let mut to = vec![0.0; from.len()];
        for line in 0..lines {
            for i in 0..count {
                let low = (i as isize - radius).max(0) as usize;
                let high = ((i as isize + radius) as usize).min(count - 1);
                let offset = (low as isize - (i as isize - radius)) as usize;
                let total: f64 = (low..=high)
                    .zip(&kernel[offset..])
                    .map(|(j, w)| from[line * stride + j * step] * w)
                    .sum();
                to[line * stride + i * step] = total;
            }
        }
        to
    };
    let along = pass(values, columns, rows, 1, columns);
    pass(&along, rows, columns, columns, 1)
}
