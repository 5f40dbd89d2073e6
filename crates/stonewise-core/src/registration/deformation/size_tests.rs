use super::body::Body;
use super::found::{Against, DeformationZone, ZoneKind};
use super::rigid_part::RigidPart;
use super::tests::{Grid, SD_M, wall_of};
use super::zones::Wall;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;
use stonewise_testing::normal;

/// Surveys of each wall.
const SEEDS: u64 = 40;

fn grid(side_m: f64) -> Grid {
    let stone_m = [0.3, 0.2];
    let [columns, rows] = stone_m.map(|m| (side_m / m) as usize);
    Grid {
        columns,
        rows,
        stone_m,
    }
}

/// cos^2 of a bulge of this diameter about (along, up).
fn cos2(grid: &Grid, k: usize, middle: [f64; 2], diameter_m: f64) -> f64 {
    let place = grid.place(k);
    let r = (place.y - middle[0]).hypot(place.z - middle[1]);
    match r < 0.5 * diameter_m {
        true => (PI * r / diameter_m).cos().powi(2),
        false => 0.0,
    }
}

/// The zones of a wall that deformed so, along, up and out, each stone with an error of its own.
fn zones(grid: &Grid, seed: u64, moved: impl Fn(usize) -> [f64; 3]) -> Vec<DeformationZone> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || SD_M * normal(&mut random);
    let mut measured = |k: usize| {
        let [along, up, out] = moved(k);
        Vector3::new(out + draw(), along + draw(), up + draw())
    };
    let deformations: Vec<Vector3<f64>> = (0..grid.count()).map(&mut measured).collect();
    let motions = wall_of(grid, |k| deformations[k]);
    let bodies = Body::all(&motions, None, 12);
    let with_sd = |d: &Vector3<f64>| (*d, Matrix3::identity() * SD_M.powi(2));
    let rigid = RigidPart {
        deformations: deformations.iter().map(with_sd).collect(),
        squares: Vec::new(),
        smoothed: Vec::new(),
    };
    Wall::new(&bodies[0], &rigid, Against::RestOfWall).zones()
}

#[test]
fn half_of_a_cos2_bulge_is_half_as_wide() {
    for (diameter_m, within_m) in [(1.0, 0.3), (3.0, 0.25 * 1.5), (10.0, 0.25 * 5.0)] {
        let grid = grid(1.4 * diameter_m + 1.0);
        for largest_sd in [10.0, 30.0] {
            let is_right = |seed: &u64| {
                let mut random = ChaCha8Rng::seed_from_u64(900 + seed);
                let middle = [0, 1].map(|_| 0.5 + diameter_m * random.random_range(0.6..0.8));
                let depth = |k| largest_sd * SD_M * cos2(&grid, k, middle, diameter_m);
                let found = zones(&grid, *seed, |k| [0.0, 0.0, depth(k)]);
                let [zone] = &found[..] else { return false };
                let is_close = |side_m: f64| (side_m - 0.5 * diameter_m).abs() < within_m;
                zone.kind == ZoneKind::Bulge && is_close(zone.length_m) && is_close(zone.width_m)
            };
            let right = (0..SEEDS).filter(is_right).count();
            assert!(right >= 36, "{diameter_m} m, {largest_sd} sd: {right}");
        }
    }
}

/// Whether the middle of a zone's stones lies within the distance of neighbours of a place (along, up).
fn is_about(grid: &Grid, zone: &DeformationZone, middle: [f64; 2]) -> bool {
    let places = zone.stones.iter().map(|id| grid.place(id.0 as usize - 1).coords);
    let mean = places.sum::<Vector3<f64>>() / zone.stones.len() as f64;
    (mean.y - middle[0]).hypot(mean.z - middle[1]) < grid.stone_m[0]
}

