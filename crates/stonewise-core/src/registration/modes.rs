//! Errors that stones share, as columns: displacements of the stones by independent unknowns of variance one.

use crate::geometry::lever;
use nalgebra::{Matrix3xX, Matrix6, Point3, Vector3};

/// Share of the largest information below which stones do not show a rigid motion, such as a turn about their line.
const LEAST_SHOWN: f64 = 1e-4;
/// Share of the variance that the kept modes hold.
const HELD: f64 = 0.999;

/// The columns without the rigid motion of all stones that is nearest to each. `None` without stones.
pub(crate) fn less_rigid(
    places: impl Iterator<Item = Point3<f64>>,
    mut apart: Vec<Matrix3xX<f64>>,
) -> Option<Vec<Matrix3xX<f64>>> {
    let places: Vec<Point3<f64>> = places.collect();
    let count = places.len().max(1) as f64;
    let middle = Point3::from(places.iter().map(|p| p.coords).sum::<Vector3<f64>>() / count);
    let levers: Vec<_> = places.iter().map(|p| lever(&(p - middle))).collect();
    let normal: Matrix6<f64> = levers.iter().map(|l| l.transpose() * l).sum();
    let eigen = normal.symmetric_eigen();
    let least = LEAST_SHOWN * eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|v| if v > least { 1.0 / v } else { 0.0 });
    let inverse = eigen.eigenvectors * Matrix6::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
    let pulls = levers
        .iter()
        .zip(&apart)
        .map(|(lever, by)| lever.transpose() * by);
    let rigid = inverse * pulls.reduce(|sum, pull| sum + pull)?;
    apart
        .iter_mut()
        .zip(&levers)
        .for_each(|(by, lever)| *by -= lever * &rigid);
    Some(apart)
}

/// The same covariance by as few unknowns as hold nearly all of it.
pub(crate) fn main_modes(apart: &[Matrix3xX<f64>]) -> Vec<Matrix3xX<f64>> {
    let products = apart.iter().map(|by| by.transpose() * by);
    let Some(squares) = products.reduce(|sum, product| sum + product) else {
        return Vec::new();
    };
    let eigen = squares.symmetric_eigen();
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let total: f64 = eigen.eigenvalues.iter().sum();
    let mut held = 0.0;
    let kept: Vec<usize> = order
        .into_iter()
        .take_while(|k| {
            let is_needed = held < HELD * total;
            held += eigen.eigenvalues[*k];
            is_needed
        })
        .collect();
    let modes = eigen.eigenvectors.select_columns(&kept);
    apart.iter().map(|by| by * &modes).collect()
}
