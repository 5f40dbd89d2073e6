//! Ranks of the truth in what was claimed of it.
//!
//! Where walls are drawn from the prior, the truth has every rank in its posterior equally often (simulation-based
//! calibration: Talts et al. 2018; Modrák et al. 2023). A normal distribution is claimed of a motion, so that its rank
//! among ever more draws is the probability, under the claim, of smaller values.

use super::external_truth::{Owned, Rows, TrueStone};
use super::neighbours;
use super::sample::{EvaluationParams, MotionSample, Z95};
use crate::stone::NeighbourCovariance;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// Ranks along, up and out of the face, 0..1, of the countable stones of a wall.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ranks {
    /// Of motions; none where the datum is unknown.
    pub absolute: Vec<[f64; 3]>,
    /// Of motions less the rigid motion that the stones have in common.
    pub without_datum: Vec<[f64; 3]>,
    /// Of motions of neighbours against each other.
    pub joints: Vec<[f64; 3]>,
}

impl Ranks {
    /// The ranks of one wall; arguments as in [`score_neighbours`](super::score_neighbours).
    pub fn of(
        outcomes: &[Owned],
        stones: &[TrueStone],
        neighbours: &[NeighbourCovariance],
        params: &EvaluationParams,
    ) -> Self {
        let rows = Rows::new(outcomes, stones).of_stone;
        let sample = |stone: &TrueStone| {
            let row = rows.get(&stone.stone_id)?;
            let truth = stone.displacement_at(&row.centroid);
            MotionSample::of_stone(row, &stone.normal, truth, Some(stone.loose))
        };
        let countable = stones.iter().filter(|s| s.is_countable(params));
        let samples: Vec<MotionSample> = countable.filter_map(sample).collect();
        let joints = neighbours::samples(outcomes, stones, neighbours, params);
        let absolute = samples.iter().filter(|s| s.is_absolute);
        Self {
            absolute: absolute.filter_map(ranks).collect(),
            without_datum: MotionSample::without_datum(&samples)
                .iter()
                .filter_map(ranks)
                .collect(),
            joints: joints.iter().filter_map(ranks).collect(),
        }
    }
}

fn ranks(sample: &MotionSample) -> Option<[f64; 3]> {
    let error = sample.error();
    let mut ranks = [0.0; 3];
    for (k, rank) in ranks.iter_mut().enumerate() {
        let sd = sample.half_width_m[k].filter(|half| *half > 0.0)? / Z95;
        *rank = Normal::standard().cdf(-error[k] / sd);
    }
    Some(ranks)
}

/// How ranks that are independent of each other are distributed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RankTest {
    /// Ranks in each of [`Self::BINS`] equal parts of 0..1.
    pub counts: Vec<usize>,
    /// Sum over the parts of the squared departure from the even count over that count.
    pub chi_square: f64,
    /// Probability of a larger one where ranks are even. With equal parts it holds from 15 ranks on (Koehler and Larntz
    /// 1980).
    pub p: f64,
    /// Mean rank; above 0.5 the estimates are too small.
    pub mean: f64,
    /// Share within the central half, which is more where intervals are too wide.
    pub inside_50: f64,
    /// Number outside the 95 % interval.
    pub outside_95: usize,
}

impl RankTest {
    /// Number of parts.
    pub const BINS: usize = 20;

    /// The test of these ranks; `None` where there are none.
    pub fn of(ranks: &[f64]) -> Option<Self> {
        let mut counts = vec![0; Self::BINS];
        for rank in ranks {
            counts[((rank * Self::BINS as f64) as usize).min(Self::BINS - 1)] += 1;
        }
        let n = ranks.len() as f64;
        let even = n / Self::BINS as f64;
        let chi_square = counts.iter().map(|c| (*c as f64 - even).powi(2) / even).sum();
        let outside = |level: f64| ranks.iter().filter(|r| (*r - 0.5).abs() > 0.5 * level).count();
        (!ranks.is_empty()).then(|| Self {
            chi_square,
            p: crate::statistics::chi_square_p(chi_square, Self::BINS - 1),
            mean: ranks.iter().sum::<f64>() / n,
            inside_50: 1.0 - outside(0.5) as f64 / n,
            outside_95: outside(0.95),
            counts,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::StoneOutcome;
    use crate::id::StoneId;
    use nalgebra::{Matrix3, Point3, Vector3};

    #[test]
    fn ranks_are_those_of_the_normal_distribution() {
        // A wall that looks along +x: along it is +y.
        let truth = Vector3::new(0.0, 1.959_964e-3, -0.674_490e-3);
        let outcome = StoneOutcome {
            stone: StoneId(1),
            centroid: Point3::origin(),
            normal: Vector3::x(),
            displacement: Some(Vector3::zeros()),
            covariance: Some(Matrix3::identity() * 1e-6),
            covariance_without_datum: None,
            rotation: None,
            datum_known: true,
            detection_limit_m: None,
            significant: None,
            loose: None,
        };
        let stone = TrueStone {
            stone_id: StoneId(4),
            centroid: Point3::origin(),
            normal: Vector3::x(),
            displacement: truth,
            rotation: Vector3::zeros(),
            loose: false,
            edge: false,
            visible_share: 1.0,
        };
        let params = EvaluationParams::default();
        let of = |datum_known| {
            let outcome = StoneOutcome {
                datum_known,
                ..outcome.clone()
            };
            Ranks::of(
                &[(outcome, Some(StoneId(4)))],
                std::slice::from_ref(&stone),
                &[],
                &params,
            )
        };
        let [along, up, out] = of(true).absolute[0];
        assert!((along - 0.975).abs() < 1e-6 && (up - 0.25).abs() < 1e-6 && (out - 0.5).abs() < 1e-12);
        assert_eq!(of(false), Ranks::default());
    }

    #[test]
    fn the_test_by_hand() {
        // Even ranks; then all in the lowest part, of which 2 were expected: 38^2 / 2 + 19 * 2^2 / 2 = 760.
        let even: Vec<f64> = (0..40).map(|k| (f64::from(k) + 0.5) / 40.0).collect();
        let test = RankTest::of(&even).unwrap();
        assert_eq!((test.chi_square, test.p, test.outside_95), (0.0, 1.0, 2));
        assert!((test.mean - 0.5).abs() < 1e-12 && test.inside_50 == 0.5);
        let low = RankTest::of(&[0.01; 40]).unwrap();
        assert!((low.chi_square - 760.0).abs() < 1e-9 && low.p < 1e-9);
        assert_eq!((low.counts[0], low.inside_50, low.outside_95), (40, 0.0, 40));
        assert_eq!(RankTest::of(&[]), None);
    }
}
