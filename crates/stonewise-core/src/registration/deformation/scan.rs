//! Did the wall move as one rigid body? The most likely bulge of any place, size and direction, against none.
//!
//! A bulge b with amplitude a about a rigid motion: y_i = J_i r + a b_i + E_i z + L_i u + e_i, where the stone's
//! observations give y_i with information M_i, E_i z are errors of the epochs (z of variance one) and L_i u other errors
//! that stones share. With r and z estimated by least squares, z with its prior (which whitens the observations: Aitken
//! 1935), the score of the bulge is s = sum b_i' (v_i - M_i (J_i r + E_i z)), linear in the observations; s^2 / var(s)
//! is twice the log likelihood ratio of the bulge where there is no u. The test statistic is the maximum over all bulges of (|s| - c) / sd(s), where c is the
//! largest contribution of a stone: a bulge must also show in its other stones, so that no single stone is called a
//! deformation of the wall. No variance is estimated under the alternative, so that nothing lies at a bound (compare
//! Self & Liang 1987), and the maximum on a wall that moved as one body is simulated from the same model. Residuals are
//! limited, for the observations and the simulations alike (Huber 1964), so that a stone that moved by itself does not
//! distort the rigid motion.

use super::body::{Body, BodyStone};
use super::bulge::{Bulge, Direction, MostLikely, Score};
use super::found::{LEVEL, OUTSIDE, ZONE_EXTENTS_M};
use super::smoothed::smoothed;
use crate::linalg::root;
use crate::registration::bulges::{self, IN_FACE, OUT, Shape, shapes};
use crate::registration::random::Random;
use crate::statistics::upper_median;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, MatrixXx3, Vector3};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

/// Simulations of a wall that moved as one rigid body.
const SIMULATIONS: usize = 999;
/// A bulge does not count if a rigid motion explains all but this share of its information.
const LEAST_SHARE: f64 = 0.02;
/// Standard deviations by which a bulge must exceed the limit of the test to be found in 95 of 100 cases.
const POWER: f64 = 1.645;
/// Standard deviations up to which the residual of a stone counts: one in a million has more by chance (chi-square, three
/// degrees of freedom).
const LARGEST_RESIDUAL: f64 = 5.538;
/// Rounds in which the rigid motion and what counts of the residuals follow each other.
const ROUNDS: usize = 6;
/// Share of its trace that is added to a covariance in its null directions.
const REGULARISATION: f64 = 1e-9;

/// What the test found.
pub(super) struct Scan {
    /// Probability of so likely a bulge on a wall that moved as one rigid body.
    pub p: f64,
    /// The most likely bulge.
    pub most_likely: MostLikely,
    /// Covariance of what the motions may have smoothed at each stone, world, m^2.
    pub smoothed: Vec<Matrix3<f64>>,
    /// 95 % quantile of the standardised score of the most likely bulge of a still wall, no stone left out.
    pub reach: f64,
    /// See [`super::found::Deformation::detection_limits_m`].
    pub detection_limits_m: [Option<f64>; 3],
    /// See [`super::found::Deformation::limits_in_face_m`].
    pub limits_in_face_m: [Option<f64>; 3],
}

