//! A terrestrial laser scanner on tripods in front of the wall.

use crate::world::face::FacePoint;
use crate::world::noise::normal;
use crate::world::scan::{BeamParams, Delivered, Instrument, Scan, shoot};
use crate::world::scene::Scene;
use crate::world::window::Window;
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use stonewise_core::geometry::Rigid3;

/// Stations, grid and errors of a terrestrial scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TlsParams {
    /// Number of stations, evenly along the section.
    pub stations: u32,
    /// Distance of the stations from the face, metres.
    pub distance_m: f64,
    /// How far to either side along the section a station scans, metres; 0 for all of the section.
    pub reach_m: f64,
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
    /// Error that all stations of an epoch share, per axis, metres.
    pub datum_m: f64,
    /// Relative error of a station's ranges, standard deviation (1e-5 is 10 ppm).
    pub scale_error: f64,
    /// The instrument.
    pub beam: BeamParams,
    /// Stations at stated places, each with its own instrument, instead of `stations` of one kind: then `stations`,
    /// `distance_m`, `reach_m`, `height_m`, `spacing_m` and `beam` do not count.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<StationPlace>,
}

/// A station at a stated place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StationPlace {
    /// Place along the section, from its middle, metres.
    pub along_m: f64,
    /// Distance from the face, metres.
    pub distance_m: f64,
    /// Height of the scanner over ground, metres.
    pub height_m: f64,
    /// How far to either side along the section it scans, metres; 0 for all of the section.
    pub reach_m: f64,
    /// Angle between neighbouring beams, radians.
    pub step_rad: f64,
    /// The instrument.
    pub beam: BeamParams,
}

impl Default for StationPlace {
    fn default() -> Self {
        Self {
            along_m: 0.0,
            distance_m: 9.0,
            height_m: 1.7,
            reach_m: 0.0,
            step_rad: 7e-4,
            beam: BeamParams::terrestrial(),
        }
    }
}

impl Default for TlsParams {
    fn default() -> Self {
        Self {
            stations: 2,
            distance_m: 9.0,
            reach_m: 0.0,
            height_m: 1.7,
            spacing_m: 0.005,
            placement_m: 0.5,
            margin_m: 0.25,
            registration_m: 0.0003,
            registration_rad: 2e-5,
            datum_m: 0.0,
            scale_error: 0.0,
            beam: BeamParams::terrestrial(),
            places: Vec::new(),
        }
    }
}

/// One station: where it stands, and the grid of its rays.
struct Station<'a> {
    number: u32,
    beam: &'a BeamParams,
    place: Point3<f64>,
    step_rad: f64,
    /// Smallest and largest a that it scans, metres.
    reach: [f64; 2],
    /// What the registration gets wrong.
    error: Rigid3,
    /// Relative error of its ranges.
    scale: f64,
    /// The sphere that it scans of the whole section: smallest and largest azimuth, smallest and largest
    /// elevation, radians.
    field: [f64; 4],
}

/// Beams a second.
const BEAMS_PER_S: f64 = 2e5;
/// From the start of one station's scan to the next one's, seconds.
const STATION_S: f64 = 600.0;

/// Scans a window of the section from all stations; `scene` holds the window's surroundings at least.
///
/// The points are equal for any number of threads; times count from the start of the first station. Cost: about three
/// microseconds a beam.
pub fn scan_terrestrial(scene: &Scene, window: &Window, params: &TlsParams, seed: u64) -> Scan {
    let mut scan = Scan::empty(middle(scene));
    for station in stations(scene, params, seed) {
        let Some(part) = station.part(scene, window, params.margin_m) else {
            continue;
        };
        let [west, east, low, high] = station.field(scene, part);
        let sweep = Sweep {
            scene,
            window,
            params,
            station: &station,
            instrument: Instrument::new(scene, station.beam, station.scale, seed),
            part: grown(part, ASTRAY_M),
            azimuths: [west, east],
            seed,
        };
        // Rows and columns belong to the station's one grid, whatever the window.
        let step = station.step_rad;
        let rows = (low / step).floor() as i64..=(high / step).ceil() as i64;
        let measured: Vec<Vec<_>> = rows.into_par_iter().map(|row| sweep.row(row)).collect();
        for shots in measured {
            scan.push(shots, station.number);
        }
    }
    scan
}

