//! Errors that stones share: those of the epochs' sources, of photos' poses, and of points over longer lengths than a
//! stone.

use crate::registration::random::Random;
use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DVector, DefaultAllocator, Dim, Dyn, Matrix3, OMatrix, U1, U3, Vector3};

/// Errors of the stones as linear functions of unknowns that are normal about zero: e_i = L_i u.
#[derive(Clone)]
pub(super) struct SharedErrors {
    /// Unknowns of each stone, and its displacement by each of them, metres a unit.
    rows: Vec<Vec<(usize, Vector3<f64>)>>,
    /// First unknown and covariance of each independent group.
    groups: Vec<(usize, Spread)>,
    unknowns: usize,
}

/// Distribution of a group of unknowns.
#[derive(Clone)]
enum Spread {
    /// So many independent ones of variance one.
    Unit(usize),
    /// Covariance, and a root of it.
    Joint(DMatrix<f64>, DMatrix<f64>),
}

impl SharedErrors {
    pub fn none(stones: usize) -> Self {
        Self {
            rows: vec![Vec::new(); stones],
            groups: Vec::new(),
            unknowns: 0,
        }
    }

    /// Adds independent unknowns of variance one; `rows`: of each stone, unknowns counted from zero.
    pub fn add_units(&mut self, count: usize, rows: impl Iterator<Item = Vec<(usize, Vector3<f64>)>>) {
        self.add_rows(rows);
        self.groups.push((self.unknowns, Spread::Unit(count)));
        self.unknowns += count;
    }

    /// Adds unknowns of this covariance; `rows`: of each stone, unknowns counted from zero.
    pub fn add_joint(
        &mut self,
        covariance: &DMatrix<f64>,
        rows: impl Iterator<Item = Vec<(usize, Vector3<f64>)>>,
    ) {
        self.add_rows(rows);
        let root = symmetric_root(covariance);
        let count = covariance.nrows();
        self.groups
            .push((self.unknowns, Spread::Joint(&root * root.transpose(), root)));
        self.unknowns += count;
    }

    fn add_rows(&mut self, rows: impl Iterator<Item = Vec<(usize, Vector3<f64>)>>) {
        let first = self.unknowns;
        for (all, new) in self.rows.iter_mut().zip(rows) {
            all.extend(new.into_iter().map(|(k, by)| (first + k, by)));
        }
    }

    /// L_i' times a column for each displacement of the stone, added to `to`.
    pub fn add_transposed<C: Dim>(&self, stone: usize, x: &OMatrix<f64, U3, C>, to: &mut OMatrix<f64, Dyn, C>)
    where
        DefaultAllocator: Allocator<U3, C> + Allocator<Dyn, C> + Allocator<U1, C>,
    {
        for (k, by) in &self.rows[stone] {
            let mut row = to.row_mut(*k);
            row += by.transpose() * x;
        }
    }

    /// L_i times values of the unknowns.
    pub fn at<const C: usize>(
        &self,
        stone: usize,
        u: &OMatrix<f64, Dyn, nalgebra::Const<C>>,
    ) -> nalgebra::SMatrix<f64, 3, C> {
        let mut sum = nalgebra::SMatrix::zeros();
        for (k, by) in &self.rows[stone] {
            sum += by * u.row(*k);
        }
        sum
    }

    pub fn zeros<const C: usize>(&self) -> OMatrix<f64, Dyn, nalgebra::Const<C>> {
        OMatrix::<f64, Dyn, nalgebra::Const<C>>::zeros(self.unknowns)
    }

    /// As many columns of zeros.
    pub fn zero_columns(&self, count: usize) -> DMatrix<f64> {
        DMatrix::zeros(self.unknowns, count)
    }

    /// The covariance of the unknowns times these columns; rows of zeros cost nothing.
    pub fn spread<C: Dim>(&self, x: &OMatrix<f64, Dyn, C>) -> OMatrix<f64, Dyn, C>
    where
        DefaultAllocator: Allocator<Dyn, C> + Allocator<U1, C> + Allocator<C, U1>,
    {
        let mut out = x.clone();
        for (first, spread) in &self.groups {
            if let Spread::Joint(covariance, _) = spread {
                let mut part = out.rows_mut(*first, covariance.nrows());
                part.fill(0.0);
                for (k, column) in covariance.column_iter().enumerate() {
                    let row = x.row(first + k);
                    if row.iter().any(|value| *value != 0.0) {
                        part.ger(1.0, &column, &row.transpose(), 1.0);
                    }
                }
            }
        }
        out
    }

    /// Covariance of a stone's error.
    pub fn covariance(&self, stone: usize) -> Matrix3<f64> {
        let row = &self.rows[stone];
        let mut sum = Matrix3::zeros();
        for (first, spread) in &self.groups {
            match spread {
                Spread::Unit(count) => {
                    let own = row.iter().filter(|(k, _)| (*first..first + count).contains(k));
                    own.for_each(|(_, by)| sum += by * by.transpose());
                }
                Spread::Joint(covariance, _) => {
                    let range = *first..first + covariance.nrows();
                    let own: Vec<_> = row.iter().filter(|(k, _)| range.contains(k)).collect();
                    for (a, of_a) in &own {
                        for (b, of_b) in &own {
                            sum += of_a * of_b.transpose() * covariance[(a - first, b - first)];
                        }
                    }
                }
            }
        }
        sum
    }

    /// Values of the unknowns drawn at random.
    pub fn draw(&self, random: &mut Random) -> DVector<f64> {
        let mut u = DVector::zeros(self.unknowns);
        for (first, spread) in &self.groups {
            match spread {
                Spread::Unit(count) => u
                    .rows_mut(*first, *count)
                    .iter_mut()
                    .for_each(|v| *v = random.normal()),
                Spread::Joint(_, root) => {
                    let z = DVector::from_fn(root.ncols(), |_, _| random.normal());
                    u.rows_mut(*first, root.nrows()).copy_from(&(root * z));
                }
            }
        }
        u
    }
}

/// A root of a covariance, one column for each of its eigenvectors.
pub(super) fn symmetric_root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = (0.5 * (covariance + covariance.transpose())).symmetric_eigen();
    let roots = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    eigen.eigenvectors * DMatrix::from_diagonal(&roots)
}
