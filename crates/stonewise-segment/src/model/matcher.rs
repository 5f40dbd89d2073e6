//! Which stone a candidate box stands for.

use super::boxes::{Bounds, iou};

/// What a candidate box is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Match {
    /// The stone at this place.
    Stone(usize),
    /// No stone.
    Background,
    /// Neither: it takes no part.
    Between,
}

/// Matches candidates to stones by IoU: at least `positive` is the stone with the largest, below `negative`
/// is background.
///
/// With `keep_best` the candidates that overlap a stone most, all of them where several tie, are positive
/// whatever the overlap (Ren et al. 2015, section 3.1.2): no stone is without a candidate.
pub fn match_boxes(
    stones: &[Bounds],
    candidates: &[Bounds],
    positive: f32,
    negative: f32,
    keep_best: bool,
) -> Vec<Match> {
    let mut best_of_stone = vec![0.0f32; stones.len()];
    let mut best = vec![(0.0f32, 0usize); candidates.len()];
    for (candidate, best) in candidates.iter().zip(&mut best) {
        for (place, stone) in stones.iter().enumerate() {
            let overlap = iou(*candidate, *stone);
            best_of_stone[place] = best_of_stone[place].max(overlap);
            if overlap > best.0 {
                *best = (overlap, place);
            }
        }
    }

    let is_best = |candidate: &Bounds| {
        stones
            .iter()
            .zip(&best_of_stone)
            .any(|(stone, &most)| most > 0.0 && iou(*candidate, *stone) == most)
    };

    let decide = |(candidate, &(overlap, place)): (&Bounds, &(f32, usize))| {
        if overlap >= positive || (keep_best && overlap > 0.0 && is_best(candidate)) {
            Match::Stone(place)
        } else if overlap < negative {
            Match::Background
        } else {
            Match::Between
        }
    };

    candidates.iter().zip(&best).map(decide).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_and_the_best_candidate() {
        let stones = [[0.0, 0.0, 10.0, 10.0], [100.0, 0.0, 110.0, 10.0]];
        let candidates = [
            [0.0, 0.0, 10.0, 10.0],
            [0.0, 0.0, 10.0, 20.0],
            [0.0, 0.0, 10.0, 50.0],
            [100.0, 0.0, 110.0, 40.0],
            [50.0, 50.0, 60.0, 60.0],
        ];
        let matches = match_boxes(&stones, &candidates, 0.7, 0.3, true);
        let expected = [
            Match::Stone(0),
            Match::Between,
            Match::Background,
            Match::Stone(1),
            Match::Background,
        ];
        assert_eq!(matches, expected);
        assert_eq!(
            match_boxes(&stones, &candidates, 0.7, 0.3, false)[3],
            Match::Background
        );
        assert_eq!(
            match_boxes(&[], &candidates, 0.7, 0.3, true),
            [Match::Background; 5]
        );
    }
}
