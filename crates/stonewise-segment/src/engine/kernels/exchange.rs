//! Transposition.

use rayon::prelude::*;

/// Side of the blocks in which a matrix is transposed: what lies in it stays in the first-level cache.
const BLOCK_SIDE: usize = 16;

/// The transposes of matrices of rows x columns, one after another.
pub fn exchange(x: &[f32], [rows, columns]: [usize; 2]) -> Vec<f32> {
    let mut y = vec![0.0f32; x.len()];
    let size = (rows * columns).max(1);
    let matrices = y.par_chunks_mut(size).zip(x.par_chunks(size));
    matrices.for_each(|(y, x)| {
        let blocks = y.par_chunks_mut((BLOCK_SIDE * rows).max(1)).enumerate();
        blocks.for_each(|(block, y)| exchange_block(&x[block * BLOCK_SIDE..], y, [rows, columns]));
    });
    y
}

/// Some columns, of which `x` begins with the first.
fn exchange_block(x: &[f32], y: &mut [f32], [rows, columns]: [usize; 2]) {
    for first_row in (0..rows).step_by(BLOCK_SIDE) {
        let some_rows = BLOCK_SIDE.min(rows - first_row);
        for (column, y) in y.chunks_mut(rows).enumerate() {
            let target = &mut y[first_row..][..some_rows];
            let source = x[first_row * columns + column..].iter().step_by(columns);
            target.iter_mut().zip(source).for_each(|(to, from)| *to = *from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_comes_to_its_place() {
        for [batch, rows, columns] in [[1, 1, 1], [2, 16, 33], [3, 49, 20]] {
            let x: Vec<f32> = (0..batch * rows * columns).map(|i| i as f32).collect();
            let y = exchange(&x, [rows, columns]);
            for (place, value) in x.iter().enumerate() {
                let (column, row, image) = (place % columns, place / columns % rows, place / columns / rows);
                assert_eq!(y[(image * columns + column) * rows + row], *value);
            }
        }
    }
}
