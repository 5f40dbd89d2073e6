//! Sparse positive definite systems of square blocks: Cholesky factor, solves, selected inverse.

use super::equations::{Matrix9, Motion9, UNKNOWNS as B};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal::SupernodalLltRef,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Accum, Conj, Mat, MatMut, Par, Side};

/// Which blocks of a symmetric matrix are present, analysed once.
pub(super) struct BlockPattern {
    nodes: usize,
    columns: SymbolicSparseColMat<usize>,
    /// Per edge (low, high): offset of the block's rows within each column of `low`.
    edge_row: Vec<usize>,
    edges: Vec<(usize, usize)>,
    symbolic: SymbolicCholesky<usize>,
}

/// Diagonal blocks and edge blocks; an edge block has rows of the higher node and columns of the lower.
pub(super) struct BlockMatrix {
    pub diagonal: Vec<Matrix9>,
    pub edges: Vec<Matrix9>,
}

/// A factored [`BlockMatrix`].
pub(super) struct BlockFactor<'a> {
    pattern: &'a BlockPattern,
    values: Vec<f64>,
}

/// Blocks of the inverse where the matrix has blocks.
pub(super) struct SelectedInverse {
    pub diagonal: Vec<Matrix9>,
    pub edges: Vec<Matrix9>,
}

impl BlockPattern {
    /// `edges` are (low, high) node pairs, sorted, without repeats. `None` where memory does not suffice.
    pub fn new(nodes: usize, edges: &[(usize, usize)]) -> Option<Self> {
        let mut above = vec![Vec::new(); nodes];
        for (e, &(low, high)) in edges.iter().enumerate() {
            above[low].push((high, e));
        }
        let mut pointers = vec![0];
        let mut rows = Vec::new();
        let mut edge_row = vec![0; edges.len()];
        for (i, list) in above.iter_mut().enumerate() {
            list.sort_unstable();
            for c in 0..B {
                rows.extend(i * B + c..(i + 1) * B);
                for (k, &(j, e)) in list.iter().enumerate() {
                    rows.extend(j * B..(j + 1) * B);
                    edge_row[e] = k * B;
                }
                pointers.push(rows.len());
            }
        }
        let columns = SymbolicSparseColMat::new_checked(nodes * B, nodes * B, pointers, None, rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic =
            factorize_symbolic_cholesky(columns.as_ref(), Side::Lower, SymmetricOrdering::Amd, params)
                .ok()?;
        Some(Self {
            nodes,
            columns,
            edge_row,
            edges: edges.to_vec(),
            symbolic,
        })
    }

    /// The matrix of zeros.
    pub fn zeros(&self) -> BlockMatrix {
        BlockMatrix {
            diagonal: vec![Matrix9::zeros(); self.nodes],
            edges: vec![Matrix9::zeros(); self.edges.len()],
        }
    }

    /// `None` where the matrix is not positive definite.
    pub fn factor(&self, matrix: &BlockMatrix) -> Option<BlockFactor<'_>> {
        let pointers = self.columns.col_ptr();
        let mut values = vec![0.0; self.columns.row_idx().len()];
        for (i, block) in matrix.diagonal.iter().enumerate() {
            for c in 0..B {
                let start = pointers[i * B + c];
                for r in c..B {
                    values[start + r - c] = block[(r, c)];
                }
            }
        }
        for (e, block) in matrix.edges.iter().enumerate() {
            for c in 0..B {
                let start = pointers[self.edges[e].0 * B + c] + B - c + self.edge_row[e];
                for r in 0..B {
                    values[start + r] = block[(r, c)];
                }
            }
        }
        let input = SparseColMatRef::new(self.columns.as_ref(), &values);
        let mut factor = vec![0.0; self.symbolic.len_val()];
        let need = self
            .symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(need).ok()?;
        self.symbolic
            .factorize_numeric_llt(
                &mut factor,
                input,
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .ok()?;
        Some(BlockFactor {
            pattern: self,
            values: factor,
        })
    }
}

impl BlockFactor<'_> {
    /// log |A|.
    pub fn log_det(&self) -> f64 {
        let Some(llt) = self.supernodes() else {
            return f64::NAN;
        };
        let mut sum = 0.0;
        for s in 0..llt.symbolic().n_supernodes() {
            let values = llt.supernode(s).val();
            sum += (0..values.ncols()).map(|k| values[(k, k)].ln()).sum::<f64>();
        }
        2.0 * sum
    }

