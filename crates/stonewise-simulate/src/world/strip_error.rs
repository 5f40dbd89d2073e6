//! What the trajectory of a drone gets wrong along each strip.

use crate::world::noise::{Noise, normal};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::{SQRT_2, TAU};

/// How the error of a strip changes along it; its size and length are parameters of the flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StripDrift {
    /// Smooth noise of that wavelength.
    #[default]
    Smooth,
    /// A random walk that leaves its start by that size within that length.
    RandomWalk,
    /// A sine of that period.
    Sine,
    /// Constant but for one jump in the middle three fifths of the strip.
    Jump,
}

/// How large the errors of a flight are.
#[derive(Clone, Copy, Debug)]
pub struct FlightErrorParams {
    /// Number of strips.
    pub strips: u32,
    /// Where strips begin and end, metres along the face.
    pub stretch: [f64; 2],
    /// Error that all strips share, standard deviation per axis, metres.
    pub datum_m: f64,
    /// How a strip's error changes.
    pub drift: StripDrift,
    /// Its standard deviation per axis, metres.
    pub size_m: f64,
    /// Distance along the strip over which it changes, metres.
    pub length_m: f64,
    /// Whether the difference of the strips' mean errors is removed.
    pub adjusted: bool,
}

/// Errors of all strips of a flight.
pub struct StripErrors {
    /// Error that all strips share, metres.
    datum: Vector3<f64>,
    strips: Vec<StripError>,
    /// What the adjustment of the strips takes off each, metres.
    adjusted: Vec<Vector3<f64>>,
}

/// Distance of the places at which a strip's mean error is taken and a random walk changes, metres.
const STEP_M: f64 = 0.1;

impl StripErrors {
    /// Draws them.
    pub fn new(params: &FlightErrorParams, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let datum = Vector3::from_fn(|_, _| params.datum_m * normal(&mut rng));
        let strips: Vec<_> = (0..params.strips)
            .map(|strip| StripError::new(params, strip, seed))
            .collect();
        let adjusted = if params.adjusted {
            departures_from_mean(&strips, params.stretch)
        } else {
            vec![Vector3::zeros(); strips.len()]
        };
        Self {
            datum,
            strips,
            adjusted,
        }
    }

    /// Error of a strip's points at a place along the face, metres.
    pub fn at(&self, strip: u32, a: f64) -> Vector3<f64> {
        let strip = strip as usize;
        self.datum + (self.strips[strip].at(a) - self.adjusted[strip])
    }
}

/// Mean error of each strip less the mean of all strips.
fn departures_from_mean(strips: &[StripError], [start, end]: [f64; 2]) -> Vec<Vector3<f64>> {
    let count = ((end - start) / STEP_M).ceil().max(1.0) as usize;
    let place = |k: usize| start + (end - start) * (k as f64 + 0.5) / count as f64;
    let mean =
        |strip: &StripError| (0..count).map(|k| strip.at(place(k))).sum::<Vector3<f64>>() / count as f64;
    let means: Vec<_> = strips.iter().map(mean).collect();
    let common = means.iter().sum::<Vector3<f64>>() / means.len().max(1) as f64;
    means.into_iter().map(|m| m - common).collect()
}

/// Error of one strip along the face, per axis.
enum StripError {
    Smooth {
        noise: [Noise; 3],
        size_m: f64,
        length_m: f64,
    },
    Walk {
        start: f64,
        places: Vec<Vector3<f64>>,
    },
    Sine {
        phases: Vector3<f64>,
        amplitude_m: f64,
        period_m: f64,
    },
    Jump {
        at: f64,
        before: Vector3<f64>,
        after: Vector3<f64>,
    },
}

impl StripError {
    fn new(params: &FlightErrorParams, strip: u32, seed: u64) -> Self {
        let (size_m, length_m) = (params.size_m, params.length_m);
        let [start, end] = params.stretch;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // A stream that no strip's beams have.
        rng.set_stream(u64::MAX - u64::from(strip));
        let mut draw = |sd: f64| Vector3::from_fn(|_, _| sd * normal(&mut rng));

        match params.drift {
            StripDrift::Smooth => {
                let purpose = 100 + 3 * u64::from(strip);
                Self::Smooth {
                    noise: [0, 1, 2].map(|axis| Noise::new(seed, purpose + axis)),
                    size_m,
                    length_m,
                }
            }
            StripDrift::RandomWalk => {
                let count = ((end - start) / STEP_M).ceil().max(1.0) as usize + 1;
                let mut error = draw(size_m);
                let mut places = vec![error];
                for _ in 0..count {
                    error += draw(size_m * (STEP_M / length_m).sqrt());
                    places.push(error);
                }
                Self::Walk { start, places }
            }
            StripDrift::Sine => Self::Sine {
                phases: Vector3::from_fn(|_, _| TAU * rng.random::<f64>()),
                amplitude_m: SQRT_2 * size_m,
                period_m: length_m,
            },
            StripDrift::Jump => {
                let (before, after) = (draw(size_m), draw(size_m));
                let at = start + (end - start) * rng.random_range(0.2..0.8);
                Self::Jump { at, before, after }
            }
        }
    }

