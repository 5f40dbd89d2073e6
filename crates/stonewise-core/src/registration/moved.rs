//! Which stones moved, when many are tested and share the error of the epochs.

use crate::statistics::{chi_square_p, discoveries};
use nalgebra::{Matrix3, Vector3};

/// For each stone whether it moved, with the false discovery rate at most `rate`. `None`: not measured, and
/// not tested.
///
/// Each motion has its whole covariance, the epochs' error included. Stone by stone, a wall of 200 that
/// stands still has ten stones called moved at 5 %, or all of them where the epochs' error is large by
/// chance; with the rate controlled at most `rate` of such walls has any. Errors that stones share do no
/// harm: the tests are positively dependent (Benjamini & Yekutieli 2001). Source: Benjamini & Hochberg 1995.
pub fn moved_stones(motions: &[Option<(Vector3<f64>, Matrix3<f64>)>], rate: f64) -> Vec<bool> {
    let p_still = |(motion, covariance): &(Vector3<f64>, Matrix3<f64>)| {
        Some(chi_square_p(motion.dot(&covariance.cholesky()?.solve(motion)), 3))
    };
    let p_values: Vec<Option<f64>> = motions.iter().map(|m| m.as_ref().and_then(p_still)).collect();
    let mut moved = vec![false; motions.len()];
    for i in discoveries(&p_values, rate) {
        moved[i] = true;
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use stonewise_testing::normal;

    /// Share of still walls with a stone called moved: with the rate controlled, and stone by stone.
    fn alarms(shared: f64, own: f64) -> [f64; 2] {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let walls = 600;
        let covariance = Matrix3::identity() * (shared * shared + own * own);
        let mut called = [0, 0];
        for _ in 0..walls {
            let mut draw = |sd: f64| Vector3::from_fn(|_, _| sd * normal(&mut rng));
            let common = draw(shared);
            let wall: Vec<_> = (0..60).map(|_| Some((common + draw(own), covariance))).collect();
            let single = |m: &Option<(Vector3<f64>, Matrix3<f64>)>| moved_stones(&[*m], 0.05)[0];
            called[0] += usize::from(moved_stones(&wall, 0.05).contains(&true));
            called[1] += usize::from(wall.iter().any(single));
        }
        called.map(|c| c as f64 / walls as f64)
    }

    #[test]
    fn one_still_wall_in_twenty_has_a_stone_called_moved_whatever_the_stones_share() {
        // 600 walls: 5 % is 3.3 to 6.8 % in 95 % of the cases.
        for (shared, own) in [(0.0, 1.0), (1.0, 0.3), (1.0, 1.0), (1.0, 0.01)] {
            let [controlled, single] = alarms(shared, own);
            assert!(controlled < 0.07, "{shared} {own}: {controlled}");
            assert!(shared > 50.0 * own || single > 0.08, "{shared} {own}: {single}");
        }
    }

    #[test]
    fn stones_that_moved_are_found_and_those_without_a_motion_are_not_called() {
        let covariance = Matrix3::identity();
        let at = |x: f64| Some((Vector3::new(x, 0.0, 0.0), covariance));
        // Chi-square 25 and 16 with three degrees of freedom: p 1.5e-5 and 1.1e-3, of four.
        let found = moved_stones(&[at(0.5), at(5.0), None, at(4.0), at(1.0)], 0.05);
        assert_eq!(found, [false, true, false, true, false]);
        let singular = Some((Vector3::x(), Matrix3::zeros()));
        assert_eq!(moved_stones(&[singular, None], 0.05), [false, false]);
        assert!(moved_stones(&[], 0.05).is_empty());
    }
}