    /// A^-1 times a vector of blocks.
    pub fn solve(&self, rhs: &[Motion9]) -> Vec<Motion9> {
        let mut flat: Vec<f64> = rhs.iter().flat_map(|b| b.iter().copied()).collect();
        let symbolic = &self.pattern.symbolic;
        if let Ok(mut memory) = MemBuffer::try_new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq)) {
            let rows = flat.len();
            LltRef::new(symbolic, &self.values).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(&mut flat, rows, 1),
                Par::Seq,
                MemStack::new(&mut memory),
            );
        }
        flat.chunks_exact(B).map(Motion9::from_column_slice).collect()
    }

    fn supernodes(&self) -> Option<SupernodalLltRef<'_, usize, f64>> {
        match self.pattern.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(s) => Some(SupernodalLltRef::new(s, &self.values)),
            SymbolicCholeskyRaw::Simplicial(_) => None,
        }
    }

    /// Blocks of A^-1 on the pattern of A (Takahashi, Fagan & Chen 1973), supernode by supernode from the last.
    ///
    /// Cost: about twice that of the factor.
    pub fn selected_inverse(&self) -> Option<SelectedInverse> {
        let llt = self.supernodes()?;
        let symbolic = llt.symbolic();
        let count = symbolic.n_supernodes();
        let mut owner = vec![0; symbolic.nrows()];
        for s in 0..count {
            owner[symbolic.supernode_begin()[s]..symbolic.supernode_end()[s]].fill(s);
        }
        let mut inverse: Vec<Mat<f64>> = (0..count).map(|_| Mat::zeros(0, 0)).collect();
        for s in (0..count).rev() {
            let node = llt.supernode(s);
            let width = node.val().ncols();
            let pattern = node.pattern();
            let triangle = node.val().submatrix(0, 0, width, width);
            let mut own = Mat::<f64>::identity(width, width);
            solve_lower_triangular_in_place(triangle, own.as_mut(), Par::Seq);
            solve_upper_triangular_in_place(triangle.transpose(), own.as_mut(), Par::Seq);
            let mut block = Mat::zeros(width + pattern.len(), width);
            if !pattern.is_empty() {
                let mut y = node
                    .val()
                    .submatrix(width, 0, pattern.len(), width)
                    .transpose()
                    .to_owned();
                solve_upper_triangular_in_place(triangle.transpose(), y.as_mut(), Par::Seq);
                let below = gather(
                    pattern,
                    &owner,
                    &inverse,
                    |t| symbolic.supernode(t).start(),
                    |t| symbolic.supernode(t).pattern(),
                );
                let mut cross = Mat::zeros(pattern.len(), width);
                matmul(
                    cross.as_mut(),
                    Accum::Replace,
                    below.as_ref(),
                    y.transpose(),
                    -1.0,
                    Par::Seq,
                );
                matmul(
                    own.as_mut(),
                    Accum::Add,
                    y.as_ref(),
                    cross.as_ref(),
                    -1.0,
                    Par::Seq,
                );
                block
                    .as_mut()
                    .submatrix_mut(width, 0, pattern.len(), width)
                    .copy_from(&cross);
            }
            block.as_mut().submatrix_mut(0, 0, width, width).copy_from(&own);
            inverse[s] = block;
        }
        let place = self.pattern.symbolic.perm()?.arrays().1.to_vec();
        let entry = |a: usize, b: usize| -> f64 {
            let (row, column) = (place[a].max(place[b]), place[a].min(place[b]));
            let s = owner[column];
            let node = symbolic.supernode(s);
            let width = inverse[s].ncols();
            let r = if row < node.start() + width {
                row - node.start()
            } else {
                width + node.pattern().partition_point(|&p| p < row)
            };
            inverse[s][(r, column - node.start())]
        };
        let block = |i: usize, j: usize| Matrix9::from_fn(|r, c| entry(i * B + r, j * B + c));
        Some(SelectedInverse {
            diagonal: (0..self.pattern.nodes).map(|i| block(i, i)).collect(),
            edges: self
                .pattern
                .edges
                .iter()
                .map(|&(low, high)| block(high, low))
                .collect(),
        })
    }
}

