//! Bodies: the parts of the wall that ties join.

use super::breaks::BROKEN;
use super::state::Adjustment;
use crate::components::components;

/// The body of each stone, 1 the one of most stones.
pub(crate) fn bodies(adjustment: &Adjustment) -> Vec<u32> {
    let graph = &adjustment.prior.graph;
    let mut next = vec![Vec::new(); graph.nodes.len()];
    for (edge, tie) in graph.edges.iter().zip(&adjustment.prior.ties) {
        if !tie.is_parted && tie.weight >= BROKEN {
            next[edge.low].push(edge.high);
            next[edge.high].push(edge.low);
        }
    }
    let mut parts = components(next.len(), |stone| next[stone].iter().copied());
    // Of equally large ones the one with the lowest stone stays first.
    parts.sort_by_key(|part| std::cmp::Reverse(part.len()));
    let mut body = vec![0; next.len()];
    for (number, part) in (1..).zip(&parts) {
        for &i in part {
            body[i] = number;
        }
    }
    body
}

#[cfg(test)]
mod tests {
    use super::super::adjust::adjust;
    use super::super::params::{AdjustmentParams, AdjustmentReport};
    use super::super::testing::wall_apart;
    use crate::progress::Silent;
    use crate::registration::points::MemoryPairs;
    use nalgebra::Vector3;

    const MOTION: Vector3<f64> = Vector3::new(0.0, 0.03, -0.04);

    /// A wall whose stones from `first` on stand 5 m apart and moved on their own.
    fn adjusted(first: u32) -> AdjustmentReport {
        let is_apart = |k| f64::from(u8::from(k >= first));
        let apart = |k| Vector3::new(0.0, 5.0, 0.0) * is_apart(k);
        let pairs = wall_apart(6, [0.001; 2], apart, |k| MOTION * is_apart(k));
        adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap()
    }

    #[test]
    fn stones_that_no_tie_joins_to_the_wall_are_a_body_of_their_own() {
        let report = adjusted(43);
        for (k, result) in report.results.iter().enumerate() {
            assert_eq!(result.body, if k < 43 { 1 } else { 2 });
            let motion = result.motion.as_ref().unwrap();
            let truth = if k < 43 { Vector3::zeros() } else { MOTION };
            assert!((motion.displacement - truth).norm() < 0.001, "{k} {motion:?}");
        }
    }
}
