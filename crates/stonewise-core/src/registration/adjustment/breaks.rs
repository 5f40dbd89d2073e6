//! Neighbours between which the field of motion is broken.

use super::field::{Edge, FieldVector, Tie, of_tie};
use super::params::Break;
use super::state::Adjustment;
use nalgebra::Vector3;

/// Squared jump over the variance that a whole tie gives it: chance alone exceeds it once in a million ties
/// (chi-square with three degrees of freedom).
const EXCESS: f64 = 30.0;
/// A tie weaker than this is broken: its strain is ten times what the heavy tails of the ties allow.
pub(crate) const BROKEN: f64 = 0.1;
/// Share of a crack's jump that a tie over it must show in the crack's direction to be listed.
const CRACK_SHARE: f64 = 0.5;

/// Ties between stones that are not loose, over which the field jumps: those that a crack parts, and single
/// ones that broke with a jump far beyond what a whole tie allows.
///
/// `state`: the field, per stone.
pub(crate) fn find_breaks(
    adjustment: &Adjustment,
    state: &[FieldVector],
    is_loose: impl Fn(usize) -> bool,
) -> Vec<Break> {
    adjustment
        .prior
        .graph
        .edges
        .iter()
        .zip(&adjustment.prior.ties)
        .filter(|(edge, _)| !is_loose(edge.low) && !is_loose(edge.high))
        .filter_map(|(edge, tie)| {
            let (low, high) = (&state[edge.low], &state[edge.high]);
            let along = 0.5 * (low.gradient_along() + high.gradient_along());
            let up = 0.5 * (low.gradient_up() + high.gradient_up());
            let explained = along * edge.step[0] + up * edge.step[1];
            let jump = high.displacement() - low.displacement() - explained;
            is_broken(adjustment, edge, tie, &jump).then(|| Break {
                from: adjustment.stones[edge.low].info.first,
                to: adjustment.stones[edge.high].info.first,
                jump,
            })
        })
        .collect()
}

fn is_broken(adjustment: &Adjustment, edge: &Edge, tie: &Tie, jump: &Vector3<f64>) -> bool {
    if tie.is_parted {
        return adjustment.prior.cracks.iter().any(|crack| {
            let sign = f64::from(u8::from(crack.side[edge.high])) - f64::from(u8::from(crack.side[edge.low]));
            sign * jump.dot(&crack.jump) > CRACK_SHARE * crack.jump.norm_squared()
        });
    }
    let local = edge.face_from_world * jump;
    let prior = &adjustment.prior;
    let [inside, outside] = of_tie(edge, &prior.components, &prior.least)
        .drift
        .map(|q| q * (edge.length_m.powi(3) / 12.0).sqrt());
    let excess = local.xy().norm_squared() / inside.powi(2) + (local.z / outside).powi(2);
    tie.weight < BROKEN && excess > EXCESS
}

#[cfg(test)]
mod tests {
    use super::super::field::Crack;
    use super::super::testing::{COLUMNS, begun, wall};
    use super::*;
    use crate::registration::adjustment::field::Vector9;
    use crate::registration::points::MemoryPairs;

    /// Motion of the stones right of the middle against the others.
    const JUMP: [f64; 3] = [0.002, -0.004, 0.006];

    fn adjustment() -> Adjustment {
        begun(&MemoryPairs::new(wall(4, [0.001; 2], |_| Vector3::zeros()))).0
    }

    fn is_right(stone: usize) -> bool {
        stone as u32 % COLUMNS >= COLUMNS / 2
    }

    /// A motion with constant gradients, which ties allow; the right half moves by `jump` more.
    fn field(adjustment: &Adjustment, jump: Vector3<f64>) -> Vec<FieldVector> {
        let (along, up) = (
            Vector3::new(0.01, 0.003, -0.002),
            Vector3::new(-0.004, 0.02, 0.001),
        );
        let stone = |i: usize| {
            // The wall lies in the plane x = 0; its frame says which way along and up point.
            let node = &adjustment.prior.graph.nodes[i];
            let place = node.face_from_world * adjustment.stones[i].info.place.centroid.coords;
            let mut d = along * place.x + up * place.y;
            if is_right(i) {
                d += jump;
            }
            let parts = [d, along, up];
            FieldVector::from(Vector9::from_fn(|k, _| parts[k / 3][k % 3]))
        };
        (0..adjustment.stones.len()).map(stone).collect()
    }

