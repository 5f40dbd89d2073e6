use super::window::Window;
use super::*;
use crate::cloud::Cloud;
use crate::geometry::Rigid3;
use crate::id::StoneId;
use crate::stone::{MotionFailure, StoneMotion};
use nalgebra::{Matrix6, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use stonewise_testing::normal;

/// A wall's relief, metres: waves of 10 to 40 cm, with slopes of some 10 %.
fn relief(x: f64, y: f64) -> f64 {
    0.004 * (31.0 * x + 0.5).sin() * (23.0 * y).cos() + 0.006 * (17.0 * x - 12.0 * y).sin()
}

/// Points at random on a square of a surface, with noise across it.
fn scan(height: fn(f64, f64) -> f64, spacing_m: f64, sd_m: f64, seed: u64) -> Vec<Point3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut point = || {
        let [x, y] = [(); 2].map(|()| rng.random_range(-0.5..0.5));
        Point3::new(x, y, height(x, y) + sd_m * normal(&mut rng))
    };
    let count = (1.0 / spacing_m).powi(2) as usize;
    (0..count).map(|_| point()).collect()
}

/// A stone of 30 x 20 cm in the middle.
fn stone(points: &[Point3<f64>]) -> GicpStone {
    let inside = |i: &u32| points[*i as usize].x.abs() < 0.15 && points[*i as usize].y.abs() < 0.1;
    GicpStone {
        first: StoneId(1),
        second: StoneId(1),
        centroid: Point3::origin(),
        points: (0..points.len() as u32).filter(inside).collect(),
        points_second: 1000,
    }
}

fn params(buffer_m: f64, voxel_m: f64) -> GicpParams {
    let mut params = GicpParams::default();
    (params.buffer_m, params.voxel_m) = (buffer_m, voxel_m);
    params
}

fn block(points: &[Point3<f64>], params: &GicpParams) -> GicpBlock {
    let cloud = Cloud::from_world(Point3::new(0.013, -0.2, 0.4), points.iter().copied());
    GicpBlock::new(&cloud, params)
}

fn measure(clouds: [&[Point3<f64>]; 2], params: &GicpParams) -> Result<StoneMotion, MotionFailure> {
    let [first, second] = clouds.map(|points| block(points, params));
    let mut results = align(&first, &second, &[stone(clouds[0])], params);
    results.remove(0).motion
}

#[test]
fn a_known_motion_is_recovered() {
    let shift = Vector3::new(0.004, -0.006, 0.008);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.004, -0.003, 0.006));
    let truth = Rigid3::from_parts(Translation3::from(shift), turn);
    let first = scan(relief, 0.008, 0.0, 1);
    // The same points, and others of the same surface, which show less; all, and one of each voxel.
    for (seed, voxel_m, most_m) in [(1, 0.0, 1e-5), (2, 0.0, 3e-4), (2, 0.012, 1e-3)] {
        let second = scan(relief, 0.008, 0.0, seed);
        let second: Vec<_> = second.iter().map(|p| truth * p).collect();
        let motion = measure([&first, &second], &params(0.2, voxel_m)).unwrap();
        let error = motion.displacement - shift;
        assert!(error.norm() < most_m && error.z.abs() < 1e-4, "{error}");
        assert!((motion.rotation - turn.scaled_axis()).norm() < 3.0 * most_m);
        let centre = motion.second_from_first * Point3::origin();
        assert!((centre.coords - motion.displacement).norm() < 1e-12);
    }
}

#[test]
fn a_block_of_voxels_holds_a_point_of_each() {
    // Four points in each of 100 voxels.
    let place = |i: u32| [i % 10, i / 10 % 10, 0].map(|cell| 0.01 * f64::from(cell) + 0.002);
    let points = (0..400).map(|i| Point3::from(place(i)) + Vector3::x() * 0.001 * f64::from(i / 100));
    let kept = block(&points.collect::<Vec<_>>(), &params(0.2, 0.01)).kept;
    let voxels: BTreeSet<u32> = kept.iter().map(|i| i % 100).collect();
    assert!(
        kept.is_sorted() && kept.len() == 100 && voxels.len() == 100,
        "{kept:?}"
    );
}

