//! Variances of the sources' errors: what they are, and what is expected of them beforehand.

use crate::switches::switchable;
use serde::{Deserialize, Serialize};

/// Standard deviations of the sources' errors and of what compares them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObserverComponents {
    /// Standard deviation of a source's translation, per axis, metres.
    pub translation_m: f64,
    /// Standard deviation of its rotation, per axis, as a displacement at the root mean square distance of what it sees
    /// from its middle, metres.
    pub rotation_m: f64,
    /// Standard deviation of its drift, per axis, metres.
    pub drift_m: f64,
    /// Correlation length of the drift, as a share of the source's duration.
    pub drift_length: f64,
    /// Standard deviations of an independent error of each source at each stone (incidence, footprint), in the face and
    /// across it, metres.
    pub nugget_m: [f64; 2],
    /// Factor on the variances that the points' noise gives differences of sources.
    pub noise_scale: f64,
}

/// Kind of sensor, which sets what is expected before the survey is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorClass {
    /// A scanner on a tripod.
    Terrestrial,
    /// A lidar on a moving platform.
    Airborne,
}

/// Points noisier than this, metres, come from a moving platform: tripod scanners range to 1 to 3 mm, lidars
/// for drones to 5 to 30 mm.
const AIRBORNE_NOISE_M: f64 = 0.005;

impl SensorClass {
    /// By the noise of single points along the normal, metres.
    pub fn of_noise(sigma_m: f64) -> Self {
        if sigma_m > AIRBORNE_NOISE_M {
            Self::Airborne
        } else {
            Self::Terrestrial
        }
    }

    /// Error that all sources of an epoch share, per axis, metres: nothing in the epoch shows it.
    ///
    /// Terrestrial: points of a control network measured by total station, 0.3 mm in the mean of the targets
    /// of a scan. Airborne: the base station that all strips share; its short static baselines repeat to 2 to
    /// 3 mm.
    pub fn shared_error_m(self) -> f64 {
        match self {
            Self::Terrestrial => 0.3e-3,
            Self::Airborne => 2e-3,
        }
    }

    /// Error that a source has at least, per axis, metres, where it was registered by itself: sources that
    /// agree better were fitted to each other, by strip adjustment or cloud to cloud, and hide the rest in
    /// their mean.
    pub(super) fn least_m(self) -> f64 {
        0.6 * self.typical_m()
    }

    /// Prior of the stretch about the middle of what a source sees; `None` where a source sees all places from
    /// the same direction.
    pub(super) fn stretch(self) -> Option<Stretch> {
        switchable!("obs_stretch", None);
        match self {
            Self::Terrestrial => Some(Stretch {
                shared: 1e-4,
                of_epoch: 2e-5,
            }),
            Self::Airborne => None,
        }
    }

    /// Assumed non-rigid error of an epoch whose files keep no sources apart.
    ///
    /// Terrestrial: each place is measured by the few stations nearest to it, whose registration errors are of
    /// typical size or somewhat larger; stations are 10 to 20 m apart. Airborne: drift of the trajectory over
    /// one or two seconds of flight, averaged over the strips.
    pub(super) fn merged(self) -> MergedDrift {
        match self {
            Self::Terrestrial => MergedDrift {
                sd_m: 0.7e-3,
                length_m: 15.0,
            },
            Self::Airborne => MergedDrift {
                sd_m: 2e-3,
                length_m: 6.0,
            },
        }
    }

    /// Median of the prior of a source's translation, metres: registration by targets; direct georeferencing
    /// after strip adjustment.
    fn typical_m(self) -> f64 {
        match self {
            Self::Terrestrial => 0.5e-3,
            Self::Airborne => 5e-3,
        }
    }
}

/// Standard deviations of a relative stretch, in the face, of what a source shows about its middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// Standard deviation of the stretch that all sources of both epochs share.
    pub shared: f64,
    /// Standard deviation of the stretch that the sources of one epoch share.
    pub of_epoch: f64,
}

/// Non-rigid error of an epoch whose files keep no sources apart: a Gaussian process along the wall, the same
/// for each axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct MergedDrift {
    /// Standard deviation, metres.
    pub sd_m: f64,
    /// Correlation length, metres.
    pub length_m: f64,
}

impl MergedDrift {
    /// Of a cloud from photos whose cameras are not known. Two clouds of a real wall from one bundle, taken from 10 m,
    /// differ by 1.3 mm that change over 1 to 2 m (docs/src/method/epoch-errors.md), those of two bundles by more.
    pub const OF_PHOTOS: Self = Self {
        sd_m: 2e-3,
        length_m: 2.0,
    };
}

/// Number of components.
pub(super) const COUNT: usize = 7;

/// Standard deviation of the log-normal priors: 95 % within a factor of seven.
const PRIOR_LOG_SD: f64 = 1.0;
/// Bounds of the components: below, as good as absent; above, absurd.
pub(super) const BOUNDS: [[f64; 2]; COUNT] = [
    [1e-5, 0.2],
    [1e-6, 0.1],
    [1e-6, 0.1],
    [0.05, 3.0],
    [1e-5, 0.02],
    [1e-5, 0.02],
    [0.5, 30.0],
];

impl ObserverComponents {
    /// The medians of the priors.
    pub(super) fn expected(class: SensorClass) -> Self {
        let typical = class.typical_m();
        Self {
            translation_m: typical,
            rotation_m: 0.3 * typical,
            drift_m: 0.5 * typical,
            drift_length: 0.4,
            nugget_m: [0.2 * typical, 0.1 * typical],
            noise_scale: 1.5,
        }
    }

    /// The components with all errors of the sources times `factor`.
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self {
            translation_m: self.translation_m * factor,
            rotation_m: self.rotation_m * factor,
            drift_m: self.drift_m * factor,
            ..self
        }
    }

    pub(super) fn to_log(self) -> [f64; COUNT] {
        [
            self.translation_m,
            self.rotation_m,
            self.drift_m,
            self.drift_length,
            self.nugget_m[0],
            self.nugget_m[1],
            self.noise_scale,
        ]
        .map(f64::ln)
    }

    pub(super) fn from_log(log: [f64; COUNT]) -> Self {
        let v = log.map(f64::exp);
        Self {
            translation_m: v[0],
            rotation_m: v[1],
            drift_m: v[2],
            drift_length: v[3],
            nugget_m: [v[4], v[5]],
            noise_scale: v[6],
        }
    }

    /// Minus twice the logarithm of the prior of these, up to a constant.
    pub(super) fn penalty(&self, class: SensorClass) -> f64 {
        let (log, middle) = (self.to_log(), Self::expected(class).to_log());
        (0..COUNT)
            .map(|k| ((log[k] - middle[k]) / PRIOR_LOG_SD).powi(2))
            .sum()
    }
}
