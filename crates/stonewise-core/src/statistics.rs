//! Order statistics and mixed bits that several modules share.

use nalgebra::Vector3;
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};
use std::f64::consts::TAU;

/// From this many degrees of freedom on, Student's quantile follows from the normal one by an expansion to 5e-5
/// of its size; below, it is sought numerically, which takes longer.
const EXPANDED_FROM: f64 = 12.0;
/// Cumulative probability at the upper end of a 95 % interval.
pub(crate) const UPPER_95: f64 = 0.975;

/// Standard deviations of an offset that a test with a significance level of 0.1 % finds with a power of 80 % (Baarda
/// 1968): the two-sided quantile of the normal distribution, 3.29, and the one-sided one, 0.84.
pub const NONCENTRALITY: f64 = 4.13;

/// The upper median: of an even number of values the larger of the two in the middle. `None` without values.
///
/// Reorders the values. Cost: O(n).
pub fn upper_median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The median: of an even number of values the mean of the two in the middle. `None` without values.
///
/// Sorts the values. Cost: O(n log n).
pub fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[half]),
        _ => Some(0.5 * (values[half - 1] + values[half])),
    }
}

/// Upper median of each component; zero without vectors.
pub fn component_median(vectors: &[Vector3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let mut values: Vec<f64> = vectors.iter().map(|v| v[axis]).collect();
        upper_median(&mut values).unwrap_or(0.0)
    })
}

/// Quantile `q` (0..1) of ascending values, interpolated between order statistics; NaN without values.
///
/// Source: Hyndman & Fan 1996, definition 7.
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    if sorted.is_empty() {
        return f64::NAN;
    }
    let at = q * (sorted.len() - 1) as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    sorted[low] + (sorted[high] - sorted[low]) * (at - low as f64)
}

/// Squared standardised length of three components beyond which Tukey's biweight is zero: the 99 % quantile of
/// chi-square with three degrees of freedom.
const REJECTED: f64 = 11.34;
/// Share of all that at least counts as congruent, and that quantile of chi-square with three degrees of freedom.
const LEAST_PART: f64 = 0.25;
const LOWER_QUARTILE: f64 = 1.2125;

/// Share of its weight with which something of this squared standardised length counts (Tukey's biweight).
pub(crate) fn biweight(square: f64) -> f64 {
    (1.0 - square / REJECTED).max(0.0).powi(2)
}

/// The loss of which [`biweight`] is the weight, from 0 to 1.
pub(crate) fn biweight_loss(square: f64) -> f64 {
    1.0 - (1.0 - square / REJECTED).max(0.0).powi(3)
}

/// By how much squared standardised lengths exceed what is expected, at least 1: that of the most congruent quarter.
/// `None` without lengths.
pub(crate) fn congruent_scale(squares: impl Iterator<Item = f64>) -> Option<f64> {
    let mut squares: Vec<f64> = squares.collect();
    let rank = ((squares.len() as f64 * LEAST_PART) as usize).min(squares.len().checked_sub(1)?);
    let (_, quartile, _) = squares.select_nth_unstable_by(rank, f64::total_cmp);
    Some((*quartile / LOWER_QUARTILE).max(1.0))
}

/// A well-mixed number from a counter or a key.
///
/// Source: SplitMix64 (Steele, Lea & Flood 2014).
pub fn split_mix(counter: u64) -> u64 {
    let z = counter.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Two standard normal numbers, independent of each other, from two that are uniform in 0..1.
///
/// Source: Box & Muller 1958.
pub fn normal_pair([u, v]: [f64; 2]) -> [f64; 2] {
    let size = (-2.0 * (1.0 - u).ln()).sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    [size * cos, size * sin]
}

/// The smallest false discovery rate at which each test counts as a discovery, in the order given; p values
/// that are no numbers count as 1.
///
/// Source: Benjamini & Hochberg 1995, "Controlling the false discovery rate"; as adjusted values by Yekutieli
/// & Benjamini 1999: q of the k-th smallest of n is the least of n p / j over all j >= k. Holds where tests
/// are independent or positively dependent, such as those of stones that share an error. Cost: O(n log n).
pub fn q_values(p_values: &[f64]) -> Vec<f64> {
    let p = |i: usize| if p_values[i].is_nan() { 1.0 } else { p_values[i] };
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p(a).total_cmp(&p(b)));
    let mut q = vec![1.0; p_values.len()];
    let mut least: f64 = 1.0;
    for (rank, &i) in order.iter().enumerate().rev() {
        least = least.min(p(i) * p_values.len() as f64 / (rank + 1) as f64);
        q[i] = least;
    }
    q
}

/// Tests that count as discoveries when the false discovery rate is to be at most `rate`, ascending. `None`:
/// no test was made.
pub fn discoveries(p_values: &[Option<f64>], rate: f64) -> Vec<usize> {
    let tested: Vec<usize> = (0..p_values.len()).filter(|&i| p_values[i].is_some()).collect();
    let q = q_values(&p_values.iter().flatten().copied().collect::<Vec<f64>>());
    let found = tested.into_iter().zip(q).filter(|(_, q)| *q <= rate);
    found.map(|(i, _)| i).collect()
}