/// Middle of the range of rows, so that their numbers are positive: more rows than a grid of 5 mm at 10 m
/// has.
const ROW_ZERO: i64 = 1 << 20;

/// Further than a beam points astray, metres.
const ASTRAY_M: f64 = 0.05;

/// What one station measures of a window.
struct Sweep<'a> {
    scene: &'a Scene<'a>,
    window: &'a Window,
    params: &'a TlsParams,
    station: &'a Station<'a>,
    instrument: Instrument<'a>,
    /// The part of the face that is looked at: smallest a, largest a, smallest u, largest u, metres.
    part: [f64; 4],
    /// Smallest and largest azimuth of its beams, radians.
    azimuths: [f64; 2],
    seed: u64,
}

impl Sweep<'_> {
    /// The beams of one elevation.
    fn row(&self, row: i64) -> Vec<Delivered> {
        let Station {
            number,
            place,
            step_rad,
            reach,
            error,
            ..
        } = self.station;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(self.window.stream(u64::from(*number), (row + ROW_ZERO) as u64));
        let elevation = row as f64 * step_rad;

        // Columns closer together in azimuth away from the horizon, so that points keep their distance.
        let step = step_rad / elevation.cos();
        let [first, last] = self.azimuths.map(|azimuth| azimuth / step);
        (first.floor() as i64..=last.ceil() as i64)
            .filter_map(|column| {
                let along = direction(column as f64 * step, elevation);
                if !self.scene.may_meet(place, &along, self.part) {
                    return None;
                }
                let shot = shoot(self.scene, place, &along, &self.instrument, &mut rng)?;
                let face = &shot.hit.face;
                let wanted = self.window.holds(face.a, face.u)
                    && (reach[0]..=reach[1]).contains(&face.a)
                    && near_section(self.scene, face, self.params.margin_m);
                wanted.then(|| Delivered {
                    place: error * shot.measured,
                    shot,
                    time_s: self.station.time_s(row, column),
                })
            })
            .collect()
    }
}

impl Station<'_> {
    /// When a beam is sent: rows from below, each from the left, all of the same duration.
    fn time_s(&self, row: i64, column: i64) -> f64 {
        let [west, east, low, _] = self.field;
        let step = self.step_rad / (row as f64 * self.step_rad).cos();
        let rows = row - (low / self.step_rad).floor() as i64;
        let columns = column - (west / step).floor() as i64;
        let longest_row = ((east - west) / self.step_rad).ceil() + 2.0;
        STATION_S * f64::from(self.number) + (rows as f64 * longest_row + columns as f64) / BEAMS_PER_S
    }

    /// The part of the window that the station reaches: smallest a, largest a, smallest u, largest u, metres.
    fn part(&self, scene: &Scene, window: &Window, margin_m: f64) -> Option<[f64; 4]> {
        let mut limits = grown(scene.wall().extent(), margin_m);
        limits[0] = limits[0].max(self.reach[0]);
        limits[1] = limits[1].min(self.reach[1]);
        let w = window.grown(0.0, limits);
        (w[0] < w[1] && w[2] < w[3]).then_some(w)
    }

    /// The part of the sphere around the station that holds a part of the face and what stands in front of
    /// it: smallest and largest azimuth, smallest and largest elevation, radians.
    fn field(&self, scene: &Scene, w: [f64; 4]) -> [f64; 4] {
        const STEPS: i32 = 32;
        let mut field = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
        for i in 0..=STEPS {
            for j in 0..=STEPS {
                for n in DEPTH_M {
                    let share = |k: i32| f64::from(k) / f64::from(STEPS);
                    let a = w[0] + (w[1] - w[0]) * share(i);
                    let u = w[2] + (w[3] - w[2]) * share(j);
                    let d = scene.wall().face.world_of(&FacePoint { a, u, n }) - self.place;
                    let (azimuth, elevation) = (d.y.atan2(-d.x), d.z.atan2(d.x.hypot(d.y)));
                    field = [
                        field[0].min(azimuth),
                        field[1].max(azimuth),
                        field[2].min(elevation),
                        field[3].max(elevation),
                    ];
                }
            }
        }
        field
    }
}

