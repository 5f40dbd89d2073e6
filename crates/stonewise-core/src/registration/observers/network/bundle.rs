//! A bundle of photos, as equations for many columns of shifts of image points at once.

use super::sight::{CAMERA, POSE, Sight, intersection, shift};
use crate::geometry::{Camera, View};
use nalgebra::{DMatrix, Matrix2, Matrix2xX, Matrix3xX};
use std::collections::BTreeMap;

/// Ridge on equations scaled to a diagonal of one: it settles the datum of a free bundle and is far below what a tie
/// point says.
const RIDGE: f64 = 1e-10;

/// The normal equations of poses and cameras, the places of tie points eliminated.
pub(super) struct BundleEquations {
    unknowns: BTreeMap<usize, [usize; 2]>,
    normal: DMatrix<f64>,
    /// One column for each column of shifts.
    right: DMatrix<f64>,
}

/// What a bundle takes poses and cameras for.
pub(super) struct Bundle {
    /// First unknown of the pose and of the camera of each photo.
    unknowns: BTreeMap<usize, [usize; 2]>,
    /// One row for each unknown, one column for each column of shifts.
    pub corrections: DMatrix<f64>,
}

impl BundleEquations {
    /// Of these photos, in ascending order. Equal cameras are one. `columns`: number of columns of shifts.
    pub fn new(views: &[&View], photos: &[usize], columns: usize) -> Self {
        let mut cameras: Vec<&Camera> = Vec::new();
        let mut unknowns = BTreeMap::new();
        for (place, photo) in photos.iter().enumerate() {
            let camera = &views[*photo].camera;
            let number = cameras.iter().position(|c| *c == camera).unwrap_or(cameras.len());
            if number == cameras.len() {
                cameras.push(camera);
            }
            unknowns.insert(*photo, [POSE * place, POSE * photos.len() + CAMERA * number]);
        }
        let count = POSE * photos.len() + CAMERA * cameras.len();
        Self {
            unknowns,
            normal: DMatrix::zeros(count, count),
            right: DMatrix::zeros(count, columns),
        }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.normal.nrows()
    }

    /// Right-hand sides.
    pub fn right(&self) -> &DMatrix<f64> {
        &self.right
    }

    /// Adds the sights of a tie point with the shifts of their image points; what is left of the shifts, its place
    /// adjusted. `None` where the rays do not intersect well.
    pub fn add(
        &mut self,
        sights: &[&Sight],
        shifts: impl Fn(&Sight) -> Matrix2xX<f64>,
    ) -> Option<Vec<Matrix2xX<f64>>> {
        let tie = of_photos(sights, &self.unknowns);
        let inverse = intersection(&tie)?;
        let of_place = inverse * shift(&tie, &shifts);
        let rest: Vec<Matrix2xX<f64>> = tie.iter().map(|s| shifts(s) - s.by_place * &of_place).collect();
        for (a, rest) in tie.iter().zip(&rest) {
            self.pull(a, rest);
            for b in &tie {
                let mut between = -(a.by_place * inverse * b.by_place.transpose());
                if a.photo == b.photo {
                    between += Matrix2::identity();
                }
                let [pose, camera] = self.unknowns[&b.photo];
                self.add_product(
                    a,
                    pose,
                    &Matrix2xX::from_column_slice((between * b.by_pose).as_slice()),
                );
                self.add_product(
                    a,
                    camera,
                    &Matrix2xX::from_column_slice((between * b.by_camera).as_slice()),
                );
            }
        }
        Some(rest)
    }

    fn pull(&mut self, sight: &Sight, by: &Matrix2xX<f64>) {
        let [pose, camera] = self.unknowns[&sight.photo];
        let mut rows = self.right.rows_mut(pose, POSE);
        rows += sight.by_pose.transpose() * by;
        let mut rows = self.right.rows_mut(camera, CAMERA);
        rows += sight.by_camera.transpose() * by;
    }

    fn add_product(&mut self, sight: &Sight, column: usize, by: &Matrix2xX<f64>) {
        let [pose, camera] = self.unknowns[&sight.photo];
        let mut block = self.normal.view_mut((pose, column), (POSE, by.ncols()));
        block += sight.by_pose.transpose() * by;
        let mut block = self.normal.view_mut((camera, column), (CAMERA, by.ncols()));
        block += sight.by_camera.transpose() * by;
    }

    /// Solves the equations; directions that no image point shows stay about zero. `None` where the numbers fail.
    pub fn solve(&self) -> Option<Bundle> {
        let scales = self
            .normal
            .diagonal()
            .map(|v| if v > 0.0 { v.sqrt().recip() } else { 0.0 });
        let scaled = DMatrix::from_fn(self.unknowns(), self.unknowns(), |r, c| {
            self.normal[(r, c)] * scales[r] * scales[c] + if r == c { RIDGE } else { 0.0 }
        });
        let scale = |matrix: &mut DMatrix<f64>| {
            matrix
                .column_iter_mut()
                .for_each(|mut column| column.component_mul_assign(&scales));
        };
        let mut corrections = self.right.clone();
        scale(&mut corrections);
        scaled.cholesky()?.solve_mut(&mut corrections);
        scale(&mut corrections);
        Some(Bundle {
            corrections,
            unknowns: self.unknowns.clone(),
        })
    }
}

/// The sights in photos whose unknowns a bundle has.
fn of_photos<'a>(sights: &[&'a Sight], unknowns: &BTreeMap<usize, [usize; 2]>) -> Vec<&'a Sight> {
    let known = sights.iter().copied();
    known.filter(|s| unknowns.contains_key(&s.photo)).collect()
}

impl Bundle {
    /// Displacement of a place that these photos of one epoch see, whose image points shift; `None` where their rays do
    /// not intersect well or the bundle does not hold them.
    pub fn displacement(
        &self,
        sights: &[&Sight],
        shifts: impl Fn(&Sight) -> Matrix2xX<f64>,
    ) -> Option<Matrix3xX<f64>> {
        let known = of_photos(sights, &self.unknowns);
        let inverse = intersection(&known)?;
        let apart = |s: &Sight| {
            let [pose, camera] = self.unknowns[&s.photo];
            shifts(s)
                - s.by_pose * self.corrections.rows(pose, POSE)
                - s.by_camera * self.corrections.rows(camera, CAMERA)
        };
        Some(inverse * shift(&known, apart))
    }
}
