//! Errors that stones share, as columns: displacements of the stones by independent unknowns of variance one.

use crate::geometry::lever;
use nalgebra::{Matrix3xX, Matrix6, Point3, Vector3};

/// Share of the largest information below which stones do not show a rigid motion, such as a turn about their line.
const LEAST_SHOWN: f64 = 1e-4;
/// Root mean square over the stones of what the modes that are left out add up to, metres: far below what the best
/// scans show. A share of the variance would not do: beside a mode of 20 mm, a thousandth of it is 0.6 mm.
const LEFT_OUT_M: f64 = 2e-5;

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

/// The same covariance by as few unknowns as hold nearly all of it ([`LEFT_OUT_M`]).
pub(crate) fn main_modes(apart: &[Matrix3xX<f64>]) -> Vec<Matrix3xX<f64>> {
    let products = apart.iter().map(|by| by.transpose() * by);
    let Some(squares) = products.reduce(|sum, product| sum + product) else {
        return Vec::new();
    };
    let eigen = squares.symmetric_eigen();
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let most = apart.len() as f64 * LEFT_OUT_M.powi(2);
    let mut left: f64 = eigen.eigenvalues.iter().sum();
    let is_needed = |k: &usize| {
        let is_needed = left > most;
        left -= eigen.eigenvalues[*k];
        is_needed
    };
    let kept: Vec<usize> = order.into_iter().take_while(is_needed).collect();
    let modes = eigen.eigenvectors.select_columns(&kept);
    apart.iter().map(|by| by * &modes).collect()
}