    fn at(&self, a: f64) -> Vector3<f64> {
        match self {
            // Standard deviation of the noise is 0.3.
            Self::Smooth {
                noise,
                size_m,
                length_m,
            } => Vector3::from_fn(|axis, _| {
                let along_strip = a / length_m + 40.0 * noise[axis].uniform(0);
                size_m / 0.3 * noise[axis].at(along_strip, 0.5)
            }),
            Self::Walk { start, places } => {
                let step = ((a - start) / STEP_M).clamp(0.0, places.len() as f64 - 1.001);
                let k = step as usize;
                places[k] + (places[k + 1] - places[k]) * (step - k as f64)
            }
            Self::Sine {
                phases,
                amplitude_m,
                period_m,
            } => phases.map(|phase| amplitude_m * (TAU * a / period_m + phase).sin()),
            Self::Jump { at, before, after } => *if a < *at { before } else { after },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params(drift: StripDrift) -> FlightErrorParams {
        FlightErrorParams {
            strips: 3,
            stretch: [-6.0, 6.0],
            datum_m: 0.0,
            drift,
            size_m: 0.002,
            length_m: 3.0,
            adjusted: false,
        }
    }

    /// Errors of many flights at two places, first axis.
    fn draws(drift: StripDrift, places: [f64; 2]) -> Vec<[f64; 2]> {
        let flight = |seed| StripErrors::new(&params(drift), seed);
        (0..2000)
            .map(|seed| places.map(|a| flight(seed).at(1, a).x))
            .collect()
    }

    fn rms(values: impl Iterator<Item = f64>) -> f64 {
        let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
        f64::sqrt(sum / count)
    }

    #[test]
    fn every_kind_has_the_stated_size_and_a_walk_grows_with_the_root_of_the_way() {
        for drift in [StripDrift::Smooth, StripDrift::Sine, StripDrift::Jump] {
            let size = rms(draws(drift, [0.7, 0.7]).into_iter().map(|d| d[0]));
            // Gradient noise varies a little less than its nominal 0.3 halfway between two rows of its
            // lattice.
            let allowed = if drift == StripDrift::Smooth { 0.15 } else { 0.06 };
            assert!((size / 0.002 - 1.0).abs() < allowed, "{drift:?} {size}");
        }
        for (way, growth) in [(3.0, 1.0), (12.0, 2.0)] {
            let walk = draws(StripDrift::RandomWalk, [-6.0, -6.0 + way]);
            let grown = rms(walk.into_iter().map(|d| d[1] - d[0]));
            assert!((grown / (0.002 * growth) - 1.0).abs() < 0.05, "{way} {grown}");
        }
    }

    #[test]
    fn a_jump_is_the_only_change_and_lies_inside_the_strip() {
        for seed in 0..50 {
            let flight = StripErrors::new(&params(StripDrift::Jump), seed);
            let places: Vec<f64> = (0..1200).map(|k| -6.0 + 0.01 * f64::from(k)).collect();
            let changes: Vec<&[f64]> = places
                .windows(2)
                .filter(|w| flight.at(0, w[0]) != flight.at(0, w[1]))
                .collect();
            assert_eq!(changes.len(), 1);
            assert!(changes[0][0].abs() <= 3.6);
        }
    }

    #[test]
    fn an_adjustment_leaves_strips_one_mean_and_keeps_what_they_share() {
        for drift in [
            StripDrift::Smooth,
            StripDrift::RandomWalk,
            StripDrift::Sine,
            StripDrift::Jump,
        ] {
            // Not a whole number of periods, whose mean would be zero.
            let raw = FlightErrorParams {
                length_m: 5.0,
                ..params(drift)
            };
            let adjusted = FlightErrorParams {
                adjusted: true,
                ..raw
            };
            let means = |params: &FlightErrorParams| {
                let flight = StripErrors::new(params, 4);
                let mean = |strip| {
                    let errors = (0..12_000).map(|k| flight.at(strip, -6.0 + 0.001 * (f64::from(k) + 0.5)));
                    errors.sum::<Vector3<f64>>() / 12_000.0
                };
                [0, 1, 2].map(mean)
            };
            let (before, after) = (means(&raw), means(&adjusted));
            let common = before.iter().sum::<Vector3<f64>>() / 3.0;
            assert!((before[0] - common).norm() > 1e-4, "{drift:?}");
            for mean in after {
                // A jump may lie anywhere between two of the places that the adjustment uses.
                assert!((mean - common).norm() < 5e-5, "{drift:?}: {mean} {common}");
            }
        }
    }
}
