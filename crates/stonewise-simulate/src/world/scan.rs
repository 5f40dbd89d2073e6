//! What every simulated scanner shares: beams, footprints, noise, and the cloud that comes out.

use crate::world::day::Day;
use crate::world::material::Painter;
use crate::world::noise::normals;
use crate::world::scene::{Hit, Scene};
use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use stonewise_core::cloud::Cloud;

/// A simulated cloud with its truth, in the order it was measured.
#[derive(Clone, Debug)]
pub struct Scan {
    /// Measured positions, with all errors.
    pub cloud: Cloud,
    /// True stone of each point, 0 for joints and surroundings.
    pub stone: Vec<u32>,
    /// Which station or strip measured the point, counted from 1.
    pub source: Vec<u32>,
    /// When it was measured: adjusted standard GPS time (LAS 1.4), seconds. It rises along a station's rows
    /// and along a strip.
    pub time: Vec<f64>,
    /// Where the beam truly met the scene, relative to the cloud's origin, metres.
    pub exact: Vec<[f32; 3]>,
    /// Cosine of the angle of incidence.
    pub cos_incidence: Vec<f32>,
}

/// How well a scanner measures along one beam.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BeamParams {
    /// Range noise on a bright surface met square on at 10 m, standard deviation, metres.
    pub range_noise_m: f64,
    /// Growth of the range noise with range, metres per metre beyond 10 m.
    pub range_noise_per_m: f64,
    /// Pointing noise, standard deviation across the beam, radians.
    pub pointing_noise_rad: f64,
    /// Radius of the beam where it leaves the scanner, metres.
    pub exit_radius_m: f64,
    /// Half angle by which the beam widens, radians.
    pub divergence_rad: f64,
    /// Two surfaces within one beam closer than this give one point between them (a mixed pixel), metres.
    pub mixing_m: f64,
    /// Error of the range at grazing incidence, metres: it grows as one less the cosine of the angle of
    /// incidence.
    pub incidence_m: f64,
    /// Error of the range for each halving of the red reflectance below 0.25, metres: less light comes back,
    /// and the echo is timed too late.
    pub darkness_m: f64,
}

impl BeamParams {
    /// A phase or fast pulse scanner on a tripod: 1.5 mm, beam of 3 mm that widens by 0.15 mrad.
    pub fn terrestrial() -> Self {
        Self {
            range_noise_m: 0.0015,
            range_noise_per_m: 2e-5,
            pointing_noise_rad: 1.5e-5,
            exit_radius_m: 0.0015,
            divergence_rad: 1.5e-4,
            mixing_m: 0.25,
            incidence_m: 0.0,
            darkness_m: 0.0,
        }
    }

    /// A light scanner under a drone: 11 mm, beam that widens by 0.5 mrad.
    pub fn airborne() -> Self {
        Self {
            range_noise_m: 0.011,
            range_noise_per_m: 1e-4,
            pointing_noise_rad: 1e-4,
            exit_radius_m: 0.003,
            divergence_rad: 5e-4,
            mixing_m: 0.5,
            incidence_m: 0.0,
            darkness_m: 0.0,
        }
    }
}

impl Default for BeamParams {
    fn default() -> Self {
        Self::terrestrial()
    }
}

/// One measurement along one beam.
pub(super) struct Shot {
    pub hit: Hit,
    /// Where the scanner takes the point to be.
    pub measured: Point3<f64>,
    pub cos_incidence: f64,
}

/// A shot as it stands in the delivered cloud.
pub(super) struct Delivered {
    pub shot: Shot,
    /// What registration or trajectory make of the measured place.
    pub place: Point3<f64>,
    /// Seconds after the epoch's first scan began.
    pub time_s: f64,
}

/// A scanner at work: its beam and the systematic errors of its ranges.
pub(super) struct Instrument<'a> {
    beam: &'a BeamParams,
    /// Relative error of all ranges of the station.
    scale: f64,
    /// Brightness of the surfaces, where it matters.
    painter: Option<Painter>,
}

/// Reflectance at which [`BeamParams::darkness_m`] adds nothing.
const PLAIN_REFLECTANCE: f64 = 0.25;

