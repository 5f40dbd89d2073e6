//! A lidar under a drone that flies strips along the wall.

use crate::world::face::FacePoint;
use crate::world::noise::Noise;
use crate::world::scan::{BeamParams, Delivered, Instrument, Scan, shoot};
use crate::world::scene::Scene;
use crate::world::strip_error::{FlightErrorParams, StripDrift, StripErrors};
use crate::world::tls::{grown, middle, near_section};
use crate::world::window::Window;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Strips, grid and errors of a scan from a drone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UavParams {
    /// Number of strips, one above the other.
    pub strips: u32,
    /// Distance of the strips from the face, metres.
    pub distance_m: f64,
    /// Mean point distance of the merged cloud, metres.
    pub spacing_m: f64,
    /// How much of the surroundings is scanned beyond the section, metres.
    pub margin_m: f64,
    /// Error that the whole flight shares, per axis, metres.
    pub datum_m: f64,
    /// Error that drifts along a strip, per axis, standard deviation, metres.
    pub drift_m: f64,
    /// Distance along the strip over which the drift changes, metres.
    pub drift_length_m: f64,
    /// How it changes.
    pub drift: StripDrift,
    /// Whether software has adjusted the strips to each other: the difference of their mean errors is gone,
    /// their common mean stays.
    pub adjusted: bool,
    /// The instrument.
    pub beam: BeamParams,
}

impl Default for UavParams {
    fn default() -> Self {
        Self {
            strips: 3,
            distance_m: 12.0,
            spacing_m: 0.009,
            margin_m: 0.25,
            datum_m: 0.0015,
            drift_m: 0.0015,
            drift_length_m: 6.0,
            drift: StripDrift::Smooth,
            adjusted: false,
            beam: BeamParams::airborne(),
        }
    }
}

impl UavParams {
    /// Errors of strips that begin and end at these places along the face, metres.
    fn errors(&self, stretch: [f64; 2]) -> FlightErrorParams {
        FlightErrorParams {
            strips: self.strips,
            stretch,
            datum_m: self.datum_m,
            drift: self.drift,
            size_m: self.drift_m,
            length_m: self.drift_length_m,
            adjusted: self.adjusted,
        }
    }
}

/// Scans a window of the section from all strips: fans across the flight line, one after the other. `scene`
/// holds the window's surroundings at least.
///
/// The points are equal for any number of threads; times count from the start of the first strip. Cost: about three
/// microseconds a beam.
pub fn scan_airborne(scene: &Scene, window: &Window, params: &UavParams, seed: u64) -> Scan {
    let mut scan = Scan::empty(middle(scene));
    let step = params.spacing_m * f64::from(params.strips).sqrt();
    let limits = grown(scene.wall().extent(), params.margin_m);
    // Beams that end on things before the face aim at places beside the window.
    let aimed = window.grown(PARALLAX_M, limits);
    let range = |axis: usize| {
        let first = |v: f64| (v - limits[2 * axis]) / step;
        first(aimed[2 * axis]).floor().max(0.0) as usize..=first(aimed[2 * axis + 1]) as usize
    };
    let flight = Flight {
        scene,
        params,
        instrument: Instrument::new(scene, &params.beam, 0.0, seed),
        errors: StripErrors::new(&params.errors([limits[0], limits[1]]), seed),
        limits,
        step,
        seed,
    };

    for number in 0..params.strips {
        let strip = Strip::new(scene, params, number, seed);
        let measured: Vec<Vec<_>> = range(0)
            .into_par_iter()
            .map(|fan| flight.fan(&strip, window, fan, range(1)))
            .collect();
        for mut points in measured {
            points.retain(|point| {
                let face = &point.shot.hit.face;
                window.holds(face.a, face.u)
            });
            scan.push(points, number);
        }
    }

    scan
}

/// How far the place where a beam meets a thing 1.5 m before the face can lie from where it aims, metres.
const PARALLAX_M: f64 = 1.0;

/// Speed along a strip, metres a second.
const SPEED_M_S: f64 = 2.0;
/// Time between two strips, seconds.
const TURN_S: f64 = 60.0;

/// What all strips share.
struct Flight<'a> {
    scene: &'a Scene<'a>,
    params: &'a UavParams,
    instrument: Instrument<'a>,
    errors: StripErrors,
    /// The part of the face that is scanned: smallest a, largest a, smallest u, largest u, metres.
    limits: [f64; 4],
    /// Distance of the fans, and of the beams in a fan, on the face, metres.
    step: f64,
    seed: u64,
}

/// A flight line.
struct Strip {
    number: u32,
    /// Height in the face, metres.
    u: f64,
    /// Strips start at odd places on the face.
    phase: f64,
    /// Looks a little ahead or back, so that strips differ in direction.
    squint: f64,
}

impl Strip {
    fn new(scene: &Scene, params: &UavParams, number: u32, seed: u64) -> Self {
        let w = scene.wall().extent();
        let share = (f64::from(number) + 0.8) / f64::from(params.strips);
        Self {
            number,
            u: w[2].max(0.0) + (w[3] - w[2].max(0.0)) * share + 0.8,
            phase: Noise::new(seed, 99).uniform(u64::from(number)),
            squint: [0.0, 0.14, -0.14][number as usize % 3],
        }
    }
}

impl Flight<'_> {
    /// One fan of beams across a strip. `rows`: which of the beams.
    fn fan(
        &self,
        strip: &Strip,
        window: &Window,
        fan: usize,
        rows: impl Iterator<Item = usize>,
    ) -> Vec<Delivered> {
        let (scene, params, limits) = (self.scene, self.params, &self.limits);
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(window.stream(u64::from(strip.number), fan as u64));
        let face = &scene.wall().face;
        let a = limits[0] + fan as f64 * self.step;
        let a = a + (strip.phase - 0.5) * self.step;
        let sensor = face.world_of(&FacePoint {
            a: a + strip.squint * params.distance_m,
            u: strip.u,
            n: params.distance_m,
        });
        let error: Vector3<f64> = self.errors.at(strip.number, a);

        rows.filter_map(|row| {
            let u = limits[2] + (row as f64 + strip.phase) * self.step;
            let along = (face.world_of(&FacePoint { a, u, n: 0.0 }) - sensor).normalize();
            let shot = shoot(scene, &sensor, &along, &self.instrument, &mut rng)?;
            near_section(scene, &shot.hit.face, params.margin_m).then(|| Delivered {
                place: shot.measured + error,
                shot,
                time_s: self.time_s(strip, fan, row),
            })
        })
        .collect()
    }

    /// When a beam is sent: every strip is flown in the direction of a, and a fan ends before the next one
    /// begins.
    fn time_s(&self, strip: &Strip, fan: usize, row: usize) -> f64 {
        let [a0, a1, u0, u1] = self.limits;
        let rows = ((u1 - u0) / self.step).floor() + 1.0;
        let strip_s = (a1 - a0) / SPEED_M_S + TURN_S;
        let fans = fan as f64 + row as f64 / rows;
        f64::from(strip.number) * strip_s + fans * self.step / SPEED_M_S
    }
}
