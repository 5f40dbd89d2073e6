//! The variance components of the adjustment.

use crate::registration::random::Random;
use serde::{Deserialize, Serialize};

/// How unlike neighbouring stones may move: standard deviations, estimated from the survey itself.
///
/// "In" are the two directions in the face, "out" the one across it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VarianceComponents {
    /// Growth of the motion's gradient with distance, per square root metre: in the face, out of it.
    pub drift: [f64; 2],
    /// The motion's gradient itself, metre per metre: in the face (strain, shear and rotation alike), out of
    /// it (tilt). The prior holds for each stone separately: a gradient common to n stones has a standard
    /// deviation of strain / sqrt(n), which is 1.6 mm per metre for a strain of 0.02 and 150 stones.
    pub strain: [f64; 2],
    /// A stone's own translation beside the common field, perpendicular to the face, metres.
    pub own_m: f64,
    /// Error of a stone's motion in the face that no number of its points averages away, metres: relief finer
    /// than the points lie, mixed pixels, the mix of stations. Locked stones cannot slide, so what they seem
    /// to do in the face beside the field is this.
    pub error_m: f64,
    /// A stone's own rotation beside that of the field, radians.
    pub own_rad: f64,
    /// Appearance bias of a stone between the epochs in the photos, metres, along each axis of the face:
    /// light, moisture and moss move what all photos of an epoch show alike. Absent where photos take no
    /// part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub appearance_m: Option<f64>,
}

/// Minus twice the log of the probability, one in a hundred, with which a component exceeds its rare size.
const RATE: f64 = 2.0 * 4.6;
/// Own motion or error of stones that one survey in a hundred exceeds, metres: locked masonry moves with its
/// surroundings.
const RARE_M: f64 = 5e-4;
/// Rotation that one survey in a hundred exceeds, radians: half a millimetre at the edge of a stone of 20 cm.
const RARE_RAD: f64 = 5e-3;

/// Number of components; the last one counts where photos take part.
pub(crate) const COUNT: usize = 8;
/// Least appearance bias, metres: a thirtieth of a pixel, the accuracy expected of interpolation and lens
/// model.
pub(crate) const LEAST_APPEARANCE_M: f64 = 1e-4;
/// Appearance bias before it is estimated, metres: a fifth of a pixel.
pub(crate) const START_APPEARANCE_M: f64 = 7e-4;

impl VarianceComponents {
    /// A moderate start, neighbours about a millimetre apart: from a stiff one, fields that bend end as loose
    /// stones.
    pub(crate) fn start() -> Self {
        Self {
            drift: [5e-3, 1e-2],
            strain: [3e-3, 1e-2],
            own_m: 5e-4,
            error_m: 5e-4,
            own_rad: 2e-3,
            appearance_m: None,
        }
    }

    /// Components drawn from what is assumed of them: own motions by the laws of [`Self::penalty`]; drift and strain, of
    /// which only bounds are assumed, with even logarithms between the lower bound and the start.
    pub(crate) fn drawn(random: &mut Random) -> Self {
        let start = Self::start();
        let mut even = |k: usize, most: f64| {
            let least: f64 = BOUNDS[k][0];
            least * (most / least).powf(random.uniform())
        };
        let drift = [even(0, start.drift[0]), even(1, start.drift[1])];
        let strain = [even(2, start.strain[0]), even(3, start.strain[1])];
        let mut exponential = |rare: f64| -2.0 * rare / RATE * (1.0 - random.uniform()).ln();
        Self {
            drift,
            strain,
            own_m: exponential(RARE_M),
            own_rad: exponential(RARE_RAD),
            ..start
        }
    }

    /// Appearance bias in the photos, metres; zero where they take no part.
    pub(crate) fn appearance_m(&self) -> f64 {
        self.appearance_m.unwrap_or(0.0)
    }

