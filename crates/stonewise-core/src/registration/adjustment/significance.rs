//! Which stones are loose.

use super::state::Adjustment;

/// Finds the stones that moved unlike their neighbours, with the false discovery rate controlled.
///
/// What counts is the probability that a stone moved with its neighbours, against that of a motion as loose
/// stones make. A p-value of its departure is no test: scans show departures of tenths of a millimetre that come
/// from how stations overlap.
pub(crate) fn loose_stones(adjustment: &Adjustment) -> Vec<bool> {
    let p_error: Vec<Option<f64>> = adjustment
        .stones
        .iter()
        .map(|s| s.on_own.is_some().then(|| 1.0 - adjustment.p_loose(s)))
        .collect();
    within_error_rate(&p_error, adjustment.params.false_discovery_rate)
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