/// Tests a body; `None` where its stones show no bulge.
pub(super) fn scan(body: &Body) -> Option<Scan> {
    let firm: Vec<usize> = (0..body.stones.len())
        .filter(|&i| body.stones[i].is_firm)
        .collect();
    let model = Model::new(body, &firm)?;
    let bulges = bulges(body, &firm, &model);
    let observed: Vec<Vector3<f64>> = body.stones.iter().map(|s| s.vector).collect();
    let beyond = |s: &BodyStone| s.vector - s.information * s.displacement;
    let beyond: Vec<Vector3<f64>> = body.stones.iter().map(beyond).collect();
    let left_over = [observed, beyond].map(|vectors| model.left_over(&vectors));
    let sizes = bulges.iter().map(|b| b.largest(&left_over[0]).without_largest);
    let (largest, place) = sizes.zip(0..).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let most_likely = bulges[place].most_likely(&left_over)?;
    let roots: Vec<Matrix3<f64>> = body.stones.iter().map(|s| root(&s.information)).collect();

    let simulate = |k: usize| {
        let mut random = Random::new(k as u64 + 1);
        let u = body.shared.draw(&mut random);
        let of_stone = |(i, stone): (usize, &BodyStone)| {
            let noise = Vector3::from_fn(|_, _| random.normal());
            stone.information * body.shared.at::<1>(i, &u) + roots[i] * noise
        };
        let vectors: Vec<Vector3<f64>> = body.stones.iter().enumerate().map(of_stone).collect();
        let rest = model.left_over(&vectors);
        bulges
            .iter()
            .map(|b| b.largest(&rest))
            .fold(Score::default(), Score::larger)
    };

    let of_still: Vec<Score> = (0..SIMULATIONS).into_par_iter().map(simulate).collect();
    let ascending = |of: fn(&Score) -> f64| {
        let mut sizes: Vec<f64> = of_still.iter().map(of).collect();
        sizes.sort_by(f64::total_cmp);
        sizes
    };
    let still = ascending(|s| s.without_largest);
    let of_most_likely = ascending(|s| s.whole);
    let above = still.iter().filter(|z| **z >= largest).count();
    let simulated = (1 + above) as f64 / (SIMULATIONS + 1) as f64;

    // Beyond what simulations resolve: the sum of the probabilities of all bulges (Bonferroni).
    let tested: usize = bulges.iter().map(|b| b.directions.iter().flatten().count()).sum();
    let sum = 2.0 * tested as f64 * Normal::standard().sf(largest);
    let exceeded_in = |sizes: &[f64], share: f64| sizes[((1.0 - share) * SIMULATIONS as f64) as usize];
    let limit = exceeded_in(&still, LEVEL);
    let limits_m = ZONE_EXTENTS_M.map(|extent_m| model.detection_limits_m(&bulges, extent_m, limit));
    let median = |limits_m: &[[Option<f64>; 3]], directions: &[usize]| {
        let worst = |limits: &[Option<f64>; 3]| {
            let limits: Option<Vec<f64>> = directions.iter().map(|&k| limits[k]).collect();
            limits?.into_iter().reduce(f64::max)
        };
        upper_median(&mut limits_m.iter().filter_map(worst).collect::<Vec<f64>>())
    };

    Some(Scan {
        p: simulated.min(sum),
        most_likely,
        smoothed: smoothed(body, &bulges, &left_over[1]),
        reach: exceeded_in(&of_most_likely, OUTSIDE),
        detection_limits_m: limits_m.each_ref().map(|limits| median(limits, &[OUT])),
        limits_in_face_m: limits_m.each_ref().map(|limits| median(limits, &IN_FACE)),
    })
}

/// What all stones but loose ones have in common, by least squares: a rigid motion, and the errors of the epochs with
/// their prior. What they explain of the observations is no bulge, and a bulge that they do not explain is found however
/// large they are.
struct Model<'a> {
    body: &'a Body<'a>,
    firm: &'a [usize],
    /// Displacement of each stone by what is common: six unknowns of the rigid motion, then errors of variance one.
    by_common: Vec<Matrix3xX<f64>>,
    /// Inverse of the information on what is common.
    inverse: DMatrix<f64>,
    /// Unknowns of the other shared errors times what the common part takes up of them.
    of_shared: DMatrix<f64>,
    /// Variance that these errors give to what the common part takes up.
    shared_of_common: DMatrix<f64>,
    /// Inverse covariance of what the observations of each stone give.
    weights: Vec<Matrix3<f64>>,
}

