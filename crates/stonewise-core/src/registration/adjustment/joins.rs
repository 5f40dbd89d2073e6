//! Jumps of the motion that errors of registration cause where scans meet.

use super::state::Adjustment;
use std::collections::{BTreeMap, BTreeSet};

/// Jump that errors of registration may cause along a line where one station ends and another begins, metres: stations of
/// a terrestrial survey are registered to a millimetre.
const AT_SEAM_M: f64 = 1.5e-3;
/// Smallest jump that counts where both sides of a line are seen from the same stations, metres.
const LEAST_M: f64 = 0.5e-3;
/// Change of the shares of sources along a seam of one epoch: one source ends, another begins (root of the sum of squares).
const SEAM: f64 = std::f64::consts::SQRT_2;

impl Adjustment {
    /// The smallest jump of the motion between two sides of the wall that errors of registration do not explain, metres.
    ///
    /// An error of a source moves the points of a stone by its share in them, so that the jump grows with how much the
    /// shares change between neighbours on the two sides, in the mean along the line. Where an epoch has fewer than two
    /// sources, its file may have been joined from several, and any line may be a seam.
    pub fn smallest_jump_m(&self, side: &[bool]) -> f64 {
        if (0..2).any(|epoch| self.sources(epoch) < 2) {
            return AT_SEAM_M;
        }
        let mut changes: [BTreeMap<u32, f64>; 2] = Default::default();
        let mut crossing = 0.0;
        for edge in &self.prior.graph.edges {
            if side[edge.low] == side[edge.high] {
                continue;
            }
            crossing += 1.0;
            let (moved, other) = match side[edge.high] {
                true => (edge.high, edge.low),
                false => (edge.low, edge.high),
            };
            for (stone, sign) in [(moved, 1.0), (other, -1.0)] {
                for (changes, shares) in changes.iter_mut().zip(&self.stones[stone].info.sources) {
                    for (source, share) in shares {
                        *changes.entry(*source).or_default() += sign * share;
                    }
                }
            }
        }
        let squares = changes
            .iter()
            .flat_map(BTreeMap::values)
            .map(|c| (c / crossing).powi(2));
        (AT_SEAM_M * squares.sum::<f64>().sqrt() / SEAM).clamp(LEAST_M, AT_SEAM_M)
    }

    /// Number of sources of an epoch.
    fn sources(&self, epoch: usize) -> usize {
        let shares = self.stones.iter().flat_map(|stone| &stone.info.sources[epoch]);
        shares.map(|(source, _)| *source).collect::<BTreeSet<u32>>().len()
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{COLUMNS, begun, wall};
    use super::*;
    use crate::registration::points::MemoryPairs;
    use nalgebra::Vector3;

    /// The smallest jump between the left and the right half of a wall whose stones have these shares of two stations, in
    /// the first epoch and the second.
    fn smallest_m(shares: impl Fn(usize) -> [Vec<(u32, f64)>; 2]) -> f64 {
        let (mut adjustment, _) = begun(&MemoryPairs::new(wall(4, [0.001; 2], |_| Vector3::zeros())));
        for (i, stone) in adjustment.stones.iter_mut().enumerate() {
            stone.info.sources = shares(i);
        }
        let side: Vec<bool> = (0..adjustment.stones.len()).map(is_right).collect();
        adjustment.smallest_jump_m(&side)
    }

    fn is_right(stone: usize) -> bool {
        stone as u32 % COLUMNS >= COLUMNS / 2
    }

    fn halves() -> Vec<(u32, f64)> {
        vec![(1, 0.5), (2, 0.5)]
    }

    #[test]
    fn a_jump_where_two_stations_meet_must_be_larger_than_one_that_both_see() {
        let seam = |stone: usize| vec![(if is_right(stone) { 2 } else { 1 }, 1.0)];
        let at_seam = smallest_m(|stone| [halves(), seam(stone)]);
        assert!((at_seam - AT_SEAM_M).abs() < 1e-12, "{at_seam}");
        assert_eq!(smallest_m(|_| [halves(), halves()]), LEAST_M);
        // Seven tenths of the points on the left are the first station's, three tenths on the right: the shares of both
        // change by 0.4, where they change by 1 at a seam.
        let leaning = |stone: usize| match is_right(stone) {
            true => vec![(1, 0.3), (2, 0.7)],
            false => vec![(1, 0.7), (2, 0.3)],
        };
        let leaning = smallest_m(|stone| [halves(), leaning(stone)]);
        assert!((leaning - 0.4 * AT_SEAM_M).abs() < 1e-12, "{leaning}");
    }

    #[test]
    fn any_line_may_be_a_seam_of_an_epoch_of_one_source() {
        assert_eq!(smallest_m(|_| [halves(), vec![(1, 1.0)]]), AT_SEAM_M);
        assert_eq!(smallest_m(|_| [Vec::new(), halves()]), AT_SEAM_M);
    }
}