/// The known inverse at the rows and columns of a pattern, both triangles.
fn gather<'a>(
    pattern: &[usize],
    owner: &[usize],
    inverse: &[Mat<f64>],
    start: impl Fn(usize) -> usize,
    rows: impl Fn(usize) -> &'a [usize],
) -> Mat<f64> {
    let mut out = Mat::zeros(pattern.len(), pattern.len());
    let mut from = 0;
    while from < pattern.len() {
        let s = owner[pattern[from]];
        let width = inverse[s].ncols();
        let (first, list) = (start(s), rows(s));
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
                let value = inverse[s][(at[row - from], pattern[column] - first)];
                out[(row, column)] = value;
                out[(column, row)] = value;
            }
        }
        from = until;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn solve_determinant_and_selected_inverse_agree_with_a_dense_matrix() {
        let side = 5;
        let nodes = side * side;
        let mut edges = Vec::new();
        for i in 0..nodes {
            if i % side + 1 < side {
                edges.push((i, i + 1));
            }
            if i + side < nodes {
                edges.push((i, i + side));
            }
        }
        edges.sort_unstable();
        let pattern = BlockPattern::new(nodes, &edges).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut matrix = pattern.zeros();
        let mut dense = DMatrix::<f64>::zeros(nodes * B, nodes * B);
        for (i, d) in matrix.diagonal.iter_mut().enumerate() {
            let m = Matrix9::from_fn(|_, _| rng.random_range(-1.0..1.0));
            *d = m * m.transpose() + Matrix9::identity() * 20.0;
            dense.view_mut((i * B, i * B), (B, B)).copy_from(d);
        }
        for (e, &(low, high)) in edges.iter().enumerate() {
            let m = Matrix9::from_fn(|_, _| rng.random_range(-1.0..1.0));
            matrix.edges[e] = m;
            dense.view_mut((high * B, low * B), (B, B)).copy_from(&m);
            dense
                .view_mut((low * B, high * B), (B, B))
                .copy_from(&m.transpose());
        }
        let factor = pattern.factor(&matrix).unwrap();
        let expected = dense.clone().cholesky().unwrap();
        let log_det: f64 = 2.0 * expected.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        assert!((factor.log_det() - log_det).abs() < 1e-9);
        let rhs: Vec<Motion9> = (0..nodes)
            .map(|_| Motion9::from_fn(|_, _| rng.random_range(-1.0..1.0)))
            .collect();
        let flat = DMatrix::from_fn(nodes * B, 1, |r, _| rhs[r / B][r % B]);
        let want = expected.solve(&flat);
        let got = factor.solve(&rhs);
        assert!((0..nodes * B).all(|r| (got[r / B][r % B] - want[r]).abs() < 1e-12));
        let inverse = expected.inverse();
        let selected = factor.selected_inverse().unwrap();
        for (i, d) in selected.diagonal.iter().enumerate() {
            assert!((d - inverse.view((i * B, i * B), (B, B))).norm() < 1e-12);
        }
        for (e, &(low, high)) in edges.iter().enumerate() {
            assert!((selected.edges[e] - inverse.view((high * B, low * B), (B, B))).norm() < 1e-12);
        }
    }
}
