//! The rigid motion of the part of the wall that kept its shape, and what stones moved besides.

use super::body::{Body, Matrix3x6};
use super::random::Random;
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use rayon::prelude::*;

/// Squared standardised deformation at which a stone no longer counts (Tukey's biweight; a normal one with three
/// degrees of freedom exceeds it in one of 10,000 cases).
const REJECTED: f64 = 21.0;
/// Median of chi-square with three degrees of freedom.
const MEDIAN: f64 = 2.366;
/// Rounds in which weights and rigid motion follow each other.
const ROUNDS: usize = 6;
/// Triples of stones of which one gives the start, and stones on which each is tried.
const TRIALS: usize = 300;
const TRIED_ON: usize = 300;
/// Least information of a rigid motion, as a share of the largest: below it the stones do not show it.
const LEAST: f64 = 1e-9;

/// The deformation of each stone of a body.
pub(super) struct RigidPart {
    /// Deformation and covariance of each stone, world.
    pub deformations: Vec<(Vector3<f64>, Matrix3<f64>)>,
    /// Squared standardised deformation of each stone.
    pub squares: Vec<f64>,
}

/// Finds the largest congruent part by iteratively reweighted least squares, from the triple of stones whose rigid
/// motion most others share (least median of squares, Rousseeuw 1984).
///
/// Weights are inverse covariances of single stones; the covariance of the result is that of this linear function of
/// all motions, with all correlations. `None` where the numbers fail.
pub(super) fn rigid_part(body: &Body) -> Option<RigidPart> {
    let pattern = body.pattern()?;
    let covariance = body.covariance(&pattern)?;
    let weights: Vec<Matrix3<f64>> = covariance
        .diagonal
        .iter()
        .map(|c| c.cholesky().map_or_else(Matrix3::zeros, |f| f.inverse()))
        .collect();
    let start = most_shared(body, &weights)?;
    let square = |apart: &Vector3<f64>, weight: &Matrix3<f64>| apart.dot(&(weight * apart));
    let mut squares: Vec<f64> = body
        .stones
        .iter()
        .zip(&weights)
        .map(|(s, w)| square(&(s.displacement - s.lever * start), w))
        .collect();
    let mut deformations = Vec::new();
    for _ in 0..ROUNDS {
        // Where less than half of the wall kept its shape, its most congruent half counts.
        let scale = (median_of_firm(body, &squares)? / MEDIAN).max(1.0);
        let share = |(i, q): (usize, &f64)| match body.stones[i].joint.is_loose {
            true => 0.0,
            false => (1.0 - q / (scale * REJECTED)).max(0.0).powi(2),
        };
        let shares: Vec<f64> = squares.iter().enumerate().map(share).collect();
        let mut normal = Matrix6::zeros();
        for ((stone, weight), share) in body.stones.iter().zip(&weights).zip(&shares) {
            normal += stone.lever.transpose() * weight * stone.lever * *share;
        }
        let inverse = inverse(&normal);
        let columns: Vec<Matrix3x6> = body
            .stones
            .iter()
            .zip(&weights)
            .zip(&shares)
            .map(|((stone, weight), share)| weight * stone.lever * inverse * *share)
            .collect();
        let pairs = body.stones.iter().zip(&columns);
        let rigid: Vector6<f64> = pairs.clone().map(|(s, a)| a.transpose() * s.displacement).sum();
        let crossed = covariance.times(&columns);
        let of_rigid: Matrix6<f64> = columns.iter().zip(&crossed).map(|(a, x)| a.transpose() * x).sum();
        let of_stone = |i: usize| {
            let lever = &body.stones[i].lever;
            let with_rigid = crossed[i] * lever.transpose();
            let whole = covariance.diagonal[i] - with_rigid - with_rigid.transpose()
                + lever * of_rigid * lever.transpose();
            (
                body.stones[i].displacement - lever * rigid,
                0.5 * (whole + whole.transpose()),
            )
        };
        deformations = (0..body.stones.len()).into_par_iter().map(of_stone).collect();
        squares = deformations.iter().map(|(d, c)| chi_square(d, c)).collect();
    }
    Some(RigidPart {
        deformations,
        squares,
    })
}

fn median_of_firm(body: &Body, squares: &[f64]) -> Option<f64> {
    let firm = body.stones.iter().zip(squares).filter(|(s, _)| !s.joint.is_loose);
    upper_median(&mut firm.map(|(_, q)| *q).collect::<Vec<f64>>())
}

/// Squared standardised length; zero where the covariance is none.
fn chi_square(deformation: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    covariance
        .cholesky()
        .map_or(0.0, |f| deformation.dot(&f.solve(deformation)))
}

/// Inverse of the information of a rigid motion; motions that stones do not show stay zero.
fn inverse(normal: &Matrix6<f64>) -> Matrix6<f64> {
    let eigen = normal.symmetric_eigen();
    let least = LEAST * eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|v| if v > least { 1.0 / v } else { 0.0 });
    eigen.eigenvectors * Matrix6::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// The rigid motion of the triple of stones about which the median of the others' squared standardised distances is
/// least.
fn most_shared(body: &Body, weights: &[Matrix3<f64>]) -> Option<Vector6<f64>> {
    let firm: Vec<usize> = (0..body.stones.len())
        .filter(|&i| !body.stones[i].joint.is_loose)
        .collect();
    let stride = firm.len().div_ceil(TRIED_ON).max(1);
    let tried_on: Vec<usize> = firm.iter().copied().step_by(stride).collect();
    let mut random = Random::new(1);
    let mut pick = || firm[((random.uniform() * firm.len() as f64) as usize).min(firm.len() - 1)];
    let triples: Vec<[usize; 3]> = (0..TRIALS).map(|_| [pick(), pick(), pick()]).collect();
    let with_median = |triple: &[usize]| {
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for &i in triple {
            let part = body.stones[i].lever.transpose() * weights[i];
            normal += part * body.stones[i].lever;
            right += part * body.stones[i].displacement;
        }
        let rigid = inverse(&normal) * right;
        let mut squares: Vec<f64> = tried_on
            .iter()
            .map(|&i| {
                let apart = body.stones[i].displacement - body.stones[i].lever * rigid;
                apart.dot(&(weights[i] * apart))
            })
            .collect();
        let middle = squares.len() / 2;
        let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
        (*median, rigid)
    };
    let all = with_median(&firm);
    let trials = triples.par_iter().map(|t| with_median(t)).collect::<Vec<_>>();
    let best = trials.into_iter().chain([all]).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, rigid)| rigid)
}