/// Probability that the squares of `freedom` standard normal numbers sum to more than `square`; 1 where `freedom` is 0.
pub fn chi_square_p(square: f64, freedom: usize) -> f64 {
    ChiSquared::new(freedom as f64).map_or(1.0, |law| law.sf(square))
}

/// Student's 97.5 % quantile; `z`: the normal one. The expansion is Abramowitz & Stegun (1964), 26.7.5.
pub(crate) fn student_95(freedom: f64, z: f64) -> f64 {
    if freedom < EXPANDED_FROM {
        return StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |law| law.inverse_cdf(UPPER_95));
    }
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
    ];
    terms.iter().rev().fold(0.0, |sum, term| (sum + term) / freedom) + z
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::Normal;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        let z = Normal::standard().inverse_cdf(UPPER_95);
        // Published two-sided 95 % points of Student's law.
        for (freedom, expected) in [
            (4.0, 2.776),
            (10.0, 2.228),
            (12.0, 2.179),
            (30.0, 2.042),
            (120.0, 1.980),
        ] {
            let found = student_95(freedom, z);
            assert!((found - expected).abs() < 6e-4, "{freedom}: {found}");
        }
        assert_eq!(student_95(f64::INFINITY, z), z);
        let exact = StudentsT::new(0.0, 1.0, EXPANDED_FROM)
            .unwrap()
            .inverse_cdf(UPPER_95);
        assert!((student_95(EXPANDED_FROM, z) / exact - 1.0).abs() < 5e-5);
    }

    #[test]
    fn probabilities_are_those_of_the_table() {
        // Published upper 5 % points of chi-square.
        for (freedom, square) in [(1, 3.841), (3, 7.815), (10, 18.307)] {
            assert!((chi_square_p(square, freedom) - 0.05).abs() < 2e-5);
        }
        assert_eq!((chi_square_p(9.0, 0), chi_square_p(0.0, 3)), (1.0, 1.0));
    }

    #[test]
    fn medians_differ_where_the_number_of_values_is_even() {
        assert_eq!(upper_median(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(upper_median(&mut [5.0, 1.0, 3.0]), Some(3.0));
        assert_eq!(median(&mut [5.0, 1.0, 3.0]), Some(3.0));
        assert_eq!((upper_median(&mut []), median(&mut [])), (None, None));
        let vectors = [
            Vector3::new(1.0, 5.0, 0.0),
            Vector3::new(2.0, 4.0, 9.0),
            Vector3::new(3.0, 6.0, 1.0),
        ];
        assert_eq!(component_median(&vectors), Vector3::new(2.0, 5.0, 1.0));
    }

    #[test]
    fn quantiles_are_interpolated() {
        // numpy.quantile([1, 2, 4, 8], q) for q = 0, 0.4, 0.5 and 1.
        let values = [1.0, 2.0, 4.0, 8.0];
        for (q, expected) in [(0.0, 1.0), (0.4, 2.4), (0.5, 3.0), (1.0, 8.0)] {
            assert!((quantile(&values, q) - expected).abs() < 1e-12);
        }
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn split_mix_repeats_the_published_sequence() {
        // The generator's first outputs for seed 0: its state grows by the golden gamma before each.
        assert_eq!(split_mix(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(split_mix(0x9e37_79b9_7f4a_7c15), 0x6e78_9e6a_a1b9_65f4);
    }

    #[test]
    fn mixed_bits_are_fair_and_neighbours_are_independent() {
        let bit = |i: u64| split_mix(i) & 1;
        let heads = (0..100_000u64).filter(|&i| bit(i) == 0).count();
        let same = (0..100_000u64).filter(|&i| bit(i) == bit(i + 1)).count();
        // Five standard deviations of a binomial count of 100,000.
        assert!(
            heads.abs_diff(50_000) < 800 && same.abs_diff(50_000) < 800,
            "{heads} {same}"
        );
    }

    #[test]
    fn the_published_example_has_four_discoveries() {
        // Benjamini & Hochberg 1995, section 3.
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719,
            0.6528, 0.7590, 1.0,
        ];
        let q = q_values(&p);
        // R: p.adjust(p, "BH")[c(1, 5, 10)].
        for (i, expected) in [(0, 0.0015), (4, 0.060_3), (9, 0.486)] {
            assert!((q[i] - expected).abs() < 1e-12, "{}", q[i]);
        }
        assert!(q_values(&[]).is_empty());
        assert_eq!(q_values(&[f64::NAN, 1e-9]), [1.0, 2e-9]);
        let mut p_values: Vec<Option<f64>> = p.into_iter().rev().map(Some).collect();
        p_values.insert(3, None);
        assert_eq!(discoveries(&p_values, 0.05), [12, 13, 14, 15]);
        assert!(discoveries(&[None, Some(0.2)], 0.05).is_empty());
    }
}
