//! A stone's motion, and how it departs from its neighbours', with looseness averaged out.

use super::candidate::Moving;
use super::field::{Prediction, covariance_against, posterior};
use super::observation::NormalEquations;
use super::solution::Solution;
use super::state::{Adjustment, StoneState};
use super::stone_vector::StoneVector;
use crate::switches::is_on;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// Probability, before its observations, that a stone beside a crack moves with the other side: cracks follow joints, and
/// the line that stands for one cuts off the corners.
const ACROSS: f64 = 0.1;

/// A stone's motion with its looseness averaged out, in its frame.
pub(crate) struct Estimate {
    /// About the common motion.
    pub mean: StoneVector,
    pub covariance: Matrix6<f64>,
    /// Covariance of the translation against what the neighbours predict, m^2.
    pub relative_covariance: Matrix3<f64>,
    /// Probability with which it counts that the stone moves with the field.
    pub p_tied: f64,
    /// Derivative of the motion with respect to the motion of the field at the stone.
    pub by_field: Matrix6<f64>,
}

/// What holds of a stone if it moved in one of the ways that are possible.
struct Case {
    probability: f64,
    /// Logarithm of the density of the stone's observations in this case.
    log_evidence: f64,
    mean: StoneVector,
    covariance: Matrix6<f64>,
    relative_covariance: Matrix3<f64>,
    by_field: Matrix6<f64>,
}

impl Case {
    fn of_probability(self, probability: f64) -> Self {
        Self { probability, ..self }
    }
}

impl Adjustment {
    /// A stone's motion about the common motion.
    ///
    /// Where the stone is not followed on its own, it moves with its neighbours. Otherwise mean and covariance are those
    /// of the mixture of three cases: it moves with the field, it is loose, or its clouds show it at a wrong place, and
    /// only photos and neighbours say where it is. Beside a crack, the field is a mixture of that of either side.
    ///
    /// `shared`: variances of errors that a stone's points share, against its neighbours; they are in the
    /// relative covariance. `across_m`: by how much the stones beyond a crack beside it moved more, in its frame.
    pub fn estimate(
        &self,
        i: usize,
        solution: &Solution,
        shared: &[f64; 6],
        across_m: Option<&Vector3<f64>>,
    ) -> Estimate {
        let (stone, equations) = (&self.stones[i], &solution.equations[i]);
        let prediction = &solution.field.from_others[i];
        // What counts as an error might be a motion after all.
        let slide_m2 = self.undetected_slide_m(i).powi(2);

        let case = |prediction: &Prediction, equations: &NormalEquations, own: &[f64; 6], slide_m2: f64| {
            let found = posterior(equations, prediction, own);
            let mut covariance = found.covariance;
            let mut relative_covariance = covariance_against(&found, prediction, own, shared);
            for k in 0..2 {
                covariance[(k, k)] += slide_m2;
                relative_covariance[(k, k)] += slide_m2;
            }
            Case {
                probability: 1.0,
                log_evidence: found.log_evidence,
                mean: found.mean,
                covariance,
                relative_covariance,
                by_field: by_field(equations, own),
            }
        };
        let own = self.prior.own_variances();

        let here = case(prediction, &equations.with_field, &own, slide_m2);
        let tied = match across_m {
            None => vec![here],
            Some(across_m) => {
                let beyond = case(&prediction.moved(across_m), &equations.with_field, &own, slide_m2);
                let log_odds = beyond.log_evidence - here.log_evidence + (ACROSS / (1.0 - ACROSS)).ln();
                let p_across = 1.0 / (1.0 + (-log_odds).exp());
                vec![
                    here.of_probability(1.0 - p_across),
                    beyond.of_probability(p_across),
                ]
            }
        };
        let Some(at_own) = equations.on_own.as_ref().filter(|_| stone.on_own.is_some()) else {
            return Estimate::of(&tied, 1.0);
        };
        let (p_loose, p_wrong) = (self.p_loose(stone), stone.p_wrong());
        let p_tied = 1.0 - p_loose - p_wrong;
        let photos = self.observed_by_photos(i, Moving::WithField);

        let without_clouds = photos.unwrap_or_else(NormalEquations::nothing);
        let scaled = |case: Case| Case {
            probability: p_tied * case.probability,
            ..case
        };
        let mut cases: Vec<Case> = tied.into_iter().map(scaled).collect();
        let loose = case(prediction, at_own, &self.prior.loose_variances(), 0.0);
        let wrong = case(prediction, &without_clouds, &own, slide_m2);
        cases.extend([loose.of_probability(p_loose), wrong.of_probability(p_wrong)]);
        Estimate::of(&cases, p_tied)
    }