impl<'a> Model<'a> {
    fn new(body: &'a Body, firm: &'a [usize]) -> Option<Self> {
        let by_common = |(stone, of_epochs): (&BodyStone, &Matrix3xX<f64>)| {
            let mut by = Matrix3xX::zeros(6 + of_epochs.ncols());
            by.columns_mut(0, 6).copy_from(&stone.lever);
            by.columns_mut(6, of_epochs.ncols()).copy_from(of_epochs);
            by
        };
        let by_common: Vec<Matrix3xX<f64>> = body.stones.iter().zip(&body.of_epochs).map(by_common).collect();
        let count = by_common.first()?.ncols();
        let mut information = DMatrix::zeros(count, count);
        (6..count).for_each(|k| information[(k, k)] = 1.0);
        let mut of_shared = body.of_points.zero_columns(count);
        for &i in firm {
            let weighted = body.stones[i].information * &by_common[i];
            information += by_common[i].transpose() * &weighted;
            body.of_points.add_transposed(i, &weighted, &mut of_shared);
        }
        Some(Self {
            body,
            firm,
            by_common,
            inverse: information.try_inverse()?,
            shared_of_common: of_shared.transpose() * body.of_points.spread(&of_shared),
            of_shared,
            weights: (0..body.stones.len()).map(|i| weight(body, i)).collect(),
        })
    }

    /// What the common part leaves over of each stone, in its frame and up to the limit; the common part is found with
    /// what counts.
    fn left_over(&self, vectors: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut common: DVector<f64> = DVector::zeros(self.inverse.nrows());
        let mut rest = vec![Vector3::zeros(); vectors.len()];
        for round in 0..ROUNDS {
            let mut any_limited = false;
            let mut right = DVector::zeros(common.len());
            // The prior of the errors pulls them towards zero.
            (6..common.len()).for_each(|k| right[k] = -common[k]);
            for &i in self.firm {
                let stone = &self.body.stones[i];
                let residual = vectors[i] - stone.information * (&self.by_common[i] * &common);
                let deviations = residual.dot(&(self.weights[i] * residual)).max(0.0).sqrt();
                // The first round finds the motion of all.
                let is_limited = round > 0 && deviations > LARGEST_RESIDUAL;
                any_limited |= is_limited;
                rest[i] = match is_limited {
                    true => residual * (LARGEST_RESIDUAL / deviations),
                    false => residual,
                };
                right.gemv_tr(1.0, &self.by_common[i], &rest[i], 1.0);
            }
            if round > 0 && !any_limited {
                break;
            }
            common += &self.inverse * right;
        }
        for &i in self.firm {
            rest[i] = self.body.stones[i].joint.face_from_world * rest[i];
        }
        rest
    }

    /// What the observations can show in each direction of a bulge of these stones.
    fn directions(&self, stones: &[(usize, f64)]) -> [Option<Direction>; 3] {
        let mut plain = Matrix3::zeros();
        let mut with_common = MatrixXx3::zeros(self.inverse.nrows());
        let mut of_shared = self.body.of_points.zeros::<3>();
        for (i, share) in stones {
            let stone = &self.body.stones[*i];
            let moved = stone.joint.face_from_world.transpose() * *share;
            let weighted = stone.information * moved;
            plain += moved.transpose() * weighted;
            with_common += self.by_common[*i].transpose() * weighted;
            self.body.of_points.add_transposed(*i, &weighted, &mut of_shared);
        }
        let explained = &self.inverse * &with_common;
        let information = plain - with_common.transpose() * &explained;
        // The covariance of the unknowns' part less what the common part takes up, term by term: few unknowns act on
        // the stones of a small bulge, all on the common part.
        let spread = self.body.of_points.spread(&of_shared);
        let both = spread.transpose() * &self.of_shared * &explained;
        let shared = of_shared.transpose() * spread - both - both.transpose()
            + explained.transpose() * &self.shared_of_common * &explained;
        std::array::from_fn(|k| {
            let left = information[(k, k)];
            let variance = left + shared[(k, k)];
            (left > LEAST_SHARE * plain[(k, k)] && variance > 0.0).then(|| Direction {
                score_sd: variance.sqrt(),
                information: left,
                with_common: with_common.column(k).into_owned(),
            })
        })
    }

