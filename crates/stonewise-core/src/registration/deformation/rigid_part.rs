//! The rigid motion of the part of the wall that kept its shape, and what stones moved besides.

use super::body::{Body, BodyStone, Covariance, Matrix3x6};
use super::bulge::{MostLikely, add_squares};
use crate::registration::random::Random;
use crate::statistics::{biweight, biweight_loss, congruent_scale};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use rayon::prelude::*;

/// Rounds in which weights and rigid motion follow each other.
const ROUNDS: usize = 6;
/// Triples of stones that are tried as a start, and those that are followed.
const TRIALS: usize = 300;
const FOLLOWED: usize = 20;
/// Share of the size of the largest part from which another part is about as large.
const AS_LARGE: f64 = 0.9;
/// Least information of a rigid motion, as a share of the largest: below it the stones do not show it.
const LEAST: f64 = 1e-9;

/// The deformation of each stone of a body.
pub(super) struct RigidPart {
    /// Deformation and covariance of each stone, world.
    pub deformations: Vec<(Vector3<f64>, Matrix3<f64>)>,
    /// Squared standardised deformation of each stone.
    pub squares: Vec<f64>,
    /// The part of the covariance that allows for what the field has smoothed.
    pub smoothed: Vec<Matrix3<f64>>,
}

impl RigidPart {
    /// Adds to the covariances of the stones of a bulge what the field may have smoothed of it in each direction: a wall
    /// that moves horizontally moves along a battered face as well as out of it. The rest of the wall, which the field
    /// follows, is no evidence of that: it is known no better than the stones' own observations show it.
    pub fn doubt_smoothed(&mut self, body: &Body, bulge: &MostLikely) {
        let mut covariances = vec![Matrix3::zeros(); body.stones.len()];
        add_squares(&mut covariances, body, &bulge.stones, &bulge.smoothed_m2);
        self.widen(&covariances);
    }

    /// Adds to the covariance of each stone what the field may have smoothed there.
    pub fn widen(&mut self, covariances: &[Matrix3<f64>]) {
        for (i, covariance) in covariances.iter().enumerate() {
            self.deformations[i].1 += covariance;
            self.smoothed[i] += covariance;
        }
    }
}

/// Finds the largest congruent part by iteratively reweighted least squares (Tukey's biweight), from the triple of
/// stones from which the loss over all stones becomes least.
///
/// Weights are inverse covariances of single stones; the covariance of the result is that of this linear function of
/// all motions, with all correlations. `None` where the numbers fail.
pub(super) fn rigid_part(body: &Body) -> Option<RigidPart> {
    let pattern = body.pattern()?;
    let covariance = body.covariance(&pattern)?;
    let fit = Fit {
        body,
        firm: (0..body.stones.len())
            .filter(|&i| body.stones[i].is_firm)
            .collect(),
        weights: covariance.diagonal.iter().map(inverse_or_zero).collect(),
        covariance,
    };
    // What all stones share, the datum above all, must not hide how they moved against each other.
    let whole = fit.relative_to(&fit.shares(|_| 1.0));
    let precisions: Vec<Matrix3<f64>> = whole
        .deformations
        .iter()
        .map(|(_, c)| inverse_or_zero(c))
        .collect();
    let start = fit.most_shared(&precisions)?;
    let mut part = RigidPart {
        squares: fit.squares(&start, &precisions),
        ..whole
    };
    for _ in 0..ROUNDS {
        let scale = fit.scale(&part.squares)?;
        part = fit.relative_to(&fit.shares(|i| biweight(part.squares[i] / scale)));
    }
    Some(part)
}

/// Rigid motions of parts of a body.
struct Fit<'a> {
    body: &'a Body<'a>,
    /// The stones that count for the shape of the wall.
    firm: Vec<usize>,
    covariance: Covariance<'a>,
    /// Inverse covariances of single stones.
    weights: Vec<Matrix3<f64>>,
}