    /// By how much the stones beyond a crack beside each stone moved more than it, in its frame; `None` for a stone with
    /// no crack beside it.
    pub fn moved_across(&self, solution: &Solution) -> Vec<Option<Vector3<f64>>> {
        let (graph, state) = (&self.prior.graph, &solution.field.state);
        let mut sums = vec![(Vector3::zeros(), 0.0); self.stones.len()];
        for (edge, tie) in graph.edges.iter().zip(&self.prior.ties) {
            if tie.is_parted && is_on("across") {
                for (i, j) in [(edge.low, edge.high), (edge.high, edge.low)] {
                    let weight = self.stones[j].p_with_field;
                    sums[i].0 += (state[j].displacement() - state[i].displacement()) * weight;
                    sums[i].1 += weight;
                }
            }
        }
        let mean = |(i, (sum, weight)): (usize, (Vector3<f64>, f64))| {
            (weight > 0.0).then(|| graph.nodes[i].face_from_world * sum / weight)
        };
        sums.into_iter().enumerate().map(mean).collect()
    }

    /// Probability that a stone is loose; where its own observations are too weak to tell, what is expected of any
    /// stone.
    pub fn p_loose(&self, stone: &StoneState) -> f64 {
        match stone.decides {
            true => (1.0 - stone.p_with_field) * (1.0 - stone.doubt),
            false => self.prior.loose.share,
        }
    }
}

impl Estimate {
    /// Mean and covariance over these cases; `p_tied`: probability of those with the field.
    fn of(cases: &[Case], p_tied: f64) -> Self {
        let mut mean = StoneVector::zeros();
        for case in cases {
            mean = mean + case.mean.scaled(case.probability);
        }
        let mut sum = Self {
            mean,
            covariance: Matrix6::zeros(),
            relative_covariance: Matrix3::zeros(),
            p_tied,
            by_field: Matrix6::zeros(),
        };
        for case in cases {
            let p = case.probability;
            let apart = *(case.mean - mean).unknowns();
            let between = apart * apart.transpose();
            sum.covariance += (case.covariance + between) * p;
            sum.relative_covariance += (case.relative_covariance + between.fixed_view::<3, 3>(0, 0)) * p;
            sum.by_field += case.by_field * p;
        }
        sum
    }
}

/// Derivative of a stone's motion with respect to the field's motion. W are the variances of the stone's own
/// motion, H is the information of its observations. The stone departs from the field by (H + W^-1)^-1 H
/// times the difference that its observations show, so it follows the field with the share (I + W H)^-1.
pub(crate) fn by_field(equations: &NormalEquations, own: &[f64; 6]) -> Matrix6<f64> {
    let own = Matrix6::from_diagonal(&Vector6::from(*own));
    (Matrix6::identity() + own * equations.information)
        .try_inverse()
        .unwrap_or_else(Matrix6::identity)
}

#[cfg(test)]
mod tests {
    use super::super::equations::StoneEquations;
    use super::super::field::VarianceComponents;
    use super::super::testing::{COLUMNS, begun, wall};
    use super::*;
    use crate::registration::points::MemoryPairs;

    /// A stone in the first column right of the middle.
    const BESIDE: usize = 20;
    /// Standard deviation of what a stone shows of its motion, metres.
    const SD_M: f64 = 1e-3;

