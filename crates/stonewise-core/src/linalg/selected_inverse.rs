//! The inverse of a sparse block matrix where the matrix has blocks.

use super::block::BlockFactor;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::{Accum, Mat, Par};
use nalgebra::SMatrix;
use rayon::prelude::*;

/// Blocks of the inverse on the pattern of the matrix; an edge block has rows of the higher node and columns
/// of the lower.
pub(crate) struct SelectedInverse<const B: usize> {
    pub diagonal: Vec<SMatrix<f64, B, B>>,
    pub edges: Vec<SMatrix<f64, B, B>>,
}

impl<const B: usize> BlockFactor<'_, B> {
    /// Blocks of A^-1 on the pattern of A (Takahashi, Fagan & Chen 1973), level by level from the roots of the
    /// elimination tree; the supernodes of a level are computed in parallel.
    ///
    /// Cost: about twice that of the factor.
    pub fn selected_inverse(&self) -> Option<SelectedInverse<B>> {
        let mut known = Known::new(self.supernodes()?);
        for level in known.levels() {
            let blocks: Vec<Mat<f64>> = level.par_iter().map(|&s| known.block(s)).collect();
            for (s, block) in level.into_iter().zip(blocks) {
                known.blocks[s] = block;
            }
        }
        let place = self.pattern.symbolic.perm()?.arrays().1;
        let block = |i: usize, j: usize| {
            SMatrix::from_fn(|r, c| {
                let (a, b) = (place[i * B + r], place[j * B + c]);
                known.entry(a.max(b), a.min(b))
            })
        };
        let edges = self.pattern.edges.par_iter();
        Some(SelectedInverse {
            diagonal: (0..self.pattern.nodes)
                .into_par_iter()
                .map(|i| block(i, i))
                .collect(),
            edges: edges.map(|&(low, high)| block(high, low)).collect(),
        })
    }
}

/// The inverse as far as it is computed, in the factor's order of rows.
struct Known<'a> {
    factor: SupernodalLltRef<'a, usize, f64>,
    /// Supernode of each column.
    owner: Vec<usize>,
    /// Per supernode: rows of its own columns, then rows of its pattern.
    blocks: Vec<Mat<f64>>,
}

impl<'a> Known<'a> {
    fn new(factor: SupernodalLltRef<'a, usize, f64>) -> Self {
        let symbolic = factor.symbolic();
        let count = symbolic.n_supernodes();
        let mut owner = vec![0; symbolic.nrows()];
        for s in 0..count {
            owner[symbolic.supernode_begin()[s]..symbolic.supernode_end()[s]].fill(s);
        }
        Self {
            factor,
            owner,
            blocks: (0..count).map(|_| Mat::zeros(0, 0)).collect(),
        }
    }

    /// Supernodes by their distance from the root of the elimination tree. The block of each depends on those of its
    /// ancestors only.
    fn levels(&self) -> Vec<Vec<usize>> {
        let symbolic = self.factor.symbolic();
        let mut depths = vec![0; self.blocks.len()];
        let mut levels: Vec<Vec<usize>> = Vec::new();
        for s in (0..depths.len()).rev() {
            let parent = symbolic
                .supernode(s)
                .pattern()
                .first()
                .map(|row| self.owner[*row]);
            depths[s] = parent.map_or(0, |parent| depths[parent] + 1);
            if levels.len() == depths[s] {
                levels.push(Vec::new());
            }
            levels[depths[s]].push(s);
        }
        levels
    }

    /// The block of a supernode; those of its ancestors are known.
    fn block(&self, s: usize) -> Mat<f64> {
        let node = self.factor.supernode(s);
        let (width, pattern) = (node.val().ncols(), node.pattern());
        let triangle = node.val().submatrix(0, 0, width, width);
        let mut own = Mat::<f64>::identity(width, width);
        solve_lower_triangular_in_place(triangle, own.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(triangle.transpose(), own.as_mut(), Par::Seq);
        let mut block = Mat::zeros(width + pattern.len(), width);
        if !pattern.is_empty() {
            let below_pivot = node.val().submatrix(width, 0, pattern.len(), width);
            let mut y = below_pivot.transpose().to_owned();
            solve_upper_triangular_in_place(triangle.transpose(), y.as_mut(), Par::Seq);
            let below = self.gather(pattern);
            let mut cross = Mat::zeros(pattern.len(), width);
            let (replace, add) = (Accum::Replace, Accum::Add);
            matmul(
                cross.as_mut(),
                replace,
                below.as_ref(),
                y.transpose(),
                -1.0,
                Par::Seq,
            );
            matmul(own.as_mut(), add, y.as_ref(), cross.as_ref(), -1.0, Par::Seq);
            let mut lower = block.as_mut().submatrix_mut(width, 0, pattern.len(), width);
            lower.copy_from(&cross);
        }
        block.as_mut().submatrix_mut(0, 0, width, width).copy_from(&own);
        block
    }

    /// The known inverse at the rows and columns of a pattern, both triangles.
    fn gather(&self, pattern: &[usize]) -> Mat<f64> {
        let symbolic = self.factor.symbolic();
        let mut out = Mat::zeros(pattern.len(), pattern.len());
        let mut from = 0;

        while from < pattern.len() {
            let s = self.owner[pattern[from]];
            let width = self.blocks[s].ncols();
            let (first, list) = (symbolic.supernode(s).start(), symbolic.supernode(s).pattern());
            let mut cursor = 0;
            let at: Vec<usize> = pattern[from..]
                .iter()
                .map(|&row| {
                    if row < first + width {
                        return row - first;
                    }
                    while list[cursor] < row {
                        cursor += 1;
                    }
                    width + cursor
                })
                .collect();
            let until = pattern.partition_point(|&p| p < first + width);
            for column in from..until {
                for row in column..pattern.len() {
                    let value = self.blocks[s][(at[row - from], pattern[column] - first)];
                    out[(row, column)] = value;
                    out[(column, row)] = value;
                }
            }
            from = until;
        }

        out
    }

    /// An entry of the lower triangle that lies on the factor's pattern.
    fn entry(&self, row: usize, column: usize) -> f64 {
        let s = self.owner[column];
        let node = self.factor.symbolic().supernode(s);
        let width = self.blocks[s].ncols();
        let r = if row < node.start() + width {
            row - node.start()
        } else {
            width + node.pattern().partition_point(|&p| p < row)
        };
        self.blocks[s][(r, column - node.start())]
    }
}
