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
    // Taps in ascending order, each over a whole line, so that lines are summed in lanes.
    let mut along = vec![0.0; values.len()];
    for (from, to) in values.chunks(columns).zip(along.chunks_mut(columns)) {
        for (shift, weight) in (-radius..).zip(&kernel) {
            let start = shift.unsigned_abs().min(columns);
            match shift < 0 {
                true => add(&mut to[start..], from, *weight),
                false => add(to, &from[start..], *weight),
            }
        }
    }
    let mut both = vec![0.0; values.len()];
    for (row, to) in (0..rows as isize).zip(both.chunks_mut(columns)) {
        for (shift, weight) in (-radius..).zip(&kernel) {
            let Ok(from) = usize::try_from(row + shift) else {
                continue;
            };
            if from < rows {
                add(to, &along[from * columns..(from + 1) * columns], *weight);
            }
        }
    }
    both
}

/// Adds a multiple; the longer of the two is cut.
fn add(to: &mut [f64], from: &[f64], weight: f64) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += from * weight;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_the_sum_of_the_window_around_it() {
        let (columns, rows, reach) = (9, 7, 1.3);
        let values: Vec<f64> = (0..63).map(|k| f64::from(k * k % 17)).collect();
        let found = blur(&values, columns, rows, reach);
        let weight = |d: f64| (-0.5 * (d / reach).powi(2)).exp();
        let total: f64 = (-4..=4).map(|d| weight(f64::from(d))).sum();
        for (k, found) in found.iter().enumerate() {
            let at = |k: usize| [(k % columns) as f64, (k / columns) as f64];
            let [x, y] = at(k);
            let near = |other: &usize| at(*other).iter().zip([x, y]).all(|(a, b)| (a - b).abs() <= 4.0);
            let sum: f64 = (0..63)
                .filter(near)
                .map(|other| {
                    let [u, v] = at(other);
                    values[other] * weight(u - x) * weight(v - y) / (total * total)
                })
                .sum();
            assert!((found - sum).abs() < 1e-12, "{found} {sum}");
        }
    }
}