    /// A wall that is parted in the middle: what each stone shows of its motion, and the field.
    fn cracked(motion: impl Fn(usize) -> Vector3<f64>) -> (Adjustment, Solution) {
        let source = MemoryPairs::new(wall(8, [0.001; 2], |_| Vector3::zeros()));
        let (mut adjustment, _) = begun(&source);
        let prior = &mut adjustment.prior;
        for (edge, tie) in prior.graph.edges.iter().zip(&mut prior.ties) {
            tie.is_parted = is_right(edge.low) != is_right(edge.high);
        }
        prior.components = VarianceComponents {
            drift: [1e-4; 2],
            strain: [1e-4; 2],
            own_m: 2e-6,
            error_m: 2e-6,
            ..VarianceComponents::start()
        };
        let of_stone = |i: usize| {
            let moved = motion(i) - adjustment.prior.common_in(i).translation();
            let weight = SD_M.powi(-2);
            let weights = Vector6::from([weight, weight, weight, 1e4, 1e4, 1e4]);
            let information = Matrix6::from_diagonal(&weights);
            let with_field = NormalEquations {
                vector: information * StoneVector::from_translation(moved).unknowns(),
                information,
                constant: 0.0,
            };
            StoneEquations {
                with_field,
                on_own: None,
            }
        };
        let equations: Vec<StoneEquations> = (0..adjustment.stones.len()).map(of_stone).collect();
        let field = adjustment.solve(&equations).unwrap();
        (adjustment, Solution { equations, field })
    }

    fn is_right(stone: usize) -> bool {
        stone as u32 % COLUMNS >= COLUMNS / 2
    }

    /// The right half sank by 4 mm, all but one stone of it.
    fn sank(stone: usize) -> Vector3<f64> {
        let has_sunk = is_right(stone) && stone != BESIDE;
        Vector3::new(0.0, if has_sunk { -0.004 } else { 0.0 }, 0.0)
    }

    #[test]
    fn a_stone_beside_a_crack_that_moved_with_its_other_side_is_shown_there() {
        let (adjustment, solution) = cracked(sank);
        let across = adjustment.moved_across(&solution);
        let shared = adjustment.shared_variances(1.0);
        for (i, across_m) in across.iter().enumerate() {
            let column = i as u32 % COLUMNS;
            assert_eq!(across_m.is_some(), [3, 4].contains(&column), "{i}");
            let estimate = adjustment.estimate(i, &solution, &shared, across_m.as_ref());
            let up = (estimate.mean + adjustment.prior.common_in(i)).translation().y;
            let error = up - sank(i).y;
            let sd = estimate.covariance[(1, 1)].sqrt();
            assert!(error.abs() < 3.0 * sd && error.abs() < 1e-3, "{i}: {error} {sd}");
        }
        let alone = adjustment.estimate(BESIDE, &solution, &shared, None);
        let up = (alone.mean + adjustment.prior.common_in(BESIDE)).translation().y;
        assert!(up < -0.002, "{up}");
    }

    #[test]
    fn a_stone_beside_a_crack_that_nothing_shows_is_on_its_other_side_in_one_case_of_ten() {
        let (adjustment, mut solution) = cracked(sank);
        let stone = COLUMNS as usize * 3 + 3;
        solution.equations[stone].with_field = NormalEquations::nothing();
        let shared = adjustment.shared_variances(1.0);
        let across_m = Vector3::new(0.001, -0.004, 0.002);
        let estimate = |across_m| adjustment.estimate(stone, &solution, &shared, across_m);
        let (without, with) = (estimate(None), estimate(Some(&across_m)));
        let moved = (with.mean - without.mean).translation();
        assert!((moved - across_m * 0.1).norm() < 1e-9, "{moved}");
        let added = (with.covariance - without.covariance)
            .fixed_view::<3, 3>(0, 0)
            .into_owned();
        let expected = across_m * across_m.transpose() * 0.09;
        assert!(
            (added - expected).norm() < 1e-6 * expected.norm(),
            "{added} {expected}"
        );
    }
}
