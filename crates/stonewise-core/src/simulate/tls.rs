//! A terrestrial laser scanner on tripods in front of the wall.

use crate::geometry::Rigid3;
use crate::simulate::face::FacePoint;
use crate::simulate::noise::normal;
use crate::simulate::scan::{BeamParams, Scan, Shot, shoot};
use crate::simulate::scene::Scene;
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Stations, grid and errors of a terrestrial scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TlsParams {
    /// Number of stations, evenly along the section.
    pub stations: u32,
    /// Distance of the stations from the face, metres.
    pub distance_m: f64,
    /// Height of the scanner over ground, metres.
    pub height_m: f64,
    /// Mean point distance of the merged cloud on the face straight in front of a station, metres.
    pub spacing_m: f64,
    /// How far stations stand off their planned place, metres (they differ between epochs).
    pub placement_m: f64,
    /// How much of the surroundings is scanned beyond the section, metres.
    pub margin_m: f64,
    /// Registration error of a station: translation per axis, metres.
    pub registration_m: f64,
    /// Registration error of a station: rotation per axis, radians.
    pub registration_rad: f64,
    /// The instrument.
    pub beam: BeamParams,
}

impl Default for TlsParams {
    fn default() -> Self {
        Self {
            stations: 2,
            distance_m: 9.0,
            height_m: 1.7,
            spacing_m: 0.005,
            placement_m: 0.5,
            margin_m: 0.25,
            registration_m: 0.0003,
            registration_rad: 2e-5,
            beam: BeamParams::terrestrial(),
        }
    }
}

/// One station: where it stands, and the rays it sends, row by row.
struct Station {
    number: u16,
    place: Point3<f64>,
    step_rad: f64,
    /// Smallest and largest azimuth, and smallest and largest elevation, radians.
    field: [f64; 4],
    /// What the registration gets wrong.
    error: Rigid3,
}

/// Scans the scene's window from all stations. The same points for any number of threads.
///
/// Cost: about three microseconds a beam.
pub fn scan_terrestrial(scene: &Scene, params: &TlsParams, seed: u64) -> Scan {
    let mut scan = Scan::empty(middle(scene));
    scan_terrestrial_rows(scene, params, seed, |station, shots| scan.push(shots, station));
    scan
}

/// As [`scan_terrestrial`], but hands over a few rows at a time: a large scan never lies in memory.
fn scan_terrestrial_rows(
    scene: &Scene,
    params: &TlsParams,
    seed: u64,
    mut take: impl FnMut(u16, Vec<(Shot, Point3<f64>)>),
) {
    const ROWS: usize = 64;
    for station in stations(scene, params, seed) {
        let [_, _, low, high] = station.field;
        let rows = ((high - low) / station.step_rad) as usize + 1;
        for start in (0..rows).step_by(ROWS) {
            let measured: Vec<Vec<_>> = (start..rows.min(start + ROWS))
                .into_par_iter()
                .map(|row| station.row(scene, params, row, seed))
                .collect();
            for shots in measured {
                take(station.number, shots);
            }
        }
    }
}

impl Station {
    fn row(&self, scene: &Scene, params: &TlsParams, row: usize, seed: u64) -> Vec<(Shot, Point3<f64>)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(((u64::from(self.number) + 1) << 32) | row as u64);
        let elevation = self.field[2] + row as f64 * self.step_rad;
        // Columns closer together in azimuth away from the horizon, so that points keep their distance.
        let step = self.step_rad / elevation.cos();
        let columns = ((self.field[1] - self.field[0]) / step) as usize + 1;
        (0..columns)
            .filter_map(|column| {
                let azimuth = self.field[0] + column as f64 * step;
                let along = direction(azimuth, elevation);
                let shot = shoot(scene, &self.place, &along, &params.beam, &mut rng)?;
                let measured = self.error * shot.measured;
                near_section(scene, &shot.hit.point, params.margin_m).then_some((shot, measured))
            })
            .collect()
    }
}

fn stations(scene: &Scene, params: &TlsParams, seed: u64) -> Vec<Station> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let window = scene.window();
    let face = &scene.wall().face;
    (0..params.stations)
        .map(|k| {
            let share = (f64::from(k) + 0.5) / f64::from(params.stations);
            let mut jitter = |size: f64| size * rng.random_range(-1.0..=1.0);
            let a = window[0] + (window[1] - window[0]) * share + jitter(params.placement_m);
            let n = params.distance_m + jitter(params.placement_m);
            let foot = face.world_of(&FacePoint { a, u: 0.0, n });
            let place = Point3::new(foot.x, foot.y, params.height_m + jitter(0.1));
            let turn = Vector3::from_fn(|_, _| params.registration_rad * normal(&mut rng));
            let shift = Vector3::from_fn(|_, _| params.registration_m * normal(&mut rng));
            Station {
                number: k as u16,
                place,
                step_rad: params.spacing_m * f64::from(params.stations).sqrt() / n,
                field: field(scene, &place, params.margin_m),
                error: about(&middle(scene), turn, shift),
            }
        })
        .collect()
}

/// The part of the sphere around a station that holds the window and its margin.
fn field(scene: &Scene, place: &Point3<f64>, margin_m: f64) -> [f64; 4] {
    let w = scene.window();
    let mut field = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
    let steps = 32;
    for i in 0..=steps {
        for j in 0..=steps {
            let share = |k: i32| f64::from(k) / f64::from(steps);
            let a = w[0] - margin_m + (w[1] - w[0] + 2.0 * margin_m) * share(i);
            let u = w[2] - margin_m + (w[3] - w[2] + 2.0 * margin_m) * share(j);
            let d = scene.wall().face.world_of(&FacePoint { a, u, n: 0.0 }) - place;
            let (azimuth, elevation) = (d.y.atan2(-d.x), d.z.atan2(d.x.hypot(d.y)));
            field = [
                field[0].min(azimuth),
                field[1].max(azimuth),
                field[2].min(elevation),
                field[3].max(elevation),
            ];
        }
    }
    field
}

/// Unit vector at an azimuth (0 looks at the wall, positive to the right) and an elevation.
fn direction(azimuth: f64, elevation: f64) -> Vector3<f64> {
    Vector3::new(
        -azimuth.cos() * elevation.cos(),
        azimuth.sin() * elevation.cos(),
        elevation.sin(),
    )
}

/// Whether a point belongs to the delivered cloud: near the section, also where things stand in front of it.
pub(super) fn near_section(scene: &Scene, p: &Point3<f64>, margin_m: f64) -> bool {
    let (f, w) = (scene.wall().face.face_of(p), scene.window());
    f.a > w[0] - margin_m
        && f.a < w[1] + margin_m
        && f.u > w[2] - margin_m
        && f.u < w[3] + margin_m
        && f.n < 1.5
        && f.n > -1.5
}

/// Middle of the scene's window on the face, rounded to whole metres: the origin of its clouds.
pub(super) fn middle(scene: &Scene) -> Point3<f64> {
    let w = scene.window();
    let (a, u) = (0.5 * (w[0] + w[1]), 0.5 * (w[2] + w[3]));
    scene
        .wall()
        .face
        .world_of(&FacePoint { a, u, n: 0.0 })
        .map(f64::round)
}

/// The motion that turns about a place and then shifts.
pub(super) fn about(place: &Point3<f64>, turn: Vector3<f64>, shift: Vector3<f64>) -> Rigid3 {
    let rotation = UnitQuaternion::from_scaled_axis(turn);
    Rigid3::from_parts(
        Translation3::from(place.coords + shift - rotation * place.coords),
        rotation,
    )
}