#[test]
fn a_bulge_out_of_the_wall_and_one_into_it_are_two_zones() {
    let grid = grid(6.0);
    let middles = [[1.9, 3.0], [4.1, 3.0]];
    for seed in 0..10 {
        let found = zones(&grid, seed, |k| {
            let [out, into] = middles.map(|middle| cos2(&grid, k, middle, 2.4));
            [0.0, 0.0, SD_M * (40.0 * out - 30.0 * into)]
        });
        let [out, into] = &found[..] else {
            panic!("{seed}: {found:?}")
        };
        assert!(out.mean_m.z > 0.0 && into.mean_m.z < 0.0, "{seed}: {found:?}");
        for (zone, middle) in found.iter().zip(middles) {
            assert_eq!(zone.kind, ZoneKind::Bulge);
            assert!(is_about(&grid, zone, middle), "{seed}: {zone:?}");
            assert!(
                (zone.length_m - 1.2).abs() < 0.3 && (zone.width_m - 1.2).abs() < 0.3,
                "{zone:?}"
            );
        }
    }
}

#[test]
fn a_bulge_on_a_wall_that_settles_more_and_more_towards_one_end_is_a_zone_of_its_own() {
    let grid = grid(6.0);
    for (of_bulge, of_end) in [(60.0, 20.0), (20.0, 60.0)] {
        for seed in 0..10 {
            let found = zones(&grid, seed, |k| {
                let share = grid.place(k).y / 6.0;
                let out = cos2(&grid, k, [3.6, 3.0], 1.8);
                [0.0, -SD_M * of_end * share, SD_M * of_bulge * out]
            });
            assert_eq!(found.len(), 2, "{seed}: {found:?}");
            let of_kind = |kind| found.iter().find(|z| z.kind == kind).unwrap();
            let bulge = of_kind(ZoneKind::Bulge);
            assert!(
                (bulge.length_m - 0.9).abs() < 0.3 && (bulge.width_m - 0.9).abs() < 0.3,
                "{bulge:?}"
            );
            let settled = of_kind(ZoneKind::Settlement);
            let nearest_m = settled.stones.iter().map(|id| grid.place(id.0 as usize - 1).y);
            let nearest_m = nearest_m.fold(f64::INFINITY, f64::min);
            assert!((nearest_m - 3.0).abs() < 0.7, "{seed}: {nearest_m}");
        }
    }
}

#[test]
fn kinds_out_of_the_wall_follow_from_the_shape() {
    let grid = grid(6.0);
    let lean = |k: usize| (grid.place(k).z / 6.0 - 0.3).max(0.0);
    let step = |k: usize| {
        let place = grid.place(k);
        f64::from((2.0..4.0).contains(&place.y) && (1.9..3.9).contains(&place.z))
    };
    for seed in 0..10 {
        for (kind, share) in [
            (ZoneKind::Lean, &lean as &dyn Fn(usize) -> f64),
            (ZoneKind::Step, &step),
        ] {
            for sd in [10.0, -40.0] {
                let found = zones(&grid, seed, |k| [0.0, 0.0, sd * SD_M * share(k)]);
                assert_eq!(found.len(), 1, "{seed}: {found:?}");
                assert_eq!(found[0].kind, kind, "{seed}: {found:?}");
            }
        }
    }
}

#[test]
fn a_bulge_along_a_battered_face_as_well_as_out_of_it_is_one_zone() {
    let grid = grid(4.0);
    for seed in 0..10 {
        let found = zones(&grid, seed, |k| {
            let share = 40.0 * SD_M * cos2(&grid, k, [2.0, 2.0], 1.8);
            [0.0, 0.3 * share, share]
        });
        let [zone] = &found[..] else {
            panic!("{seed}: {found:?}")
        };
        let largest_m = 40.0 * SD_M * 1.0_f64.hypot(0.3);
        assert!((zone.largest_m - largest_m).abs() < 4.0 * SD_M, "{zone:?}");
        assert_eq!(zone.kind, ZoneKind::Bulge);
    }
}