impl<'a> Instrument<'a> {
    /// `day`: seed of the moisture, which differs between epochs.
    pub fn new(scene: &Scene, beam: &'a BeamParams, scale: f64, day: u64) -> Self {
        let wall_seed = scene.wall().params().seed;
        Self {
            beam,
            scale,
            painter: (beam.darkness_m != 0.0).then(|| Painter::new(wall_seed, &Day::new(day))),
        }
    }

    /// Systematic error of a range, metres.
    fn error_m(&self, scene: &Scene, hit: &Hit, cos_incidence: f64) -> f64 {
        let darkness = self.painter.as_ref().map_or(0.0, |painter| {
            (PLAIN_REFLECTANCE / painter.colour(scene.wall(), hit)[0]).log2()
        });
        self.scale * hit.range_m
            + self.beam.incidence_m * (1.0 - cos_incidence)
            + self.beam.darkness_m * darkness
    }
}

/// Sends one beam. The range is that of the beam's middle, mixed with that of a random place in its
/// footprint: square on this changes nothing, at an angle it adds footprint times tangent, at an edge it
/// makes mixed pixels. Range noise grows with 1/sqrt(cos incidence), as the returned light fades.
pub(super) fn shoot(
    scene: &Scene,
    from: &Point3<f64>,
    along: &Vector3<f64>,
    instrument: &Instrument,
    rng: &mut ChaCha8Rng,
) -> Option<Shot> {
    let beam = instrument.beam;
    let across = along
        .cross(&Vector3::z())
        .try_normalize(1e-9)
        .unwrap_or_else(Vector3::x);
    let upward = across.cross(along);
    // All numbers are drawn whether they are needed or not, so that one beam never changes the next one's
    // noise.
    let [pointing, spot, [noise, _]] = [(); 3].map(|()| normals(rng));
    let share: f64 = rng.random::<f64>() * 0.5;
    let off = |x: f64, y: f64| (along + across * x + upward * y).normalize();

    let true_along = off(
        pointing[0] * beam.pointing_noise_rad,
        pointing[1] * beam.pointing_noise_rad,
    );
    // Half of the footprint is one standard deviation.
    let spread = [beam.exit_radius_m, beam.divergence_rad].map(|v| 1.5 * v);
    let (hit, free_m) = scene.trace_beam(from, &true_along, spread)?;
    let mut range = hit.range_m;
    let radius_rad = beam.exit_radius_m / hit.range_m + beam.divergence_rad;
    if radius_rad > 0.0 {
        let beside = off(0.5 * radius_rad * spot[0], 0.5 * radius_rad * spot[1]);
        if let Some(second) = scene.range(from, &beside, free_m) {
            let apart = second - hit.range_m;
            if apart.abs() < beam.mixing_m {
                range += share * apart;
            }
        }
    }
    let cos_incidence = (-hit.normal.dot(&true_along)).clamp(0.05, 1.0);
    let sigma = beam.range_noise_m + beam.range_noise_per_m * (hit.range_m - 10.0).max(0.0);
    range += noise * sigma / cos_incidence.sqrt();
    range += instrument.error_m(scene, &hit, cos_incidence);
    Some(Shot {
        hit,
        // The pointing error is unknown to the scanner: it places the point along the aim.
        measured: from + along * range,
        cos_incidence,
    })
}

impl Scan {
    /// A cloud without points.
    pub fn empty(origin: Point3<f64>) -> Self {
        Self {
            cloud: Cloud::new(origin, Vec::new()),
            stone: Vec::new(),
            source: Vec::new(),
            time: Vec::new(),
            exact: Vec::new(),
            cos_incidence: Vec::new(),
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.stone.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.stone.is_empty()
    }

    /// Adds what a source measured; `number`: of the station or strip, from 0.
    pub(super) fn push(&mut self, points: Vec<Delivered>, number: u32) {
        let origin = self.cloud.origin();
        let measured = Cloud::from_world(origin, points.iter().map(|p| p.place));
        self.cloud.append(&measured);
        for Delivered { shot, time_s, .. } in points {
            self.stone.push(shot.hit.target.stone().map_or(0, |s| s.0));
            self.source.push(number + 1);
            self.time.push(time_s);
            self.exact.push((shot.hit.point - origin).cast::<f32>().into());
            self.cos_incidence.push(shot.cos_incidence as f32);
        }
    }

    /// Moves all times.
    pub(super) fn start_at(&mut self, start_s: f64) {
        self.time.iter_mut().for_each(|t| *t += start_s);
    }
}
