//! The largest of neighbouring pixels, on slices: plane, row, column.

use pulp::Arch;
use rayon::prelude::*;

/// Max pooling over 3 x 3 pixels with stride 2 and a border of 1, of planes of `rows` x `columns`.
pub fn halve(x: &[f32], [rows, columns]: [usize; 2]) -> Vec<f32> {
    let size = [rows, columns].map(|side| side.div_ceil(2));
    let planes = x.len() / (rows * columns).max(1);
    let mut y = vec![0.0f32; planes * size[0] * size[1]];
    let targets = y.par_chunks_mut((size[0] * size[1]).max(1));
    let sources = x.par_chunks((rows * columns).max(1));
    targets.zip(sources).for_each_init(Vec::new, |line, (y, x)| {
        line.resize(columns, 0.0);
        for (row, y) in y.chunks_mut(size[1]).enumerate() {
            let source = |row: usize| &x[row * columns..][..columns];
            let [middle, below] = [2 * row, (2 * row + 1).min(rows - 1)].map(source);
            let above = source((2 * row).saturating_sub(1));
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    let rows = above.iter().zip(middle).zip(below);
                    for (to, ((a, b), c)) in line.iter_mut().zip(rows) {
                        *to = larger(larger(*a, *b), *c);
                    }
                    halve_line(line, y);
                },
            );
        }
    });
    y
}

/// The largest of three values around every second one.
#[inline(always)]
fn halve_line(line: &[f32], y: &mut [f32]) {
    let (pairs, last) = line.as_chunks::<2>();
    for (to, [a, b]) in y.iter_mut().zip(pairs) {
        *to = larger(*a, *b);
    }
    if let (Some(to), Some(value)) = (y.get_mut(pairs.len()), last.first()) {
        *to = *value;
    }
    for (to, [_, before]) in y.iter_mut().skip(1).zip(pairs) {
        *to = larger(*to, *before);
    }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
