//! Location and spread of the points of a cylinder.

/// Where a cylinder's points lie along its axis.
pub(super) struct Summary {
    /// Mean or median, metres.
    pub location_m: f64,
    /// Standard deviation or interquartile range, metres; `None` where the degrees of freedom are used up.
    pub spread_m: Option<f64>,
}

/// Mean and standard deviation with divisor n - `ddof`; `None` without values.
pub(super) fn mean_and_deviation(values: &[f64], ddof: u32) -> Option<Summary> {
    if values.is_empty() {
        return None;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let freedom = n - f64::from(ddof);
    Some(Summary {
        location_m: mean,
        spread_m: (freedom > 0.0).then(|| (squares / freedom).sqrt()),
    })
}

/// Median and interquartile range; sorts the values. `None` without values.
pub(super) fn median_and_range(values: &mut [f64]) -> Option<Summary> {
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let [lower, median, upper] = [1, 2, 3].map(|quarters| quartile(values, quarters));
    Some(Summary {
        location_m: median,
        spread_m: Some(upper - lower),
    })
}

/// Hyndman & Fan (1996) definition 2: the inverse of the empirical distribution, averaged where it jumps.
fn quartile(sorted: &[f64], quarters: usize) -> f64 {
    let at = sorted.len() * quarters / 4;
    if (sorted.len() * quarters).is_multiple_of(4) {
        0.5 * (sorted[at - 1] + sorted[at])
    } else {
        sorted[at]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviation_follows_its_divisor() {
        let values = [1.0, 2.0, 3.0, 6.0];
        let sample = mean_and_deviation(&values, 1).unwrap();
        assert_eq!(sample.location_m, 3.0);
        assert!((sample.spread_m.unwrap() - (14.0f64 / 3.0).sqrt()).abs() < 1e-15);
        let population = mean_and_deviation(&values, 0).unwrap();
        assert!((population.spread_m.unwrap() - 3.5f64.sqrt()).abs() < 1e-15);
        assert!(mean_and_deviation(&[1.0], 1).unwrap().spread_m.is_none());
        assert!(mean_and_deviation(&[], 1).is_none());
    }

    #[test]
    fn quartiles_average_only_where_the_distribution_jumps() {
        let even = median_and_range(&mut [4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!((even.location_m, even.spread_m), (2.5, Some(2.0)));
        let odd = median_and_range(&mut [5.0, 1.0, 4.0, 2.0, 3.0]).unwrap();
        assert_eq!((odd.location_m, odd.spread_m), (3.0, Some(2.0)));
        let single = median_and_range(&mut [7.0]).unwrap();
        assert_eq!((single.location_m, single.spread_m), (7.0, Some(0.0)));
    }
}
