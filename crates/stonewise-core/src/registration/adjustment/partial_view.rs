//! Stones of which one epoch shows a part only, or too few points.
//!
//! Where a mask or the cloud ends within a stone, the part that both epochs show lies at an edge, where clouds are
//! warped and points are mixed, and it may fit at a wrong place as well as a whole face fits at the right one. Such
//! a stone looks loose. How often that happens, the stones themselves show: it is counted how many more of those
//! that are partly seen leave their neighbours.

use crate::statistics::upper_median;

/// Share of stones that fit at a wrong place, of those of which one epoch shows next to nothing, before the
/// stones of the survey count: as many as are expected to be loose.
const EXPECTED: f64 = 0.03;
/// Sum of the squared hidden shares of as many stones as count for that: forty of which half is hidden.
const STONES_EXPECTED: f64 = 10.0;

/// Least hidden share of a stone that counts for the rate. Masks that differ and few points alone hide a fifth, so that
/// stones of which less is hidden do not show whether clouds are wrong or stones are loose.
const PARTLY_HIDDEN: f64 = 0.3;

/// Points across a stone from which on its rims are clear, and below which nothing of them is. A grid of 43 to 113
/// points meets so few places of a rim that stones of still walls seemed to slide by 5 to 20 mm.
const CLEAR: f64 = 15.0;
const LEAST: f64 = 5.0;

/// How often the clouds are wrong, from the hidden share of each stone and the probability that they are wrong about
/// it: one step of expectation maximisation (Dempster, Laird & Rubin 1977), over the stones that are partly hidden. At
/// most one: these may depart from their neighbours for other reasons as well.
pub(super) fn estimated_rate(stones: impl Iterator<Item = (f64, f64)>) -> f64 {
    let partly = stones.filter(|(hidden, _)| *hidden >= PARTLY_HIDDEN);
    let (squares, wrong) = partly.fold((0.0, 0.0), |sum, (hidden, p)| (sum.0 + hidden.powi(2), sum.1 + p));
    ((STONES_EXPECTED * EXPECTED + wrong) / (STONES_EXPECTED + squares)).min(1.0)
}

/// The rate of [`estimated_rate`] before any stone counts.
pub(super) fn expected_rate() -> f64 {
    estimated_rate(std::iter::empty())
}

/// How much less one epoch shows of each stone than is usual in the survey, as a share; `shared`: share of the
/// face that both epochs show, wherever the stone moved.
pub(super) fn hidden(shared: &[f64]) -> Vec<f64> {
    let Some(usual) = upper_median(&mut shared.to_vec()).filter(|u| *u > 0.0) else {
        return vec![0.0; shared.len()];
    };
    shared.iter().map(|s| (1.0 - s / usual).max(0.0)).collect()
}

/// By how much the points across a stone fall short of the number from which on its rims are clear, as a share;
/// `counts`: points in each epoch.
pub(super) fn missing(counts: [usize; 2]) -> f64 {
    let across = counts.map(|n| (n as f64).sqrt());
    ((CLEAR - across[0].min(across[1])) / (CLEAR - LEAST)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_usual_hides_nothing() {
        let found = hidden(&[0.9, 0.9, 0.8, 0.3, 1.0]);
        let expected = [0.0, 0.0, 1.0 / 9.0, 2.0 / 3.0, 0.0];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert_eq!(hidden(&[0.0, 0.0, 0.5]), [0.0; 3]);
        assert!(hidden(&[]).is_empty());
    }

    #[test]
    fn few_points_across_a_stone_hide_its_rims() {
        assert_eq!(missing([25, 1000]), 1.0);
        assert!((missing([400, 100]) - 0.5).abs() < 1e-12);
        assert_eq!(missing([225, 300]), 0.0);
    }

    #[test]
    fn the_rate_is_that_of_the_stones_once_they_are_many() {
        let rate = |stones: usize, wrong: f64| estimated_rate((0..stones).map(|_| (0.5, 0.25 * wrong)));
        assert!((rate(0, 0.0) - 0.03).abs() < 1e-15);
        assert!((rate(40, 0.0) - 0.015).abs() < 1e-15);
        assert!((rate(40_000, 0.4) - 0.4).abs() < 1e-3);
        // Two fifths of each are hidden, and half of them look wrong.
        assert_eq!(estimated_rate((0..1000).map(|_| (0.4, 0.5))), 1.0);
    }

    #[test]
    fn loose_stones_of_which_little_is_hidden_leave_the_rate_as_it_is() {
        // Half of each of 400 stones is hidden, and the clouds are wrong about 20 of them. Of 400 others, all loose, a
        // fifth seems hidden.
        let hidden = |rate: f64| {
            let p_wrong = rate * 0.25 / (rate * 0.25 + 0.01);
            (0..400).map(move |i| (0.5, if i < 20 { p_wrong } else { 0.0 }))
        };
        let loose = |rate: f64| {
            let p_wrong = rate * 0.04 / (rate * 0.04 + 0.01);
            (0..400).map(move |_| (0.2, p_wrong))
        };
        let (mut with, mut without) = (expected_rate(), expected_rate());
        for _ in 0..100 {
            with = estimated_rate(hidden(with).chain(loose(with)));
            without = estimated_rate(hidden(without));
        }
        assert!((without - 0.15).abs() < 0.03, "{without}");
        assert_eq!(with, without);
        // From three tenths on, stones count.
        assert!(estimated_rate(std::iter::once((0.3, 1.0))) > 2.0 * expected_rate());
    }
}