impl Fit<'_> {
    /// Share of its weight with which each stone counts.
    fn shares(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut shares = vec![0.0; self.body.stones.len()];
        self.firm.iter().for_each(|&i| shares[i] = of(i));
        shares
    }

    /// By how much squared standardised distances exceed what is expected.
    fn scale(&self, squares: &[f64]) -> Option<f64> {
        congruent_scale(self.firm.iter().map(|&i| squares[i]))
    }

    /// The deformation of all stones relative to those that count.
    fn relative_to(&self, shares: &[f64]) -> RigidPart {
        let (stones, covariance) = (&self.body.stones, &self.covariance);
        let inverse = inverse(&self.normal(shares.iter().copied().enumerate()).0);
        let columns: Vec<Matrix3x6> = stones
            .iter()
            .zip(&self.weights)
            .zip(shares)
            .map(|((stone, weight), share)| weight * stone.lever * inverse * *share)
            .collect();
        let rigid: Vector6<f64> = stones
            .iter()
            .zip(&columns)
            .map(|(s, a)| a.transpose() * s.displacement)
            .sum();
        let crossed = covariance.times(&columns);

        let of_rigid: Matrix6<f64> = columns.iter().zip(&crossed).map(|(a, x)| a.transpose() * x).sum();
        let of_stone = |i: usize| {
            let lever = &stones[i].lever;
            let with_rigid = crossed[i] * lever.transpose();
            let whole = covariance.diagonal[i] - with_rigid - with_rigid.transpose()
                + lever * of_rigid * lever.transpose();
            (
                stones[i].displacement - lever * rigid,
                0.5 * (whole + whole.transpose()),
            )
        };

        let deformations: Vec<_> = (0..stones.len()).into_par_iter().map(of_stone).collect();
        RigidPart {
            squares: deformations.iter().map(|(d, c)| chi_square(d, c)).collect(),
            smoothed: vec![Matrix3::zeros(); deformations.len()],
            deformations,
        }
    }

    /// Normal equations of a rigid motion: stones with how much of their weight they count.
    fn normal(&self, shares: impl Iterator<Item = (usize, f64)>) -> (Matrix6<f64>, Vector6<f64>) {
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for (i, share) in shares {
            let stone = &self.body.stones[i];
            let part = stone.lever.transpose() * self.weights[i] * share;
            normal += part * stone.lever;
            right += part * stone.displacement;
        }
        (normal, right)
    }

    /// Squared distances of the stones from a rigid motion, standardised by these inverse covariances.
    fn squares(&self, rigid: &Vector6<f64>, precisions: &[Matrix3<f64>]) -> Vec<f64> {
        let square = |(stone, precision): (&BodyStone, &Matrix3<f64>)| {
            let apart = stone.displacement - stone.lever * rigid;
            apart.dot(&(precision * apart))
        };
        self.body.stones.iter().zip(precisions).map(square).collect()
    }

    /// The rigid motion closest to stones that count with these shares of their weight.
    fn solved(&self, shares: impl Iterator<Item = (usize, f64)>) -> Vector6<f64> {
        let (normal, right) = self.normal(shares);
        inverse(&normal) * right
    }

    /// The rigid motion that most stones share: triples of stones are tried as a start, the best ones are followed to
    /// the part of the wall that moved like them, and that of the least loss is taken.
    fn most_shared(&self, precisions: &[Matrix3<f64>]) -> Option<Vector6<f64>> {
        let firm = &self.firm;
        let mut random = Random::new(1);
        let mut pick = || firm[((random.uniform() * firm.len() as f64) as usize).min(firm.len() - 1)];
        let triples: Vec<[usize; 3]> = (0..TRIALS).map(|_| [pick(), pick(), pick()]).collect();
        let of_all = self.solved(firm.iter().map(|&i| (i, 1.0)));
        let trials: Vec<(Vector6<f64>, Vec<f64>)> = triples
            .par_iter()
            .map(|triple| self.solved(triple.iter().map(|&i| (i, 1.0))))
            .chain([of_all])
            .map(|rigid| (rigid, self.squares(&rigid, precisions)))
            .collect();
        let scales = trials.iter().filter_map(|(_, squares)| self.scale(squares));
        let scale = scales.reduce(f64::min)?;
        let loss = |squares: &[f64]| -> f64 { firm.iter().map(|&i| biweight_loss(squares[i] / scale)).sum() };

        let mut starts: Vec<(f64, Vector6<f64>)> = trials
            .into_iter()
            .map(|(rigid, squares)| (loss(&squares), rigid))
            .collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let shares = |rigid: &Vector6<f64>| {
            let squares = self.squares(rigid, precisions);
            self.shares(|i| biweight(squares[i] / scale))
        };

        let follow = |(_, start): &(f64, Vector6<f64>)| {
            let mut rigid = *start;
            for _ in 0..ROUNDS {
                rigid = self.solved(shares(&rigid).into_iter().enumerate());
            }
            (loss(&self.squares(&rigid, precisions)), rigid)
        };

        let mut followed: Vec<_> = starts.par_iter().take(FOLLOWED).map(follow).collect();
        followed.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.least_moved(&followed, shares)
    }

    /// The first of these losses and rigid motions, which are sorted; or, where another part of the wall is about as
    /// large and moved less, the motion of that one, as the part that stood still. `shares`: with how much of its
    /// weight each stone counts for a motion.
    fn least_moved(
        &self,
        followed: &[(f64, Vector6<f64>)],
        shares: impl Fn(&Vector6<f64>) -> Vec<f64>,
    ) -> Option<Vector6<f64>> {
        let (least, best) = followed.first()?;
        let of_best = shares(best);
        let is_other = |rigid: &Vector6<f64>| {
            let common: f64 = shares(rigid).iter().zip(&of_best).map(|(a, b)| a.min(*b)).sum();
            common < 0.5 * of_best.iter().sum::<f64>()
        };
        let size = |loss: f64| self.firm.len() as f64 - loss;
        let moved = |rigid: &Vector6<f64>| -> f64 {
            let motion = |&i: &usize| (self.body.stones[i].lever * rigid).norm_squared();
            self.firm.iter().map(motion).sum()
        };
        let rival = followed
            .iter()
            .find(|(loss, rigid)| size(*loss) > AS_LARGE * size(*least) && is_other(rigid));
        match rival {
            Some((_, rigid)) if moved(rigid) < moved(best) => Some(*rigid),
            _ => Some(*best),
        }
    }
}

fn inverse_or_zero(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    covariance.cholesky().map_or_else(Matrix3::zeros, |f| f.inverse())
}

/// Squared standardised length; zero where the covariance is not positive definite.
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