fn stations<'a>(scene: &Scene, params: &'a TlsParams, seed: u64) -> Vec<Station<'a>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let extent = scene.wall().extent();
    let face = &scene.wall().face;
    let datum = shared_error(params.datum_m, seed);
    let apart = (extent[1] - extent[0]) / f64::from(params.stations.max(1));

    // How many stations see a place.
    let cover = match params.reach_m {
        reach if reach > 0.0 => (2.0 * reach / apart).clamp(1.0, f64::from(params.stations)),
        _ => f64::from(params.stations),
    };
    let count = match params.places.len() {
        0 => params.stations,
        stated => stated as u32,
    };
    (0..count)
        .map(|k| {
            let stated = params.places.get(k as usize);
            let share = (f64::from(k) + 0.5) / f64::from(params.stations);
            let even = extent[0] + (extent[1] - extent[0]) * share;
            let mut jitter = |size: f64| size * rng.random_range(-1.0..=1.0);
            let a = stated.map_or(even, |s| s.along_m) + jitter(params.placement_m);
            let n = stated.map_or(params.distance_m, |s| s.distance_m) + jitter(params.placement_m);
            let height_m = stated.map_or(params.height_m, |s| s.height_m);
            let foot = face.world_of(&FacePoint { a, u: 0.0, n });
            let place = Point3::new(foot.x, foot.y, height_m + jitter(0.1));
            // Targets stand near the wall: there the registration is at its best.
            let front = face.world_of(&FacePoint {
                a,
                u: 0.5 * (extent[2] + extent[3]),
                n: 0.0,
            });
            let turn = Vector3::from_fn(|_, _| params.registration_rad * normal(&mut rng));
            let shift = Vector3::from_fn(|_, _| params.registration_m * normal(&mut rng));
            let reach = match stated.map_or(params.reach_m, |s| s.reach_m) {
                reach if reach > 0.0 => reach,
                _ => f64::INFINITY,
            };
            let mut station = Station {
                number: k,
                beam: stated.map_or(&params.beam, |s| &s.beam),
                place,
                step_rad: stated.map_or(params.spacing_m * cover.sqrt() / n, |s| s.step_rad),
                reach: [a - reach, a + reach],
                error: about(&front, turn, shift + datum),
                scale: params.scale_error * normal(&mut of_its_own(seed, u64::from(k))),
                field: [0.0; 4],
            };
            if let Some(part) = station.part(scene, &Window::whole(), params.margin_m) {
                station.field = station.field(scene, part);
            }
            station
        })
        .collect()
}

/// Random numbers of their own, so that these errors change no others.
fn of_its_own(seed: u64, number: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(u64::MAX - number);
    rng
}

fn shared_error(sd_m: f64, seed: u64) -> Vector3<f64> {
    let mut rng = of_its_own(seed, 1 << 32);
    Vector3::from_fn(|_, _| sd_m * normal(&mut rng))
}

/// Where things that belong to the cloud lie before and behind the face, metres.
const DEPTH_M: [f64; 3] = [-0.3, 0.0, 1.5];

/// Unit vector at an azimuth (0 looks at the wall, positive to the right) and an elevation.
fn direction(azimuth: f64, elevation: f64) -> Vector3<f64> {
    Vector3::new(
        -azimuth.cos() * elevation.cos(),
        azimuth.sin() * elevation.cos(),
        elevation.sin(),
    )
}

/// Whether a point belongs to the delivered cloud: near the section, also where things stand in front of it.
pub(super) fn near_section(scene: &Scene, f: &FacePoint, margin_m: f64) -> bool {
    let [a0, a1, u0, u1] = grown(scene.wall().extent(), margin_m);
    a0 < f.a && f.a < a1 && u0 < f.u && f.u < u1 && DEPTH_M[0] < f.n && f.n < DEPTH_M[2]
}

/// An extent, larger by a margin on every side.
pub(super) fn grown(e: [f64; 4], margin_m: f64) -> [f64; 4] {
    [e[0] - margin_m, e[1] + margin_m, e[2] - margin_m, e[3] + margin_m]
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
