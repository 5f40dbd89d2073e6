//! Photos on a stone's face, their contrast normalised.

use super::blur::blur;
use super::photo::{cubic, weighted};
use super::surface::Surface;

/// Noise of grey values that is not raised to full contrast, 0..255: a smooth face stays smooth.
const GREY_NOISE: f32 = 3.0;
/// Smoothing before contrast is normalised, cells: interpolation errors of single pixels go.
const PIXEL_BLUR: f64 = 0.7;

/// Values on the grid of a stone's face.
pub(crate) struct Patch {
    pub values: Vec<f32>,
    /// Whether the photo shows the cell.
    pub valid: Vec<bool>,
    /// Whether it shows all cells that values about this cell are interpolated from.
    surrounded: Vec<bool>,
}

/// Differences from the local mean over the local standard deviation, in a Gaussian window of this standard
/// deviation.
pub(super) fn normalised(grey: &[Option<f32>], surface: &Surface, window_m: f64) -> Patch {
    let (columns, rows) = (surface.columns, surface.rows);
    let valid: Vec<bool> = grey.iter().map(Option::is_some).collect();
    let weight: Vec<f32> = valid.iter().map(|v| f32::from(u8::from(*v))).collect();
    let window = |values: &[f32], reach: f64| blur(values, columns, rows, reach);
    let over = |values: &[f32], reach: f64, weights: &[f32]| -> Vec<f32> {
        let sums = window(values, reach);
        sums.iter()
            .zip(weights)
            .map(|(s, w)| if *w > 1e-6 { s / w } else { 0.0 })
            .collect()
    };
    let raw: Vec<f32> = grey.iter().map(|g| g.unwrap_or(0.0)).collect();
    let zeroed = |values: Vec<f32>| -> Vec<f32> { values.iter().zip(&weight).map(|(v, w)| v * w).collect() };
    let smooth = zeroed(over(&raw, PIXEL_BLUR, &window(&weight, PIXEL_BLUR)));
    let reach = window_m / surface.cell_m;
    let weights = window(&weight, reach);
    let mean = over(&smooth, reach, &weights);
    let apart = zeroed(smooth.iter().zip(&mean).map(|(v, m)| v - m).collect());
    let squares: Vec<f32> = apart.iter().map(|a| a * a).collect();
    let variance = over(&squares, reach, &weights);
    let values = apart
        .iter()
        .zip(variance)
        .map(|(a, v)| a / (v + GREY_NOISE * GREY_NOISE).sqrt())
        .collect();
    Patch::new(values, valid, columns)
}

/// Cells before and after a place that its value is interpolated from, along each axis.
const BEFORE: usize = 1;
const AFTER: usize = 2;

impl Patch {
    /// A patch of values in row-major order, with `columns` columns.
    pub fn new(values: Vec<f32>, valid: Vec<bool>, columns: usize) -> Self {
        let surrounded_along = |k: usize| {
            let column = k % columns;
            column >= BEFORE && column + AFTER < columns && valid[k - BEFORE..=k + AFTER].iter().all(|v| *v)
        };
        let along: Vec<bool> = (0..valid.len()).map(surrounded_along).collect();
        let rows = valid.len() / columns;
        let surrounded = |k: usize| {
            let row = k / columns;
            let of_row = |other: usize| along[k % columns + other * columns];
            row >= BEFORE && row + AFTER < rows && (row - BEFORE..=row + AFTER).all(of_row)
        };
        Self {
            surrounded: (0..valid.len()).map(surrounded).collect(),
            values,
            valid,
        }
    }

    /// Value at a place in cells, by cubic convolution; `None` outside, and where a cell around it is not
    /// shown.
    pub fn sample(&self, surface: &Surface, x: f64, y: f64) -> Option<f32> {
        let inside = |v: f64, size: usize| v >= 0.0 && v < size as f64;
        if !(inside(x, surface.columns) && inside(y, surface.rows)) {
            return None;
        }
        // Conversion to 32 bits takes fewer instructions.
        let (column, row) = (x as u32 as usize, y as u32 as usize);
        let k = row * surface.columns + column;
        if !self.surrounded[k] {
            return None;
        }
        let (wx, wy) = (cubic((x - column as f64) as f32), cubic((y - row as f64) as f32));
        let mut lines = [[0.0; 4]; 4];
        for (j, line) in lines.iter_mut().enumerate() {
            let start = k + j * surface.columns - (BEFORE * surface.columns + BEFORE);
            *line = *self.values.get(start..)?.first_chunk()?;
        }
        Some(weighted(&lines, wx, wy))
    }