    /// The smallest amplitude of each bulge of this diameter, in each direction, that is found in 95 of 100 cases if scores
    /// above `limit` are significant. It is the smallest over the nearest bulge of each diameter, its own included:
    /// without its largest stone, a bulge can be easier to detect in the score of another one.
    fn detection_limits_m(&self, bulges: &[Bulge], extent_m: f64, limit: f64) -> Vec<[Option<f64>; 3]> {
        let of_size: Vec<&[Bulge]> = bulges.chunk_by(|a, b| a.diameter_m == b.diameter_m).collect();
        let of_bulge = |bulge: &Bulge| {
            let distance = |other: &Bulge| (other.middle - bulge.middle).norm();
            let nearest = of_size.iter().filter_map(|same| {
                let by_distance = |a: &&Bulge, b: &&Bulge| distance(a).total_cmp(&distance(b));
                same.iter().min_by(by_distance)
            });
            let beside: Vec<&Bulge> = nearest.collect();
            std::array::from_fn(|k| {
                let limits = beside
                    .iter()
                    .filter_map(|scored| self.found_from_m(bulge, scored, k, limit));
                limits.reduce(f64::min)
            })
        };
        let of_extent = bulges.par_iter().filter(|b| b.diameter_m == extent_m);
        of_extent.map(of_bulge).collect()
    }

    /// The amplitude of `moved` that raises the score of `scored`, without its largest stone, above `limit` in 95 of 100
    /// cases; `None` where no amplitude does.
    fn found_from_m(&self, moved: &Bulge, scored: &Bulge, direction: usize, limit: f64) -> Option<f64> {
        let by_moved = moved.directions[direction].as_ref()?;
        let by_scored = scored.directions[direction].as_ref()?;
        let (mut sum, mut largest, mut variance) = (0.0, 0.0, 0.0);
        for (i, share) in &moved.stones {
            let stone = &self.body.stones[*i];
            let axis = stone.joint.face_from_world.row(direction).transpose();
            let information = axis.dot(&(stone.information * axis));
            let of_scored = bulges::share((stone.joint.place - scored.middle).norm(), scored.diameter_m);
            let added = share * of_scored * information;
            sum += added;
            if added > largest {
                (largest, variance) = (added, of_scored * of_scored * information);
            }
        }
        let explained = by_scored
            .with_common
            .dot(&(&self.inverse * &by_moved.with_common));
        let of_one_metre = sum - explained - largest;
        // The errors of the stone that is left out do not count either.
        let sd = (by_scored.score_sd.powi(2) - variance).max(0.0).sqrt();
        (of_one_metre > 0.0).then(|| (limit * by_scored.score_sd + POWER * sd) / of_one_metre)
    }
}

/// The inverse covariance of what the observations of a stone give: of their own errors and of those that stones share.
fn weight(body: &Body, stone: usize) -> Matrix3<f64> {
    let information = body.stones[stone].information;
    let covariance = information + information * body.shared.covariance(stone) * information;
    let regularised = covariance + Matrix3::identity() * (REGULARISATION * covariance.trace());
    regularised.try_inverse().unwrap_or_else(Matrix3::zeros)
}

/// All bulges of a body.
fn bulges(body: &Body, firm: &[usize], model: &Model) -> Vec<Bulge> {
    let bulge = |shape: Shape| Bulge {
        middle: shape.middle,
        directions: model.directions(&shape.stones),
        diameter_m: shape.diameter_m,
        stones: shape.stones,
    };
    let shapes = shapes(firm, |i| body.stones[i].joint.place);
    shapes.into_par_iter().map(bulge).collect()
}
