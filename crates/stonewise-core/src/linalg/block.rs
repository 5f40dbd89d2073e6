//! Sparse positive definite systems of square blocks: Cholesky factor, solves, log determinant.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal::SupernodalLltRef,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use nalgebra::SMatrix;

/// Which blocks of a symmetric matrix are present, analysed once. Blocks have `B` rows and columns.
pub(crate) struct BlockPattern<const B: usize> {
    pub(super) nodes: usize,
    columns: SymbolicSparseColMat<usize>,
    /// Per edge (low, high): offset of the block's rows within each column of `low`.
    edge_row: Vec<usize>,
    pub(super) edges: Vec<(usize, usize)>,
    pub(super) symbolic: SymbolicCholesky<usize>,
}

/// Diagonal blocks and edge blocks; an edge block has rows of the higher node and columns of the lower.
#[derive(Clone, Debug)]
pub(crate) struct BlockMatrix<const B: usize> {
    pub diagonal: Vec<SMatrix<f64, B, B>>,
    pub edges: Vec<SMatrix<f64, B, B>>,
}

/// A factored [`BlockMatrix`].
pub(crate) struct BlockFactor<'a, const B: usize> {
    pub(super) pattern: &'a BlockPattern<B>,
    values: Vec<f64>,
}

impl<const B: usize> BlockPattern<B> {
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
    pub fn zeros(&self) -> BlockMatrix<B> {
        BlockMatrix {
            diagonal: vec![SMatrix::zeros(); self.nodes],
            edges: vec![SMatrix::zeros(); self.edges.len()],
        }
    }

    /// `None` where the matrix is not positive definite.
    pub fn factor(&self, matrix: &BlockMatrix<B>) -> Option<BlockFactor<'_, B>> {
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

impl<const B: usize> BlockFactor<'_, B> {
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

    /// A^-1 times one or more vectors of blocks: the factor is read once for all of them.
    pub fn solve<const K: usize>(&self, rhs: &[SMatrix<f64, B, K>]) -> Vec<SMatrix<f64, B, K>> {
        let rows = rhs.len() * B;
        let place = |block: usize, column: usize| column * rows + block * B;
        let mut flat = vec![0.0; rows * K];
        for (i, block) in rhs.iter().enumerate() {
            for (k, column) in block.column_iter().enumerate() {
                flat[place(i, k)..][..B].copy_from_slice(column.as_slice());
            }
        }
        let symbolic = &self.pattern.symbolic;
        if let Ok(mut memory) = MemBuffer::try_new(symbolic.solve_in_place_scratch::<f64>(K, Par::Seq)) {
            LltRef::new(symbolic, &self.values).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(&mut flat, rows, K),
                Par::Seq,
                MemStack::new(&mut memory),
            );
        }
        let block = |i: usize| SMatrix::from_fn(|r, k| flat[place(i, k) + r]);
        (0..rhs.len()).map(block).collect()
    }

    pub(super) fn supernodes(&self) -> Option<SupernodalLltRef<'_, usize, f64>> {
        match self.pattern.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(s) => Some(SupernodalLltRef::new(s, &self.values)),
            SymbolicCholeskyRaw::Simplicial(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, SVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const B: usize = 9;

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
        let pattern = BlockPattern::<B>::new(nodes, &edges).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut matrix = pattern.zeros();
        let mut dense = DMatrix::<f64>::zeros(nodes * B, nodes * B);
        for (i, d) in matrix.diagonal.iter_mut().enumerate() {
            let m = SMatrix::<f64, B, B>::from_fn(|_, _| rng.random_range(-1.0..1.0));
            *d = m * m.transpose() + SMatrix::identity() * 20.0;
            dense.view_mut((i * B, i * B), (B, B)).copy_from(d);
        }
        for (e, &(low, high)) in edges.iter().enumerate() {
            let m = SMatrix::<f64, B, B>::from_fn(|_, _| rng.random_range(-1.0..1.0));
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
        let rhs: Vec<SVector<f64, B>> = (0..nodes)
            .map(|_| SVector::from_fn(|_, _| rng.random_range(-1.0..1.0)))
            .collect();
        let flat = DMatrix::from_fn(nodes * B, 1, |r, _| rhs[r / B][r % B]);
        let want = expected.solve(&flat);
        let got = factor.solve(&rhs);
        assert!((0..nodes * B).all(|r| (got[r / B][r % B] - want[r]).abs() < 1e-12));
        let twice: Vec<SMatrix<f64, B, 2>> = rhs
            .iter()
            .map(|b| SMatrix::from_columns(&[*b, -2.0 * b]))
            .collect();
        for (both, one) in factor.solve(&twice).iter().zip(&got) {
            assert!((both.column(0) - one).norm() < 1e-12 && (both.column(1) + 2.0 * one).norm() < 1e-12);
        }
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
