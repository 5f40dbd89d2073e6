//! Gaussian windows over grids.

use super::params::WINDOW_SDS;

/// Cells of a line that are summed side by side.
const LANES: usize = 16;

/// A Gaussian window of this reach (standard deviation, cells) over a grid, zero outside it.
pub(crate) fn blur(values: &[f32], columns: usize, rows: usize, reach: f64) -> Vec<f32> {
    let radius = (WINDOW_SDS * reach).ceil().max(1.0) as usize;
    let weight = |tap: usize| (-0.5 * ((tap as f64 - radius as f64) / reach).powi(2)).exp();
    let sum: f64 = (0..=2 * radius).map(weight).sum();
    let kernel: Vec<f32> = (0..=2 * radius).map(|tap| (weight(tap) / sum) as f32).collect();
    // Lines with zeros around them: those of a row side by side, those of a column one below the other.
    let width = columns.next_multiple_of(LANES);
    let mut line = vec![0.0; width + 2 * radius];
    let mut along = vec![0.0; width * (rows + 2 * radius)];
    for (from, to) in values.chunks(columns).zip(along.chunks_mut(width).skip(radius)) {
        line[radius..radius + columns].copy_from_slice(from);
        weigh(&line, 1, &kernel, to);
    }
    let mut both = vec![0.0; columns * rows];
    let mut summed = vec![0.0; width];
    for (row, to) in both.chunks_mut(columns).enumerate() {
        weigh(&along[row * width..], width, &kernel, &mut summed);
        to.copy_from_slice(&summed[..columns]);
    }
    both
}

/// Weighted sums, for each cell of a line: of `from` at this cell and at those that follow it in steps of
/// `stride`, one for each tap of the kernel.
fn weigh(from: &[f32], stride: usize, kernel: &[f32], to: &mut [f32]) {
    let (blocks, _) = to.as_chunks_mut::<LANES>();
    for (block, to) in blocks.iter_mut().enumerate() {
        let mut sums = [0.0; LANES];
        for (tap, weight) in kernel.iter().enumerate() {
            let start = block * LANES + tap * stride;
            for (sum, value) in sums.iter_mut().zip(&from[start..start + LANES]) {
                *sum += weight * value;
            }
        }
        *to = sums;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_the_sum_of_the_window_around_it() {
        let (columns, rows, reach) = (19, 7, 1.3);
        let values: Vec<f32> = (0..133).map(|k| f32::from((k * k % 17) as u8)).collect();
        let found = blur(&values, columns, rows, reach);
        let weight = |d: f64| (-0.5 * (d / reach).powi(2)).exp();
        let total: f64 = (-4..=4).map(|d| weight(f64::from(d))).sum();
        for (k, found) in found.iter().enumerate() {
            let at = |k: usize| [(k % columns) as f64, (k / columns) as f64];
            let [x, y] = at(k);
            let near = |other: &usize| at(*other).iter().zip([x, y]).all(|(a, b)| (a - b).abs() <= 4.0);
            let sum: f64 = (0..133)
                .filter(near)
                .map(|other| {
                    let [u, v] = at(other);
                    f64::from(values[other]) * weight(u - x) * weight(v - y) / (total * total)
                })
                .sum();
            assert!((f64::from(*found) - sum).abs() < 1e-5, "{found} {sum}");
        }
    }
}
