//! What the sources of a survey get wrong, drawn from many kinds of truth.

use nalgebra::{Point3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use stonewise_simulate::{FlightErrorParams, StripDrift, StripErrors, normal};

/// Which sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    Tls,
    Uav,
}

/// How the truth departs from what the model of the errors holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Stations turned and shifted, strips shifted and drifting smoothly; the epoch shares the error that is
    /// assumed.
    Usual,
    /// Nothing that all sources of an epoch share.
    NothingShared,
    /// The epoch shares an error as large as a source's.
    SharedLikeSource,
    /// The epoch shares twice the error that is assumed.
    SharedTwice,
    /// Drifts that the splines do not span.
    Walk,
    Sine,
    Jump,
    /// Software has taken off the differences of the strips' means, or of the stations.
    Adjusted,
    /// Ranges of a station too long by a factor.
    Scale,
    /// Ranges that depend on the angle of incidence.
    Incidence,
    /// Ranges that depend on the brightness of the stone and on the source.
    Brightness,
    /// Errors up and out differ by a factor of four from those along.
    Uneven,
    /// Stations every 12.5 m along a wall, each of which sees 20 m to either side and stretches what it sees in
    /// the face.
    Chain,
}

impl Kind {
    pub const ALL: [(&'static str, Self); 13] = [
        ("usual", Self::Usual),
        ("nothing-shared", Self::NothingShared),
        ("shared-like-source", Self::SharedLikeSource),
        ("shared-twice", Self::SharedTwice),
        ("walk", Self::Walk),
        ("sine", Self::Sine),
        ("jump", Self::Jump),
        ("adjusted", Self::Adjusted),
        ("scale", Self::Scale),
        ("incidence", Self::Incidence),
        ("brightness", Self::Brightness),
        ("uneven", Self::Uneven),
        ("chain", Self::Chain),
    ];

    /// Whether a survey of this sensor can have it.
    pub fn suits(self, sensor: Sensor) -> bool {
        match self {
            Self::Walk | Self::Sine | Self::Jump => sensor == Sensor::Uav,
            Self::Scale | Self::Chain => sensor == Sensor::Tls,
            _ => true,
        }
    }
}

/// The error of one source.
pub struct SourceError {
    pub sensor: Sensor,
    /// Where it measures from; of a strip, its place for a point beside it (along the wall) is the point's.
    pub place: Point3<f64>,
    /// A strip looks ahead or back by this much, radians.
    pub squint: f64,
    /// How far to either side of `front` it sees, metres.
    pub reach_m: f64,
    /// Where its registration is at its best.
    pub front: Point3<f64>,
    shift: Vector3<f64>,
    turn: Vector3<f64>,
    /// Relative stretch in the face about `front`.
    stretch: f64,
    scale: f64,
    incidence_m: f64,
    brightness_m: f64,
    drift: Option<(std::sync::Arc<StripErrors>, u32)>,
}

/// A place that is measured: its outward normal, and how bright it is (standard normal).
pub struct Target {
    pub place: Point3<f64>,
    pub normal: Vector3<f64>,
    pub brightness: f64,
}

/// Middle of the wall's foot: registration targets stand around it.
const MIDDLE: Point3<f64> = Point3::new(0.0, 0.0, 1.5);
/// Where strips begin and end along the wall, metres.
pub const STRETCH: [f64; 2] = [-3.0, 3.0];

impl SourceError {
    pub fn sensor_for(&self, place: &Point3<f64>) -> Point3<f64> {
        match self.sensor {
            Sensor::Tls => self.place,
            Sensor::Uav => Point3::new(self.place.x, place.y + self.squint * self.place.x, self.place.z),
        }
    }

