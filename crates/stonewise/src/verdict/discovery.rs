//! Which of many tests are discoveries, with the share of false ones controlled.

/// The smallest false discovery rate at which each test counts as a discovery, in the order given; p values that are no numbers count as 1.
///
/// Source: Benjamini & Hochberg 1995, "Controlling the false discovery rate"; as adjusted values by Yekutieli & Benjamini 1999:
/// q of the k-th smallest of n is the least of n p / j over all j >= k. Holds where tests are independent or positively dependent, such as those
/// of stones that share an error. Cost: O(n log n).
pub(super) fn q_values(p_values: &[f64]) -> Vec<f64> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::interval::Estimate;
    use crate::verdict::testing::Normal;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn the_published_example_has_four_discoveries() {
        // Benjamini & Hochberg 1995, section 3.
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719,
            0.6528, 0.7590, 1.0,
        ];
        let q = q_values(&p);
        assert_eq!(q.iter().filter(|q| **q <= 0.05).count(), 4);
        // R: p.adjust(p, "BH")[c(1, 5, 10)].
        for (i, expected) in [(0, 0.0015), (4, 0.060_3), (9, 0.486)] {
            assert!((q[i] - expected).abs() < 1e-12, "{}", q[i]);
        }
        assert!(q_values(&[]).is_empty());
        assert_eq!(q_values(&[f64::NAN, 1e-9]), [1.0, 2e-9]);
    }

    #[test]
    fn at_most_five_percent_of_the_stones_said_to_move_stand_still() {
        let (mut normal, mut shares) = (Normal::new(9), Vec::new());
        for _ in 0..300 {
            // A tenth of 200 stones moves by four standard deviations.
            let p: Vec<f64> = (0..200)
                .map(|i| {
                    let moved = Vector3::x() * if i < 20 { 4.0 } else { 0.0 };
                    Estimate {
                        vector: moved + normal.vector(),
                        covariance: Matrix3::identity(),
                    }
                    .p_value()
                })
                .collect();
            let found: Vec<usize> = (0..200)
                .zip(q_values(&p))
                .filter(|(_, q)| *q <= 0.05)
                .map(|(i, _)| i)
                .collect();
            let false_ones = found.iter().filter(|i| **i >= 20).count();
            shares.push(false_ones as f64 / found.len().max(1) as f64);
        }
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        // 5 % times the share that stands still, with four standard errors of 300 walls.
        assert!(mean < 0.045 + 0.015, "{mean}");
        assert!(mean > 0.02, "{mean}: nothing was tested");
    }
}
