//! Which stones are loose.

use super::field::posterior;
use super::solution::Solution;
use super::state::Adjustment;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Factor by which the bending's variance is raised in the test for loose stones: a bent face is not a loose
/// stone, so bending is left free.
const BENDING_SLACK: f64 = 100.0;

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
    let p_with_field: Vec<Option<f64>> = adjustment
        .stones
        .iter()
        .map(|s| s.on_own.as_ref().map(|_| s.p_with_field))
        .collect();
    let loose = within_error_rate(&p_with_field, adjustment.params.false_discovery_rate);
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
    let mut own = adjustment.components.own_variances();
    own[6..].iter_mut().for_each(|v| *v *= BENDING_SLACK);
    for (v, shared) in own.iter_mut().zip(adjustment.shared_variances(1.0)) {
        *v += shared;
    }
    let stones = adjustment.stones.iter().zip(&solution.equations);
    stones
        .zip(&solution.field.from_others)
        .map(|((stone, equations), prediction)| {
            let (misfit, freedom) = posterior(&equations.with_field, prediction, &own).misfit;
            let law = ChiSquared::new(freedom as f64).ok()?;
            (freedom > 0 && stone.info.usable).then(|| law.sf(misfit))
        })
        .collect()
}

/// As many stones, in the order of their probability of an error, as keep the mean of that probability within
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
