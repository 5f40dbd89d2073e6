//! A small wall and stable areas as the sources of two epochs show them: points enough for the comparison of
//! sources; the motions that the adjustment would measure are drawn from the same errors.

use super::errors::{CHAIN_M, Kind, STRETCH, Sensor, SourceError, Target, draw, size_m, stretches};
use crate::survey::sources;
use nalgebra::{Matrix3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use stonewise_core::cloud::Cloud;
use stonewise_core::registration::observers::{SeenStone, Source, SourcePoints, StablePoints};
use stonewise_simulate::normal;

/// Ground that the user names beside the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stable {
    None,
    /// Ground only.
    Ground,
    /// Ground and a small building, whose faces across the wall a drone hardly sees.
    Building,
    /// Ground, a small building, and an area that moved.
    Moved,
    /// Ground and one to three buildings of any size and direction, scanned with a beam of finite width.
    Buildings,
}

pub struct Case {
    pub sensor: Sensor,
    pub sources: u32,
    pub stable: Stable,
    pub kind: Kind,
}

pub struct Survey {
    pub sources: Vec<Source>,
    pub stones: Vec<SeenStone>,
    pub stable: Vec<StablePoints>,
    pub sigma_m: f64,
    /// Error of the later epoch against the reference at each stone: what a still stone seems to move.
    pub seeming: Vec<Vector3<f64>>,
    /// Error of the motion of each stone: `seeming` with the noise that the adjustment leaves; then the covariance of
    /// that noise.
    pub measured: Vec<Vector3<f64>>,
    pub noise: Vec<Matrix3<f64>>,
}

/// Stones along and up, and how long the wall is, metres.
fn grid(case: &Case) -> ([usize; 2], f64) {
    match case.kind {
        Kind::Chain => {
            let stations = case.sources as usize;
            ([3 * stations, 4], CHAIN_M[0] * stations as f64)
        }
        _ => ([7, 4], 4.0),
    }
}

/// Points of a source on a stone; fewer than a scan has, with less noise.
const POINTS: usize = 120;

struct Instrument {
    sigma_m: f64,
    /// Noise of the points of a stone, which stand for more.
    thinned_m: f64,
    /// Error of a stone's motion in the face and across it.
    stone_m: [f64; 2],
    /// Independent error of a source on a stone, in the face and across it.
    nugget_m: [f64; 2],
    /// Points of a source per square metre of a plane that faces it.
    density: f64,
    /// Diameter of the beam, metres.
    footprint_m: f64,
}

fn instrument(sensor: Sensor) -> Instrument {
    match sensor {
        Sensor::Tls => Instrument {
            sigma_m: 0.0015,
            thinned_m: 0.0005,
            stone_m: [0.08e-3, 0.03e-3],
            nugget_m: [0.05e-3, 0.02e-3],
            density: 2000.0,
            footprint_m: 0.006,
        },
        Sensor::Uav => Instrument {
            sigma_m: 0.011,
            thinned_m: 0.006,
            stone_m: [0.5e-3, 0.2e-3],
            nugget_m: [0.5e-3, 0.2e-3],
            density: 2000.0,
            footprint_m: 0.03,
        },
    }
}

pub fn simulate(case: &Case, seed: u64) -> Survey {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(7919) ^ 0x5eed);
    let what = instrument(case.sensor);
    let assumed = match case.sensor {
        Sensor::Tls => 0.3e-3,
        Sensor::Uav => 2e-3,
    };
    let size = size_m(case.sensor, &mut rng);
    let stretches = stretches(case.kind, &mut of_its_own(seed));

    let mut of_epoch = |stretch| {
        draw(
            case.sensor,
            case.sources,
            case.kind,
            size,
            assumed,
            stretch,
            rng.random(),
        )
    };

    let errors: Vec<SourceError> = stretches.into_iter().flat_map(&mut of_epoch).collect();
    let mut stones = Vec::new();
    let mut seeming = Vec::new();
    let (grid, width_m) = grid(case);

    for k in 0..grid[0] * grid[1] {
        let place = [
            ((k % grid[0]) as f64 + 0.5) / grid[0] as f64 * width_m - 0.5 * width_m,
            ((k / grid[0]) as f64 + 0.5) * 3.0 / grid[1] as f64,
        ];
        let (stone, error) = stone(place, &errors, &what, &mut rng);
        stones.push(stone);
        seeming.push(error);
    }

    let [inside, across] = what.stone_m;
    let measured = seeming.iter().map(|e| {
        let own = Vector3::new(
            across * normal(&mut rng),
            inside * normal(&mut rng),
            inside * normal(&mut rng),
        );
        e + own
    });

    Survey {
        measured: measured.collect(),
        noise: vec![
            Matrix3::from_diagonal(&Vector3::new(across, inside, inside).map(|s| s * s));
            seeming.len()
        ],
        stable: stable(case.stable, &errors, &what, &mut rng),
        sources: sources(case.sources as usize),
        stones,
        sigma_m: what.sigma_m,
        seeming,
    }
}

