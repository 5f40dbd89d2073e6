//! One frame for all epochs: the part of the wall that kept its shape over the whole series.

use crate::geometry::lever;
use crate::statistics::{biweight, congruent_scale};
use nalgebra::{Matrix3, Matrix6, Point3, SMatrix, Vector3, Vector6};

/// Rounds of weights.
const ROUNDS: usize = 8;
/// Fewest stones that make a frame.
const LEAST_STONES: usize = 12;

/// Deformations of a stone in all epochs; world, metres.
#[derive(Clone, Debug)]
pub struct SeriesPlace {
    /// Its middle.
    pub place: Point3<f64>,
    /// The deformation with its covariance in each epoch; `None`: not measured.
    pub deformations: Vec<Option<(Vector3<f64>, Matrix3<f64>)>>,
}

/// Brings the deformations of all epochs to one frame.
///
/// Each pair of epochs has a part of the wall of its own that kept its shape. Here every stone has one weight in all
/// epochs (Tukey's biweight of its mean squared standardised deformation), and of each epoch the rigid motion is taken
/// off that is the closest to its deformations with these weights. What moves in proportion to time or level then does
/// so after it too. A part of the wall beyond a crack counts like any other: a frame of its own would take its motion
/// off.
pub fn keep_congruent(stones: &mut [SeriesPlace]) {
    let middle = stones.iter().map(|s| s.place.coords).sum::<Vector3<f64>>() / stones.len().max(1) as f64;
    let middle = Point3::from(middle);
    let epochs = stones.iter().map(|s| s.deformations.len()).max().unwrap_or(0);
    for _ in 0..ROUNDS {
        let mut squares: Vec<f64> = stones.iter().map(mean_square).collect();
        let Some(scale) = congruent_scale(squares.iter().copied()) else {
            return;
        };
        squares.iter_mut().for_each(|q| *q = biweight(*q / scale));
        for epoch in 0..epochs {
            let Some(rigid) = rigid(stones, &squares, &middle, epoch) else {
                continue;
            };
            for stone in stones.iter_mut() {
                let by: SMatrix<f64, 3, 6> = lever(&(stone.place - middle));
                if let Some((deformation, _)) = &mut stone.deformations[epoch] {
                    *deformation -= by * rigid;
                }
            }
        }
    }
}

/// The mean over the epochs of the squared standardised deformation; infinite where none is known.
fn mean_square(stone: &SeriesPlace) -> f64 {
    let square = |(d, c): &(Vector3<f64>, Matrix3<f64>)| Some(d.dot(&c.cholesky()?.solve(d)));
    let all: Vec<f64> = stone.deformations.iter().flatten().filter_map(square).collect();
    match all.is_empty() {
        true => f64::INFINITY,
        false => all.iter().sum::<f64>() / all.len() as f64,
    }
}

/// The rigid motion about `middle` that is closest to the deformations of an epoch.
fn rigid(
    stones: &[SeriesPlace],
    weights: &[f64],
    middle: &Point3<f64>,
    epoch: usize,
) -> Option<Vector6<f64>> {
    let (mut normal, mut right, mut used) = (Matrix6::zeros(), Vector6::zeros(), 0);
    for (stone, weight) in stones.iter().zip(weights) {
        let Some((deformation, covariance)) = stone.deformations[epoch].filter(|_| *weight > 0.0) else {
            continue;
        };
        let Some(information) = covariance.try_inverse() else {
            continue;
        };
        let by: SMatrix<f64, 3, 6> = lever(&(stone.place - middle));
        let weighted = by.transpose() * information * *weight;
        normal += weighted * by;
        right += weighted * deformation;
        used += 1;
    }
    (used >= LEAST_STONES)
        .then(|| normal.cholesky())
        .flatten()
        .map(|n| n.solve(&right))
}
