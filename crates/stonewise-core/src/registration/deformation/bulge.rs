//! A bulge of some place and size, and what the observations of its stones show of it.

use crate::registration::bulges::RIM;
use nalgebra::Vector3;

/// A bulge of some place and size in three directions: along, up and out.
pub(super) struct Bulge {
    pub diameter_m: f64,
    /// Stones and by how much of the amplitude they move.
    pub stones: Vec<(usize, f64)>,
    /// Standard deviation of the score, and information on the amplitude, in each direction; `None` where nothing shows
    /// it.
    pub directions: [Option<(f64, f64)>; 3],
}

impl Bulge {
    /// The score of each direction. `rest`: what a rigid motion leaves over of each stone.
    pub fn scores(&self, rest: &[Vector3<f64>]) -> Vector3<f64> {
        self.stones.iter().map(|(i, share)| rest[*i] * *share).sum()
    }

    /// The largest score of any direction in standard deviations.
    pub fn largest(&self, rest: &[Vector3<f64>]) -> f64 {
        let score = self.scores(rest);
        let z = |k: usize| self.directions[k].map_or(0.0, |(sd, _)| score[k].abs() / sd);
        z(0).max(z(1)).max(z(2))
    }

    /// Its stones and amplitude in the direction of the largest score. `left_over`: of the observations, and of what they
    /// show beyond the motions. `None` where nothing shows it.
    pub fn most_likely(&self, left_over: &[Vec<Vector3<f64>>; 2]) -> Option<MostLikely> {
        let [score, smoothed] = left_over.each_ref().map(|rest| self.scores(rest));
        let shown = |k: usize| self.directions[k].map(|(sd, information)| (k, sd, information));
        let size = |(k, sd, _): &(usize, f64, f64)| score[*k].abs() / sd;
        let (direction, sd, information) = (0..3)
            .filter_map(shown)
            .max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let stones = self.stones.iter().filter(|(_, share)| *share > RIM);
        Some(MostLikely {
            stones: stones.copied().collect(),
            direction,
            amplitude_m: (score[direction] / information, sd / information),
            smoothed_m: std::array::from_fn(|k| {
                let (sd, information) = self.directions[k]?;
                Some((smoothed[k] / information, sd / information))
            }),
        })
    }
}

/// The bulge of the largest score.
pub(super) struct MostLikely {
    /// Stones that move by more than a quarter of its amplitude, with their share of it.
    pub stones: Vec<(usize, f64)>,
    /// Its direction: along, up or out.
    pub direction: usize,
    /// Amplitude and its standard deviation, metres.
    pub amplitude_m: (f64, f64),
    /// What the motions show less of a bulge there than the stones' own observations, and the standard deviation of its
    /// amplitude, metres: along, up and out. `None` where nothing shows it.
    pub smoothed_m: [Option<(f64, f64)>; 3],
}
