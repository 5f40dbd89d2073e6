//! Weights of a convolution of 3 x 3 as Winograd's minimal filtering takes them.

use std::sync::Arc;

/// Pixels of the result along a side of a cell.
pub const CELL: usize = 4;
/// Places along a side of a transformed cell.
pub const SIDE: usize = 6;
/// Places of a transformed cell.
pub const PLACES: usize = SIDE * SIDE;
/// Weights along a side.
const SIZE: usize = 3;
/// Filters that are transformed at once.
const AT_ONCE: usize = 64;

/// Transformed weights of a convolution: place, output, input. Four times as many as the weights.
#[derive(Clone, Debug)]
pub struct Filters {
    values: Arc<Vec<f32>>,
    count: usize,
}

impl Filters {
    /// The filters of weights [outputs, inputs, 3, 3]: F(4 x 4, 3 x 3) of Lavin & Gray 2016, section 4.2.
    pub fn new(weights: &[f32]) -> Self {
        let count = weights.len() / (SIZE * SIZE);
        let mut values = vec![0.0f32; PLACES * count];
        for first in (0..count).step_by(AT_ONCE) {
            let some = AT_ONCE.min(count - first);
            let mut rows = [[[0.0f64; AT_ONCE]; SIDE]; SIZE];
            for filter in 0..some {
                let weights = &weights[(first + filter) * SIZE * SIZE..][..SIZE * SIZE];
                for (row, weights) in rows.iter_mut().zip(weights.chunks(SIZE)) {
                    let made = transformed([weights[0], weights[1], weights[2]].map(f64::from));
                    row.iter_mut()
                        .zip(made)
                        .for_each(|(to, value)| to[filter] = value);
                }
            }
            for column in 0..SIDE {
                for filter in 0..some {
                    let made = transformed([0, 1, 2].map(|row| rows[row][column][filter]));
                    for (row, value) in made.into_iter().enumerate() {
                        values[(row * SIDE + column) * count + first + filter] = value as f32;
                    }
                }
            }
        }
        Self {
            values: Arc::new(values),
            count,
        }
    }

    /// The matrix of a place: output, input.
    pub fn place(&self, place: usize) -> &[f32] {
        &self.values[place * self.count..][..self.count]
    }
}

/// Transform of three weights along a side.
fn transformed([a, b, c]: [f64; SIZE]) -> [f64; SIDE] {
    [
        a / 4.0,
        -(a + b + c) / 6.0,
        -(a - b + c) / 6.0,
        (a / 4.0 + b / 2.0 + c) / 6.0,
        (a / 4.0 - b / 2.0 + c) / 6.0,
        c,
    ]
}