    /// Names of the components at the upper end of their range, where the survey shows larger differences
    /// than are expected of masonry.
    ///
    /// Tilt (strain out of the face) is excluded: bulging walls reach its upper bound, which hardly
    /// constrains them. A bound ten times as large changed the motions of simulated walls by at most 0.09 mm
    /// (root mean square).
    pub fn at_upper_bound(&self) -> Vec<&'static str> {
        let log = self.to_log();
        let count = self.count();
        let is_there = |k: &usize| log[*k] > BOUNDS[*k][1].ln() - AT_BOUND;
        (0..count)
            .filter(|k| *k != TILT && is_there(k))
            .map(|k| NAMES[k])
            .collect()
    }

    /// How many components count.
    pub(crate) fn count(&self) -> usize {
        COUNT - usize::from(self.appearance_m.is_none())
    }

    pub(crate) fn to_log(self) -> [f64; COUNT] {
        [
            self.drift[0],
            self.drift[1],
            self.strain[0],
            self.strain[1],
            self.error_m,
            self.own_m,
            self.own_rad,
            self.appearance_m.unwrap_or(START_APPEARANCE_M),
        ]
        .map(f64::ln)
    }

    /// `count`: how many of them count.
    pub(crate) fn from_log(log: [f64; COUNT], count: usize) -> Self {
        let v = log.map(f64::exp);
        Self {
            drift: [v[0], v[1]],
            strain: [v[2], v[3]],
            error_m: v[4],
            own_m: v[5],
            own_rad: v[6],
            appearance_m: (count == COUNT).then_some(v[7]),
        }
    }

    /// Minus twice the log prior: exponential laws, so that stones have neither motions nor errors of their
    /// own unless the survey shows them (penalised complexity, Simpson et al. 2017).
    pub(crate) fn penalty(&self) -> f64 {
        RATE * ((self.error_m + self.own_m) / RARE_M + self.own_rad / RARE_RAD)
    }

    /// Variances of a stone's own (translation, rotation) in its frame.
    pub(crate) fn own_variances(&self) -> [f64; 6] {
        let (i, o, r) = (NONE_M, self.own_m, self.own_rad);
        [i, i, o, r, r, r].map(|s| s * s)
    }

    /// Adds the variance of the error in the face to such variances.
    pub(crate) fn with_error(&self, mut variances: [f64; 6]) -> [f64; 6] {
        for v in &mut variances[..2] {
            *v += self.error_m * self.error_m;
        }
        variances
    }
}

/// Standard deviation that counts as no motion, metres: a hundredth of the best accuracy of a stone.
const NONE_M: f64 = 2e-6;

/// A component counts as lying at a bound if their logarithms differ by less than this (rounding).
const AT_BOUND: f64 = 1e-9;
/// Index of the strain out of the face.
const TILT: usize = 3;
/// Names of the components in messages, in the order of their logarithms.
const NAMES: [&str; COUNT] = [
    "drift in the face",
    "drift out of the face",
    "strain in the face",
    "strain out of the face",
    "error_m",
    "own_m",
    "own_rad",
    "appearance_m",
];

/// Bounds of the logarithms: below, a component is as good as absent; above, neighbours say nothing.
pub(crate) const BOUNDS: [[f64; 2]; COUNT] = [
    [1e-5, 0.3],
    [1e-5, 0.3],
    [1e-5, 0.05],
    [1e-5, 0.1],
    [NONE_M, 6e-3],
    [NONE_M, 6e-3],
    [1e-5, 1.5e-2],
    [LEAST_APPEARANCE_M, 6e-3],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_go_there_and_back_and_lie_within_their_bounds() {
        let start = VarianceComponents::start();
        let log = start.to_log();
        let back = VarianceComponents::from_log(log, COUNT).to_log();
        for k in 0..COUNT {
            assert!((back[k] - log[k]).abs() < 1e-12);
            assert!(log[k] > BOUNDS[k][0].ln() && log[k] < BOUNDS[k][1].ln(), "{k}");
        }
    }

    #[test]
    fn components_at_the_upper_end_of_their_range_are_named() {
        let start = VarianceComponents::start();
        assert!(start.at_upper_bound().is_empty());
        let mut log = start.to_log();
        log[TILT] = BOUNDS[TILT][1].ln();
        log[4] = BOUNDS[4][1].ln();
        log[7] = BOUNDS[7][1].ln();
        let found = |count| VarianceComponents::from_log(log, count).at_upper_bound();
        assert_eq!(found(COUNT - 1), ["error_m"]);
        assert_eq!(found(COUNT), ["error_m", "appearance_m"]);
    }

    #[test]
    fn the_error_in_the_face_counts_there_only() {
        let components = VarianceComponents {
            error_m: 3e-4,
            ..VarianceComponents::start()
        };
        let own = components.own_variances();
        let with_error = components.with_error(own);
        for k in 0..6 {
            let added = if k < 2 { 9e-8 } else { 0.0 };
            assert!((with_error[k] - own[k] - added).abs() < 1e-18);
        }
    }
}