    fn crosses(edge: &Edge) -> bool {
        is_right(edge.low) != is_right(edge.high)
    }

    #[test]
    fn a_field_with_constant_gradients_breaks_no_tie_however_weak() {
        let mut adjustment = adjustment();
        adjustment.prior.ties.iter_mut().for_each(|t| t.weight = 1e-6);
        let smooth = field(&adjustment, Vector3::zeros());
        assert!(find_breaks(&adjustment, &smooth, |_| false).is_empty());
    }

    #[test]
    fn weak_ties_over_which_the_field_jumps_are_listed_with_the_jump() {
        let mut adjustment = adjustment();
        let state = field(&adjustment, Vector3::from(JUMP));
        assert!(
            find_breaks(&adjustment, &state, |_| false).is_empty(),
            "ties are whole"
        );
        adjustment.prior.ties.iter_mut().for_each(|t| t.weight = 0.01);
        let breaks = find_breaks(&adjustment, &state, |_| false);
        let expected = adjustment.prior.graph.edges.iter().filter(|e| crosses(e)).count();
        assert!(expected >= 4);
        assert_eq!(breaks.len(), expected);
        for found in &breaks {
            let [from, to] = [found.from, found.to].map(|id| is_right(id.0 as usize - 1));
            let sign = f64::from(u8::from(to)) - f64::from(u8::from(from));
            assert!(
                (found.jump - sign * Vector3::from(JUMP)).norm() < 1e-12,
                "{found:?}"
            );
        }
        // Stone 4 of the lowest row lies right of the jump.
        let without = find_breaks(&adjustment, &state, |i| i == 4);
        assert!(without.len() < breaks.len());
        assert!(without.iter().all(|b| b.from.0 != 5 && b.to.0 != 5));
    }

    #[test]
    fn a_jump_counts_from_the_stated_excess_over_the_variance_of_a_whole_tie() {
        let mut adjustment = adjustment();
        adjustment.prior.ties.iter_mut().for_each(|t| t.weight = 0.01);
        let crossing: Vec<&Edge> = adjustment
            .prior
            .graph
            .edges
            .iter()
            .filter(|e| crosses(e))
            .collect();
        // An integrated random walk of rate q has the variance q^2 L^3 / 12 about its mean gradient.
        let sd_m = |e: &Edge| adjustment.prior.components.drift[1] * (e.length_m.powi(3) / 12.0).sqrt();
        for out_m in [0.5, 0.9, 1.1, 2.0].map(|f| f * (EXCESS.sqrt() * sd_m(crossing[0]))) {
            let state = field(&adjustment, Vector3::new(out_m, 0.0, 0.0));
            let expected = crossing.iter().filter(|e| (out_m / sd_m(e)).powi(2) > EXCESS);
            assert_eq!(
                find_breaks(&adjustment, &state, |_| false).len(),
                expected.count()
            );
        }
    }

    #[test]
    fn a_parted_tie_is_listed_where_it_shows_half_of_the_cracks_jump() {
        let mut adjustment = adjustment();
        let crack = Crack {
            side: (0..adjustment.stones.len()).map(is_right).collect(),
            jump: Vector3::from(JUMP),
        };
        adjustment.prior.part_along(crack);
        let count = |share: f64| {
            let state = field(&adjustment, share * Vector3::from(JUMP));
            find_breaks(&adjustment, &state, |_| false).len()
        };
        let all = adjustment.prior.graph.edges.iter().filter(|e| crosses(e)).count();
        assert_eq!([-1.0, 0.0, 0.45, 0.55, 1.0].map(count), [0, 0, 0, all, all]);
    }
}