/// Random numbers of their own, so that they change no others.
fn of_its_own(seed: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1);
    rng
}

/// When a source measures a place: a strip flies along the wall, a station scans in columns.
fn time_s(source: usize, place: &Point3<f64>) -> f64 {
    100.0 * source as f64 + (place.y - STRETCH[0]) / 2.0
}

/// A stone and the error of the later epoch against the reference there.
fn stone(
    [along, up]: [f64; 2],
    errors: &[SourceError],
    what: &Instrument,
    rng: &mut ChaCha8Rng,
) -> (SeenStone, Vector3<f64>) {
    let centroid = Point3::new(-0.2 * up, along, up);
    let normal_of_face = Vector3::new(1.0, 0.0, 0.2).normalize();
    let target = Target {
        place: centroid,
        normal: normal_of_face,
        brightness: normal(rng),
    };
    let phases: [f64; 4] = std::array::from_fn(|_| rng.random_range(0.0..6.0));
    let half = errors.len() / 2;
    let mut difference = Vector3::zeros();
    let sees = |e: &SourceError| (e.front.y - along).abs() <= e.reach_m;
    let seeing = [&errors[..half], &errors[half..]].map(|of| of.iter().filter(|e| sees(e)).count() as f64);
    let sights = errors
        .iter()
        .enumerate()
        .filter(|(_, e)| sees(e))
        .map(|(s, error)| {
            let own = Vector3::new(
                what.nugget_m[1] * normal(rng),
                what.nugget_m[0] * normal(rng),
                what.nugget_m[0] * normal(rng),
            );
            let shift = error.at(&target) + own;
            difference += shift
                * if s < half {
                    -1.0 / seeing[0]
                } else {
                    1.0 / seeing[1]
                };
            let points = (0..POINTS).map(|_| {
                let (y, z): (f64, f64) = (rng.random_range(-0.14..0.14), rng.random_range(-0.1..0.1));
                let relief = 0.005 * ((42.0 * y + phases[0]).sin() + (38.0 * z + phases[1]).sin())
                    + 0.008 * ((17.0 * y + phases[2]).sin() + (15.0 * z + phases[3]).cos());
                let x = relief + what.thinned_m * normal(rng) - 0.2 * z;
                centroid + Vector3::new(x, y, z) + shift
            });
            SourcePoints {
                source: s,
                count: POINTS as u64,
                time_s: time_s(s, &centroid),
                points: Cloud::from_world(centroid, points.collect::<Vec<_>>()),
            }
        });

    let stone = SeenStone {
        centroid,
        normal: normal_of_face,
        sights: sights.collect(),
    };
    (stone, difference)
}

/// A piece of plane: a corner, two edges, and how deep it undulates.
struct Patch {
    area: usize,
    corner: Point3<f64>,
    edges: [Vector3<f64>; 2],
    wave_m: f64,
    moved: Vector3<f64>,
    /// Side that shows something; `None`: either.
    outward: Option<Vector3<f64>>,
    /// Whether beams at its edges see past it.
    has_edges: bool,
}

/// A box that stands on the ground: its walls and its roof.
fn building(area: usize, rng: &mut ChaCha8Rng) -> Vec<Patch> {
    let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
    let up = Vector3::z() * rng.random_range(0.5..2.5);
    let sides = [Vector3::new(cos, sin, 0.0), Vector3::new(-sin, cos, 0.0)];
    let [a, b] = sides.map(|side| side * rng.random_range(0.4..2.5));
    let middle = Point3::new(rng.random_range(2.0..5.0), rng.random_range(-4.0..4.0), 0.0);
    let corner = middle - 0.5 * (a + b);
    let patch = |corner: Point3<f64>, edges: [Vector3<f64>; 2], outward: Vector3<f64>| Patch {
        area,
        corner,
        edges,
        wave_m: 0.0,
        moved: Vector3::zeros(),
        outward: Some(outward),
        has_edges: true,
    };
    vec![
        patch(corner, [a, up], -b),
        patch(corner + b, [a, up], b),
        patch(corner, [b, up], -a),
        patch(corner + a, [b, up], a),
        patch(corner + up, [a, b], up),
    ]
}