    /// Displacement of what it measures, metres.
    pub fn at(&self, target: &Target) -> Vector3<f64> {
        let beam = target.place - self.sensor_for(&target.place);
        let cosine = (-beam.dot(&target.normal) / beam.norm()).clamp(0.0, 1.0);
        let range = self.scale * beam.norm()
            + self.incidence_m * (1.0 - cosine)
            + self.brightness_m * target.brightness;
        let drift = self.drift.as_ref();
        let arm = target.place - self.front;
        self.shift
            + self.turn.cross(&arm)
            + self.stretch * (arm - target.normal * target.normal.dot(&arm))
            + beam.normalize() * range
            + drift.map_or_else(Vector3::zeros, |(d, k)| d.at(*k, target.place.y))
    }
}

/// Distance of the stations of a long wall from each other and from it, and how far to either side they see,
/// metres.
pub const CHAIN_M: [f64; 3] = [12.5, 25.0, 20.0];

/// Typical size of a source's error in one survey, metres: surveys differ by a factor of four.
pub fn size_m(sensor: Sensor, rng: &mut ChaCha8Rng) -> f64 {
    let [low, high]: [f64; 2] = match sensor {
        Sensor::Tls => [0.25e-3, 1e-3],
        Sensor::Uav => [1.5e-3, 6e-3],
    };
    let share = 0.5 + 0.5 * (normal(rng) / 1.5).clamp(-1.0, 1.0);
    low * (high / low).powf(share)
}

/// Stretch of each epoch's stations: a part that both epochs share plus a part of its own.
pub fn stretches(kind: Kind, rng: &mut ChaCha8Rng) -> [f64; 2] {
    match kind {
        Kind::Chain => {
            let shared = 5e-5 * normal(rng);
            [0, 1].map(|_| shared + 5e-6 * normal(rng))
        }
        _ => [0.0; 2],
    }
}

/// The sources of one epoch. `shared_m`: what is assumed of the error that they share; `size_m`: of a
/// source's own.
pub fn draw(
    sensor: Sensor,
    count: u32,
    kind: Kind,
    size_m: f64,
    shared_m: f64,
    stretch: f64,
    seed: u64,
) -> Vec<SourceError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut vector = |sd: f64| Vector3::from_fn(|_, _| sd * normal(&mut rng));
    let shared_m = match kind {
        Kind::NothingShared => 0.0,
        Kind::SharedLikeSource => size_m,
        Kind::SharedTwice => 2.0 * shared_m,
        _ => shared_m,
    };
    let shared = vector(shared_m);
    let mut shifts: Vec<Vector3<f64>> = (0..count).map(|_| vector(size_m)).collect();
    let turns: Vec<Vector3<f64>> = (0..count).map(|_| vector(0.1 * size_m)).collect();

    if kind == Kind::Adjusted {
        let mean = shifts.iter().sum::<Vector3<f64>>() / f64::from(count);
        shifts.fill(mean);
    }

    if kind == Kind::Uneven {
        shifts
            .iter_mut()
            .for_each(|s| *s = s.component_mul(&Vector3::new(2.0, 0.5, 1.0)));
    }

    let (scale, own) = (vector(1e-5), vector(1.0));
    let jitter: Vec<Vector3<f64>> = (0..count).map(|_| vector(0.3)).collect();
    // Half of a strip's variance changes along it.
    let share = 0.5f64.sqrt();
    let drift = match kind {
        Kind::Walk => StripDrift::RandomWalk,
        Kind::Sine => StripDrift::Sine,
        Kind::Jump => StripDrift::Jump,
        _ => StripDrift::Smooth,
    };
    let flight = std::sync::Arc::new(StripErrors::new(
        &FlightErrorParams {
            strips: count,
            stretch: STRETCH,
            datum_m: 0.0,
            drift,
            size_m: share * size_m,
            length_m: 4.0,
            adjusted: kind == Kind::Adjusted,
        },
        seed,
    ));

    (0..count)
        .map(|k| {
            let spread = (f64::from(k) + 0.5) / f64::from(count) - 0.5;
            let [apart, distance, reach_m] = match kind {
                Kind::Chain => CHAIN_M,
                _ => [4.0 / f64::from(count), 9.0, f64::INFINITY],
            };
            let along = apart * f64::from(count) * spread;
            let (place, squint, rest) = match sensor {
                Sensor::Tls => (Point3::new(distance, along, 1.7) + jitter[k as usize], 0.0, 1.0),
                Sensor::Uav => (
                    Point3::new(12.0, 0.0, 3.5 + 3.0 * spread),
                    [0.0, 0.14, -0.14][k as usize % 3],
                    share,
                ),
            };
            SourceError {
                sensor,
                place,
                squint,
                reach_m,
                front: match kind {
                    Kind::Chain => Point3::new(0.0, along, 1.5),
                    _ => MIDDLE,
                },
                stretch,
                shift: shared + shifts[k as usize] * rest,
                turn: if sensor == Sensor::Tls {
                    turns[k as usize]
                } else {
                    Vector3::zeros()
                },
                scale: if kind == Kind::Scale {
                    5.0 * scale[k as usize % 3]
                } else {
                    0.0
                },
                incidence_m: if kind == Kind::Incidence {
                    4.0 * size_m
                } else {
                    0.0
                },
                brightness_m: if kind == Kind::Brightness {
                    size_m * own[k as usize % 3].abs()
                } else {
                    0.0
                },
                drift: (sensor == Sensor::Uav).then(|| (flight.clone(), k)),
            }
        })
        .collect()
}