#[test]
fn a_plane_does_not_show_motion_along_itself() {
    for sd in [0.0, 0.002] {
        let [first, second] = [1, 2].map(|seed| scan(|_, _| 0.0, 0.008, sd, seed));
        match measure([&first, &second], &params(0.2, 0.0)) {
            Err(MotionFailure::Unobservable { direction }) => assert!(direction.z.abs() < 0.02),
            other => panic!("noise {sd}: {other:?}"),
        }
    }
}

#[test]
fn the_covariance_is_that_of_the_errors() {
    let (mut sum, mut settled, mut inside) = (0.0, 0, [0; 3]);
    for seed in 0..40 {
        let [first, second] = [0, 1].map(|epoch| scan(relief, 0.012, 0.0015, 2 * seed + epoch));
        // The steps do not settle where several partners change at the balance itself; at most two walls of forty
        // may be like that.
        let Ok(motion) = measure([&first, &second], &params(0.2, 0.0)) else {
            continue;
        };
        let (e, c) = (motion.displacement, motion.covariance);
        settled += 1;
        sum += e.dot(&(c.fixed_view::<3, 3>(0, 0).try_inverse().unwrap() * e)) / 3.0;
        inside = [0, 1, 2].map(|a| inside[a] + i32::from(e[a].abs() < 1.96 * c[(a, a)].sqrt()));
    }
    let mean = sum / f64::from(settled);
    assert!(
        settled >= 38 && (0.4..2.5).contains(&mean),
        "{settled} of 40: {mean}"
    );
    assert!(inside.iter().all(|n| *n >= 30), "{inside:?} of 40");
}

#[test]
fn too_few_points_and_missing_surroundings_are_said() {
    let first = scan(relief, 0.01, 0.0, 1);
    let nowhere: Vec<Point3<f64>> = first.iter().map(|p| p + Vector3::z()).collect();
    for second in [&nowhere[..], &[]] {
        let result = measure([&first, second], &params(0.2, 0.0));
        assert_eq!(result, Err(MotionFailure::Disagreement));
    }
    let few = measure([&first[..100], &nowhere], &params(0.2, 0.0));
    assert!(matches!(few, Err(MotionFailure::TooFewPoints { .. })));
}

#[test]
fn a_window_holds_all_points_within_the_buffer_of_any_of_the_stone() {
    let points = scan(relief, 0.012, 0.001, 4);
    let stone = stone(&points);
    for params in [0.0, 0.05, 0.25].map(|buffer_m| params(buffer_m, 0.0)) {
        let block = block(&points, &params);
        let place = |i: usize| block.points[i] + block.origin.coords;
        let own = || stone.points.iter().map(|&i| place(i as usize));
        let is_near = |p: &Point3<f64>| own().any(|q| (q - p).norm() <= params.buffer_m);
        let expected = (0..points.len()).map(place).filter(is_near).count();
        let window = Window::new(&block, &block, &stone, &params);
        assert_eq!(window.points.len(), expected);
        assert!(window.points.iter().all(|[arm, _]| is_near(&Point3::from(*arm))));
    }
}

#[test]
fn one_stone_among_still_ones_is_loose() {
    let (sd, mut rng) = (5e-4, ChaCha8Rng::seed_from_u64(5));
    let own = |id: u32| Vector3::y() * if id == 44 { 0.004 } else { 0.0 };
    let block = block(&scan(relief, 0.01, 0.0, 1), &params(0.2, 0.0));
    let still = align(&block, &block, &[stone(&block.points)], &params(0.2, 0.0)).remove(0);
    let stone = |id: u32| {
        let mut result = still.clone();
        result.first = StoneId(id);
        let motion = result.motion.as_mut().unwrap();
        motion.displacement = own(id) + Vector3::from_fn(|_, _| sd * normal(&mut rng));
        motion.covariance = Matrix6::identity() * sd * sd;
        let place = [id % 10 * 3, id / 10 * 2, 0].map(|c| 0.1 * f64::from(c));
        (Point3::from(place), result)
    };
    let mut stones: Vec<_> = (0..100).map(stone).collect();
    relate_to_neighbours(&mut stones, &GicpParams::default());
    for (_, result) in stones {
        let motion = result.motion.unwrap();
        assert_eq!(motion.loose, result.first == StoneId(44));
        assert!((motion.relative - own(result.first.0)).norm() < 5.0 * sd);
    }
}
