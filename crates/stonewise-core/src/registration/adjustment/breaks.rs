//! Neighbours between which the field of motion is broken.

use super::field::{Edge, Tie};
use super::params::Break;
use super::solution::Solution;
use super::state::Adjustment;
use nalgebra::Vector3;

/// Squared jump over the variance that a whole tie gives it: chance alone exceeds it once in a million ties
/// (chi-square with three degrees of freedom).
const EXCESS: f64 = 30.0;
/// A tie weaker than this is broken: its strain is ten times what the heavy tails of the ties allow.
const BROKEN: f64 = 0.1;
/// Share of a crack's jump that a tie over it must show in the crack's direction to be listed.
const CRACK_SHARE: f64 = 0.5;

/// Ties between stones that are not loose, over which the field jumps: those that a crack parts, and single
/// ones that broke with a jump far beyond what a whole tie allows.
pub(crate) fn find_breaks(
    adjustment: &Adjustment,
    solution: &Solution,
    is_loose: impl Fn(usize) -> bool,
) -> Vec<Break> {
    let state = &solution.field.state;
    adjustment
        .graph
        .edges
        .iter()
        .zip(&adjustment.ties)
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
        return adjustment.cracks.iter().any(|crack| {
            let sign = f64::from(u8::from(crack.side[edge.high])) - f64::from(u8::from(crack.side[edge.low]));
            sign * jump.dot(&crack.jump) > CRACK_SHARE * crack.jump.norm_squared()
        });
    }
    let local = edge.face_from_world * jump;
    let [inside, outside] = adjustment
        .components
        .drift
        .map(|q| q * (edge.length_m.powi(3) / 12.0).sqrt());
    let excess = local.xy().norm_squared() / inside.powi(2) + (local.z / outside).powi(2);
    tie.weight < BROKEN && excess > EXCESS
}