fn patches(stable: Stable, rng: &mut ChaCha8Rng) -> Vec<Patch> {
    let patch = |area, corner: [f64; 3], a: [f64; 3], b: [f64; 3], wave_m| Patch {
        area,
        corner: corner.into(),
        edges: [a.into(), b.into()],
        wave_m,
        moved: Vector3::zeros(),
        outward: None,
        has_edges: false,
    };

    let side = |y: f64| Patch {
        outward: Some(Vector3::y() * y.signum()),
        ..patch(1, [0.7, y, 0.0], [0.8, 0.0, 0.0], [0.0, 0.0, 1.2], 0.0)
    };
    let ground = || patch(0, [0.6, -2.5, 0.0], [0.0, 5.0, 0.0], [1.5, 0.0, 0.0], 0.02);

    let small_building = || {
        vec![
            patch(1, [1.5, -0.6, 0.0], [0.0, 1.2, 0.0], [0.0, 0.0, 1.2], 0.0),
            patch(1, [0.7, -0.6, 1.2], [0.0, 1.2, 0.0], [0.8, 0.0, 0.0], 0.0),
            side(-0.6),
            side(0.6),
        ]
    };

    let with_building = || {
        let mut list = small_building();
        list.push(ground());
        list
    };

    match stable {
        Stable::None => Vec::new(),
        Stable::Ground => vec![ground()],
        Stable::Building => with_building(),
        Stable::Moved => {
            let mut moved = patch(2, [0.3, 2.2, 0.3], [0.3, 0.8, 0.0], [-0.2, 0.1, 2.0], 0.01);
            moved.moved = Vector3::new(0.02, 0.0, -0.01);
            let mut list = with_building();
            list.push(moved);
            list
        }
        Stable::Buildings => {
            let count = rng.random_range(1..=3);
            let mut list: Vec<Patch> = (1..=count).flat_map(|area| building(area, rng)).collect();
            list.push(ground());
            list
        }
    }
}

fn stable(
    kind: Stable,
    errors: &[SourceError],
    what: &Instrument,
    rng: &mut ChaCha8Rng,
) -> Vec<StablePoints> {
    let half = errors.len() / 2;
    let patches = patches(kind, rng);
    let mut list = Vec::new();
    for patch in &patches {
        for (s, error) in errors.iter().enumerate() {
            let points = on_patch(patch, error, s >= half, what, rng);
            list.push(StablePoints {
                area: patch.area,
                source: s,
                times_s: points.iter().map(|p| time_s(s, p)).collect(),
                points: Cloud::from_world(Point3::new(1.0, 0.0, 0.5), points),
            });
        }
    }
    list
}

fn on_patch(
    patch: &Patch,
    error: &SourceError,
    is_later: bool,
    what: &Instrument,
    rng: &mut ChaCha8Rng,
) -> Vec<Point3<f64>> {
    let [a, b] = patch.edges;
    let cross = a.cross(&b);
    let normal_of_patch = cross.normalize();
    let middle = patch.corner + 0.5 * (a + b);
    let view = error.sensor_for(&middle) - middle;
    let cosine = (normal_of_patch.dot(&view) / view.norm()).abs();

    // Faces turned away show nothing.
    if patch.outward.is_some_and(|outward| outward.dot(&view) <= 0.0) {
        return Vec::new();
    }
    let reach_m = match patch.has_edges {
        true => 0.5 * what.footprint_m / cosine,
        false => 0.0,
    };
    let count = (what.density * cross.norm() * cosine) as usize;

    (0..count)
        .map(|_| {
            let (u, v): (f64, f64) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            let flat = patch.corner + a * u + b * v;
            let wave = patch.wave_m * ((4.0 * flat.y).sin() + (5.0 * flat.x + 1.0).cos());
            let place = flat + normal_of_patch * wave;
            let target = Target {
                place,
                normal: normal_of_patch * normal_of_patch.dot(&view).signum(),
                brightness: 0.0,
            };
            let beam = (place - error.sensor_for(&place)).normalize();
            let moved = if is_later { patch.moved } else { Vector3::zeros() };
            let mixed = beam * beam.dot(&off_edge(patch, [u, v], reach_m));
            place + beam * (what.sigma_m * normal(rng)) + mixed + error.at(&target) + moved
        })
        .collect()
}

/// Where the middle of the part of the beam lies that still hits the patch, against the middle of the beam, which
/// hits it at these shares of its edges and reaches `reach_m` along it.
fn off_edge(patch: &Patch, at: [f64; 2], reach_m: f64) -> Vector3<f64> {
    let along = |(edge, at): (&Vector3<f64>, f64)| {
        let length = edge.norm();
        let [low, high] = [at, 1.0 - at].map(|share| (reach_m - share * length).max(0.0));
        edge / length * (0.5 * (low - high))
    };
    patch.edges.iter().zip(at).map(along).sum()
}
