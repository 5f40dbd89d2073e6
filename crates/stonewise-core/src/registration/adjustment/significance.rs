//! Which stones are loose.

use super::field::{Prediction, posterior};
use super::observation::NormalEquations;
use super::solution::Solution;
use super::state::Adjustment;
use crate::statistics::chi_square_p;

/// A stone tested against its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tested {
    /// Probability of so large a departure where the stone moves with its neighbours; 1 where its points say
    /// nothing.
    pub p_value: f64,
    pub is_loose: bool,
}

/// Finds the stones that moved unlike their neighbours, with the false discovery rate controlled.
///
/// The test is the probability that a stone moved with its neighbours, against that of a motion as loose
/// stones make. A p-value alone is no test: scans show departures of tenths of a millimetre that come from
/// how stations overlap.
pub(crate) fn test_stones(adjustment: &Adjustment, solution: &Solution) -> Vec<Tested> {
    let p_error: Vec<Option<f64>> = adjustment
        .stones
        .iter()
        .map(|s| s.on_own.is_some().then(|| 1.0 - adjustment.p_loose(s)))
        .collect();
    let loose = within_error_rate(&p_error, adjustment.params.false_discovery_rate);
    p_values(adjustment, solution)
        .iter()
        .zip(loose)
        .map(|(p, is_loose)| Tested {
            p_value: p.unwrap_or(1.0),
            is_loose,
        })
        .collect()
}

/// Probability of so large a departure from what the neighbours predict. `None` where a stone's points say
/// nothing.
fn p_values(adjustment: &Adjustment, solution: &Solution) -> Vec<Option<f64>> {
    let mut own = adjustment.prior.own_variances();
    for (v, shared) in own.iter_mut().zip(adjustment.shared_variances(1.0)) {
        *v += shared;
    }
    let stones = adjustment.stones.iter().zip(&solution.equations);
    stones
        .zip(&solution.field.from_others)
        .map(|((stone, equations), prediction)| {
            let p = p_value(&equations.with_field, prediction, &own);
            p.filter(|_| stone.info.usable)
        })
        .collect()
}

/// P-value of one stone with these variances of its own motion.
fn p_value(equations: &NormalEquations, prediction: &Prediction, own: &[f64; 6]) -> Option<f64> {
    let (misfit, freedom) = posterior(equations, prediction, own).misfit;
    (freedom > 0).then(|| chi_square_p(misfit, freedom))
}

/// Selects as many stones, in the order of their probability of an error, as keep the mean of that probability within
/// `rate` (Newton et al. 2004). `None`: not a candidate.
fn within_error_rate(p_error: &[Option<f64>], rate: f64) -> Vec<bool> {
    let mut candidates: Vec<(f64, usize)> = p_error
        .iter()
        .enumerate()
        .filter_map(|(i, p)| Some(((*p)?, i)))
        .collect();
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut chosen = vec![false; p_error.len()];
    let mut errors = 0.0;
    for (k, &(p, i)) in candidates.iter().enumerate() {
        errors += p;
        if errors > rate * (k + 1) as f64 {
            break;
        }
        chosen[i] = true;
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix6, Vector6};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// P-values of stones whose observations follow the model.
    fn simulated() -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut normal = || stonewise_testing::normal(&mut rng);
        let own: [f64; 6] = [1e-8, 1e-8, 4e-8, 1e-6, 1e-6, 1e-6];
        let mut root = Matrix6::from_fn(|_, _| normal());
        let sd = [4e-4, 4e-4, 2e-4, 4e-3, 4e-3, 8e-3];
        for (r, sd) in sd.iter().enumerate() {
            let mut row = root.row_mut(r);
            row *= 0.5 * sd;
        }
        let of_prediction = Matrix6::from_diagonal(&Vector6::from([1e-8, 1e-8, 1e-8, 1e-6, 1e-6, 1e-6]));
        let information = (root * root.transpose()).try_inverse().unwrap();
        (0..4000)
            .map(|_| {
                let mut motion = root * Vector6::from_fn(|_, _| normal());
                for k in 0..6 {
                    motion[k] += normal() * (own[k] + of_prediction[(k, k)]).sqrt();
                }
                let equations = NormalEquations {
                    information,
                    vector: information * motion,
                    constant: 0.0,
                };
                let prediction = Prediction {
                    mean: Vector6::zeros(),
                    covariance: of_prediction,
                };
                p_value(&equations, &prediction, &own).unwrap()
            })
            .collect()
    }

    #[test]
    fn p_values_of_stones_that_follow_the_model_are_uniform() {
        let p = simulated();
        for level in [0.05, 0.3, 0.5, 0.9] {
            let share = p.iter().filter(|&&p| p < level).count() as f64 / p.len() as f64;
            let sampling = (level * (1.0 - level) / p.len() as f64).sqrt();
            assert!((share - level).abs() < 4.0 * sampling, "{level}: {share}");
        }
    }

    #[test]
    fn the_mean_probability_of_an_error_stays_within_the_rate() {
        let p_error = [Some(0.2), None, Some(0.01), Some(0.06), Some(0.01), Some(0.9)];
        // 0.01, 0.01 and 0.06 have a mean of 0.027, with 0.2 it is 0.07.
        assert_eq!(
            within_error_rate(&p_error, 0.05),
            [false, false, true, true, true, false]
        );
        assert_eq!(within_error_rate(&[Some(0.06)], 0.05), [false]);
    }
}
