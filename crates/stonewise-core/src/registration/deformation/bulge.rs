//! A bulge of some place and size, and what the observations of its stones show of it.

use super::body::Body;
use crate::registration::bulges::RIM;
use nalgebra::{DVector, Matrix3, Point3, Vector3};

/// What the observations can show of a bulge's amplitude in one direction.
pub(super) struct Direction {
    /// Standard deviation of the score.
    pub score_sd: f64,
    /// Information on the amplitude: the score of a bulge of one metre.
    pub information: f64,
    /// Cross-information of the amplitude, and of the rigid motion and the errors of the epochs.
    pub with_common: DVector<f64>,
}

impl Direction {
    /// A score in standard deviations.
    pub fn standardised(&self, score: f64) -> f64 {
        score / self.score_sd
    }

    /// Amplitude of this score, metres.
    pub fn amplitude_m(&self, score: f64) -> f64 {
        score / self.information
    }

    /// Standard deviation of the amplitude, metres.
    pub fn amplitude_sd_m(&self) -> f64 {
        self.score_sd / self.information
    }
}

/// An absolute standardised score.
#[derive(Clone, Copy, Default)]
pub(super) struct Score {
    pub whole: f64,
    /// Without its largest stone: the one that adds most to it.
    pub without_largest: f64,
}

impl Score {
    /// The one that is larger without its largest stone.
    pub fn larger(self, other: Self) -> Self {
        match other.without_largest > self.without_largest {
            true => other,
            false => self,
        }
    }
}

/// A bulge of some place and size in three directions: along, up and out.
pub(super) struct Bulge {
    /// Where it is largest.
    pub middle: Point3<f64>,
    pub diameter_m: f64,
    /// Stones and by how much of the amplitude they move.
    pub stones: Vec<(usize, f64)>,
    /// `None` where nothing shows it.
    pub directions: [Option<Direction>; 3],
}

impl Bulge {
    /// The score of each direction. `rest`: what a rigid motion leaves over of each stone.
    pub fn scores(&self, rest: &[Vector3<f64>]) -> Vector3<f64> {
        self.stones.iter().map(|(i, share)| rest[*i] * *share).sum()
    }

    /// The score in each direction; 0 where it cannot be observed. `rest`: residual of each stone about the rigid motion.
    pub fn standardised(&self, rest: &[Vector3<f64>]) -> [Score; 3] {
        let (mut sum, mut least, mut most) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        for (i, share) in &self.stones {
            let added: Vector3<f64> = rest[*i] * *share;
            sum += added;
            least = least.inf(&added);
            most = most.sup(&added);
        }
        std::array::from_fn(|k| {
            let [sum, largest] = match sum[k] < 0.0 {
                true => [-sum[k], -least[k]],
                false => [sum[k], most[k]],
            };
            self.directions[k]
                .as_ref()
                .map_or_else(Score::default, |direction| Score {
                    whole: direction.standardised(sum),
                    without_largest: direction.standardised(sum - largest).max(0.0),
                })
        })
    }

    /// The largest score of any direction.
    pub fn largest(&self, rest: &[Vector3<f64>]) -> Score {
        self.standardised(rest)
            .into_iter()
            .fold(Score::default(), Score::larger)
    }

    /// Its stones and amplitude in the direction whose score, without its largest stone, is largest. `left_over`: of the
    /// observations, and of what they show beyond the motions. `None` where nothing shows it.
    pub fn most_likely(&self, left_over: &[Vec<Vector3<f64>>; 2]) -> Option<MostLikely> {
        let [score, smoothed] = left_over.each_ref().map(|rest| self.scores(rest));
        let shown = |k: usize| Some((k, self.directions[k].as_ref()?));
        let standardised = self.standardised(&left_over[0]);
        let size = |(k, _): &(usize, &Direction)| standardised[*k].without_largest;
        let (number, direction) = (0..3)
            .filter_map(shown)
            .max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let stones = self.stones.iter().filter(|(_, share)| *share > RIM);
        let missing = |k: usize| {
            self.directions[k].as_ref().map_or(0.0, |d| {
                d.amplitude_m(smoothed[k]).powi(2) + d.amplitude_sd_m().powi(2)
            })
        };

        Some(MostLikely {
            stones: stones.copied().collect(),
            diameter_m: self.diameter_m,
            direction: number,
            amplitude_m: direction.amplitude_m(score[number]),
            amplitude_sd_m: direction.amplitude_sd_m(),
            smoothed_m2: Vector3::new(missing(0), missing(1), missing(2)),
        })
    }
}

/// Adds to the covariances of these stones (world) a motion of the squares `along_up_out` in their frames, each by its
/// share in a bulge.
pub(super) fn add_squares(
    covariances: &mut [Matrix3<f64>],
    body: &Body,
    stones: &[(usize, f64)],
    along_up_out: &Vector3<f64>,
) {
    let squares = Matrix3::from_diagonal(along_up_out);
    for (i, share) in stones {
        let face_from_world = body.stones[*i].joint.face_from_world;
        covariances[*i] += face_from_world.transpose() * squares * face_from_world * share.powi(2);
    }
}

/// The bulge of the largest score without its largest stone.
pub(super) struct MostLikely {
    /// Stones that move by more than a quarter of its amplitude, with their share of it.
    pub stones: Vec<(usize, f64)>,
    pub diameter_m: f64,
    /// Its direction: along, up or out.
    pub direction: usize,
    pub amplitude_m: f64,
    /// Standard deviation of the amplitude, metres.
    pub amplitude_sd_m: f64,
    /// What the motions may miss of a bulge there, along, up and out, m^2: the square of what the stones' own
    /// observations show beyond them, and the variance of its amplitude. 0 where nothing shows it.
    pub smoothed_m2: Vector3<f64>,
}
