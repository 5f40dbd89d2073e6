//! A lidar under a drone that flies strips along the wall.

use crate::simulate::face::FacePoint;
use crate::simulate::noise::{Noise, normal};
use crate::simulate::scan::{BeamParams, Scan, Shot, shoot};
use crate::simulate::scene::Scene;
use crate::simulate::tls::{grown, middle, near_section};
use crate::simulate::window::Window;
use nalgebra::{Point3, Vector3};
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
            beam: BeamParams::airborne(),
        }
    }
}

/// Scans a window of the section from all strips: fans across the flight line, one after the other. `scene` holds the
/// window's surroundings at least.
///
/// The same points for any number of threads. Cost: about three microseconds a beam.
pub fn scan_airborne(scene: &Scene, window: &Window, params: &UavParams, seed: u64) -> Scan {
    let mut scan = Scan::empty(middle(scene));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let datum = Vector3::from_fn(|_, _| params.datum_m * normal(&mut rng));
    let step = params.spacing_m * f64::from(params.strips).sqrt();
    let limits = grown(scene.wall().extent(), params.margin_m);
    // Beams that end on things before the face aim at places beside the window.
    let aimed = window.grown(PARALLAX_M, limits);
    let range = |axis: usize| {
        let first = |v: f64| (v - limits[2 * axis]) / step;
        first(aimed[2 * axis]).floor().max(0.0) as usize..=first(aimed[2 * axis + 1]) as usize
    };
    for strip in 0..params.strips {
        let path = Path::new(scene, params, strip, seed);
        let measured: Vec<Vec<_>> = range(0)
            .into_par_iter()
            .map(|fan| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                rng.set_stream(window.stream(u64::from(strip), fan as u64));
                let a = limits[0] + fan as f64 * step;
                let places = range(1).map(|k| limits[2] + (k as f64 + path.phase) * step);
                path.fan(scene, params, (a, step), places, datum, &mut rng)
            })
            .collect();
        for mut shots in measured {
            shots.retain(|(shot, _)| {
                let face = &shot.hit.face;
                window.holds(face.a, face.u)
            });
            scan.push(shots, strip as u16);
        }
    }
    scan
}

/// How far the place where a beam meets a thing 1.5 m before the face can lie from where it aims, metres.
const PARALLAX_M: f64 = 1.0;

/// A flight line and its error.
struct Path {
    /// Height in the face, metres.
    u: f64,
    /// Strips start at odd places on the face.
    phase: f64,
    /// Looks a little ahead or back, so that strips differ in direction.
    squint: f64,
    drift: [Noise; 3],
}

impl Path {
    fn new(scene: &Scene, params: &UavParams, strip: u32, seed: u64) -> Self {
        let w = scene.wall().extent();
        let share = (f64::from(strip) + 0.8) / f64::from(params.strips);
        let purpose = 100 + 3 * u64::from(strip);
        Self {
            u: w[2].max(0.0) + (w[3] - w[2].max(0.0)) * share + 0.8,
            phase: Noise::new(seed, 99).uniform(u64::from(strip)),
            squint: [0.0, 0.14, -0.14][strip as usize % 3],
            drift: [0, 1, 2].map(|axis| Noise::new(seed, purpose + axis)),
        }
    }

    /// One fan of beams at a, aimed at places up the face.
    fn fan(
        &self,
        scene: &Scene,
        params: &UavParams,
        (a, step): (f64, f64),
        places: impl Iterator<Item = f64>,
        datum: Vector3<f64>,
        rng: &mut ChaCha8Rng,
    ) -> Vec<(Shot, Point3<f64>)> {
        let face = &scene.wall().face;
        let a = a + (self.phase - 0.5) * step;
        let sensor = face.world_of(&FacePoint {
            a: a + self.squint * params.distance_m,
            u: self.u,
            n: params.distance_m,
        });
        // Standard deviation of the noise is 0.3.
        let error = datum
            + Vector3::from_fn(|axis, _| {
                let along_strip = a / params.drift_length_m + 40.0 * self.drift[axis].uniform(0);
                params.drift_m / 0.3 * self.drift[axis].at(along_strip, 0.5)
            });
        places
            .filter_map(|u| {
                let along = (face.world_of(&FacePoint { a, u, n: 0.0 }) - sensor).normalize();
                let shot = shoot(scene, &sensor, &along, &params.beam, rng)?;
                let measured = shot.measured + error;
                near_section(scene, &shot.hit.face, params.margin_m).then_some((shot, measured))
            })
            .collect()
    }
}