    /// Values at places in equal steps along a line, which starts at `start`, as `sample` finds them; not a
    /// number where it finds none.
    pub fn sample_line(&self, surface: &Surface, start: [f64; 2], step: [f64; 2], to: &mut [f32]) {
        let place = |k: usize| [0, 1].map(|a| start[a] + k as f64 * step[a]);
        for (block, to) in to.chunks_mut(LANES).enumerate() {
            let lanes = Lanes::new(place(block * LANES), step);
            if let Ok(to) = <&mut [f32; LANES]>::try_from(&mut *to)
                && let Some(first) = lanes.first_of_neighbours(surface)
                && self.surrounded[first..first + LANES].iter().all(|s| *s)
            {
                *to = lanes.sampled(&self.values, first, surface.columns);
                continue;
            }
            for (lane, to) in to.iter_mut().enumerate() {
                let [x, y] = place(block * LANES + lane);
                *to = self.sample(surface, x, y).unwrap_or(f32::NAN);
            }
        }
    }
}

/// Places that are interpolated side by side.
const LANES: usize = 4;
/// 3 x 2^22: adding it rounds a number of at most 2^22 to an integer, which its last bits then hold.
const TO_INTEGER: f32 = 12_582_912.0;

/// Places in equal steps along a line.
struct Lanes {
    /// Cells that they lie in, counted along and up.
    cells: [[i32; LANES]; 2],
    /// How far they lie from the middle of that cell to that of the next.
    shares: [[f32; LANES]; 2],
}

impl Lanes {
    fn new(start: [f64; 2], step: [f64; 2]) -> Self {
        let (mut cells, mut shares) = ([[0; LANES]; 2], [[0.0; LANES]; 2]);
        for axis in 0..2 {
            for lane in 0..LANES {
                let at = (start[axis] + lane as f64 * step[axis]) as f32;
                let rounded = at - 0.5 + TO_INTEGER;
                cells[axis][lane] = rounded.to_bits() as i32 - TO_INTEGER.to_bits() as i32;
                shares[axis][lane] = at - (rounded - TO_INTEGER);
            }
        }
        Self { cells, shares }
    }

    /// The first cell, if the others are those that follow it in its row.
    fn first_of_neighbours(&self, surface: &Surface) -> Option<usize> {
        let [columns, rows] = self.cells;
        let follow = (0..LANES).fold(true, |all, lane| {
            all & (columns[lane] == columns[0] + lane as i32) & (rows[lane] == rows[0])
        });
        let column = usize::try_from(columns[0]).ok()?;
        let row = usize::try_from(rows[0]).ok()?;
        let is_inside = follow && column + LANES <= surface.columns && row < surface.rows;
        is_inside.then(|| row * surface.columns + column)
    }

    /// Values at the places, of which the first lies in the cell `first`.
    fn sampled(&self, values: &[f32], first: usize, columns: usize) -> [f32; LANES] {
        let (along, across) = (cubics(&self.shares[0]), cubics(&self.shares[1]));
        let mut sums = [0.0; LANES];
        for (line, across) in across.iter().enumerate() {
            let start = first + line * columns - (BEFORE * columns + BEFORE);
            let mut of_line = [0.0; LANES];
            for (tap, along) in along.iter().enumerate() {
                let cells = &values[start + tap..start + tap + LANES];
                for lane in 0..LANES {
                    of_line[lane] += along[lane] * cells[lane];
                }
            }
            for lane in 0..LANES {
                sums[lane] += across[lane] * of_line[lane];
            }
        }
        sums
    }
}

/// Weights of the four neighbours of each place.
#[inline]
fn cubics(shares: &[f32; LANES]) -> [[f32; LANES]; 4] {
    let mut weights = [[0.0; LANES]; 4];
    for (lane, share) in shares.iter().enumerate() {
        for (weights, weight) in weights.iter_mut().zip(cubic(*share)) {
            weights[lane] = weight;
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::super::testing::{SIDE, grained};
    use super::*;

    #[test]
    fn a_line_is_sampled_as_its_places_one_by_one() {
        let surface = Surface::flat(SIDE, 12);
        let mut patch = grained(3, 2.0, [0.0; 2]);
        patch.valid[20 * SIDE + 17] = false;
        let patch = Patch::new(patch.values, patch.valid, SIDE);
        let mut shown = 0;
        for (start, step) in [
            ([-3.2, 20.4], [1.0, 0.0]),
            ([0.7, 18.1], [0.99, 0.01]),
            ([5.0, 3.0], [1.0, 0.0]),
            ([44.6, 44.9], [-1.02, -0.8]),
            ([2.0, 45.3], [1.0, 0.02]),
        ] {
            let mut values = [0.0; 51];
            patch.sample_line(&surface, start, step, &mut values);
            for (k, found) in values.iter().enumerate() {
                let [x, y] = [0, 1].map(|a| start[a] + k as f64 * step[a]);
                match patch.sample(&surface, x, y) {
                    Some(expected) => assert!((found - expected).abs() < 1e-4, "{x} {y}: {found} {expected}"),
                    None => assert!(found.is_nan(), "{x} {y}: {found}"),
                }
                shown += usize::from(found.is_finite());
            }
        }
        assert!((100..250).contains(&shown), "{shown}");
    }
}
