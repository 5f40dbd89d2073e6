use super::*;
use crate::cloud::Cloud;
use crate::geometry::Rigid3;
use crate::id::StoneId;
use crate::stone::{MotionFailure, PairResult, StoneMotion};
use nalgebra::{Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A wall's relief, metres: waves of 10 to 40 cm, with slopes of some 10 %.
fn relief(x: f64, y: f64) -> f64 {
    0.004 * (31.0 * x + 0.5).sin() * (23.0 * y).cos() + 0.006 * (17.0 * x - 12.0 * y).sin()
}

fn flat(_: f64, _: f64) -> f64 {
    0.0
}

/// Points at random on a square of the surface, with noise across it.
fn scan(
    height: fn(f64, f64) -> f64,
    half_m: f64,
    spacing_m: f64,
    sigma_m: f64,
    seed: u64,
) -> Vec<Point3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n = (2.0 * half_m / spacing_m).powi(2) as usize;
    let sum_of_12 = |rng: &mut ChaCha8Rng| (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
    (0..n)
        .map(|_| {
            let (x, y) = (
                rng.random_range(-half_m..half_m),
                rng.random_range(-half_m..half_m),
            );
            Point3::new(x, y, height(x, y) + sigma_m * sum_of_12(&mut rng))
        })
        .collect()
}

fn block(points: &[Point3<f64>], params: &GicpParams) -> GicpBlock {
    GicpBlock::new(
        &Cloud::from_world(Point3::origin(), points.iter().copied()),
        params,
    )
}

/// A stone of 30 x 20 cm about a place.
fn stone(points: &[Point3<f64>], id: u32, centre: Point3<f64>) -> GicpStone {
    let inside = |p: &Point3<f64>| (p.x - centre.x).abs() < 0.15 && (p.y - centre.y).abs() < 0.1;
    GicpStone {
        first: StoneId(id),
        second: StoneId(id),
        centroid: centre,
        centroid_second: centre,
        points: (0..points.len() as u32)
            .filter(|&i| inside(&points[i as usize]))
            .collect(),
        points_second: 1000,
    }
}

fn narrow() -> GicpParams {
    GicpParams {
        buffer_m: 0.2,
        ..GicpParams::default()
    }
}

fn measure(
    first: &[Point3<f64>],
    second: &[Point3<f64>],
    centres: &[Point3<f64>],
    params: &GicpParams,
) -> Vec<PairResult> {
    let stones: Vec<GicpStone> = centres
        .iter()
        .zip(1..)
        .map(|(c, id)| stone(first, id, *c))
        .collect();
    align(&block(first, params), &block(second, params), &stones, params)
}

fn moved(points: &[Point3<f64>], motion: &Rigid3) -> Vec<Point3<f64>> {
    points.iter().map(|p| motion * p).collect()
}

fn small_motion() -> Rigid3 {
    Rigid3::from_parts(
        Translation3::new(0.004, -0.006, 0.008),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.004, -0.003, 0.006)),
    )
}

#[test]
fn a_known_motion_is_recovered() {
    let first = scan(relief, 0.6, 0.008, 0.0, 1);
    let truth = small_motion();
    let centre = Point3::new(0.1, -0.05, 0.0);
    for start in [GicpStart::Identity, GicpStart::Centroids] {
        let params = GicpParams { start, ..narrow() };
        let second = moved(&first, &truth);
        let motion = measure(&first, &second, &[centre], &params)[0]
            .motion
            .clone()
            .unwrap();
        assert!(
            (motion.displacement - (truth * centre - centre)).norm() < 1e-5,
            "{motion:?}"
        );
        assert!((motion.rotation - truth.rotation.scaled_axis()).norm() < 1e-5);
        assert!((motion.second_from_first * centre - truth * centre).norm() < 1e-5);
        assert!(motion.rmse_m < 1e-5);
    }
}

#[test]
fn another_sampling_of_the_same_moved_surface_gives_the_motion_too() {
    let (first, other) = (scan(relief, 0.6, 0.008, 0.0, 1), scan(relief, 0.6, 0.008, 0.0, 2));
    let truth = small_motion();
    let centre = Point3::new(0.1, -0.05, 0.0);
    let motion = measure(&first, &moved(&other, &truth), &[centre], &narrow())[0]
        .motion
        .clone()
        .unwrap();
    let error = motion.displacement - (truth * centre - centre);
    assert!(error.norm() < 3e-4 && error.z.abs() < 3e-5, "{error:?}");
}

#[test]
fn a_plane_does_not_show_motion_along_itself() {
    for sigma in [0.0, 0.002] {
        let (first, second) = (scan(flat, 0.5, 0.008, sigma, 1), scan(flat, 0.5, 0.008, sigma, 2));
        let result = &measure(&first, &second, &[Point3::origin()], &narrow())[0].motion;
        match result {
            Err(MotionFailure::Unobservable { direction }) => assert!(direction.z.abs() < 0.02),
            other => panic!("noise {sigma}: {other:?}"),
        }
    }
}

#[test]
fn the_answer_does_not_depend_on_threads() {
    let (first, second) = (
        scan(relief, 0.5, 0.01, 0.001, 1),
        scan(relief, 0.5, 0.01, 0.001, 2),
    );
    let centres: Vec<Point3<f64>> = (0..4)
        .map(|i| Point3::new(0.05 * f64::from(i), 0.0, 0.0))
        .collect();
    let with = |threads: usize| {
        stonewise_testing::on_threads(threads, || measure(&first, &second, &centres, &narrow()))
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn motions_common_to_both_epochs_cancel() {
    let first = scan(relief, 0.5, 0.01, 0.0, 1);
    let second = moved(&first, &small_motion());
    let common = Rigid3::from_parts(
        Translation3::new(3.0, -2.0, 1.0),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.8, 0.4)),
    );
    let centre = Point3::new(0.02, 0.01, 0.0);
    let params = narrow();
    let still = measure(&first, &second, &[centre], &params)[0]
        .motion
        .clone()
        .unwrap();
    let mut stone = stone(&first, 1, centre);
    stone.centroid = common * centre;
    stone.centroid_second = common * centre;
    let blocks = [&first, &second].map(|points| {
        let points = moved(points, &common);
        GicpBlock::new(&Cloud::from_world(Point3::new(3.0, -2.0, 1.0), points), &params)
    });
    let turned = align(&blocks[0], &blocks[1], &[stone], &params)[0]
        .motion
        .clone()
        .unwrap();
    assert!((common.rotation * still.displacement - turned.displacement).norm() < 2e-5);
    assert!((common.rotation * still.rotation - turned.rotation).norm() < 5e-5);
}

#[test]
fn the_covariance_is_that_of_the_errors() {
    let params = narrow();
    let mut chi2 = Vec::new();
    let (mut normal, mut along) = (0, 0);
    for seed in 0..40 {
        let first = scan(relief, 0.5, 0.012, 0.0015, 2 * seed);
        let second = scan(relief, 0.5, 0.012, 0.0015, 2 * seed + 1);
        // The steps do not settle where several partners change at the balance itself; at most two walls of forty
        // may be like that.
        let Ok(motion) = &measure(&first, &second, &[Point3::origin()], &params)[0].motion else {
            continue;
        };
        let (e, c) = (motion.displacement, motion.covariance);
        let inverse = c.fixed_view::<3, 3>(0, 0).try_inverse().unwrap();
        chi2.push(e.dot(&(inverse * e)) / 3.0);
        normal += i32::from(e.z.abs() < 1.96 * c[(2, 2)].sqrt());
        along += i32::from(e.x.abs() < 1.96 * c[(0, 0)].sqrt());
    }
    let mean = chi2.iter().sum::<f64>() / chi2.len() as f64;
    println!("chi2/3 {mean:.2}, 95 % intervals hold {normal} and {along} of 40");
    assert!(chi2.len() >= 38, "{} of 40 settled", chi2.len());
    assert!((0.4..2.5).contains(&mean), "chi2/3 {mean}");
    assert!(normal >= 30 && along >= 30, "{normal} {along} of 40");
}

#[test]
fn too_few_points_and_missing_surroundings_are_said() {
    let first = scan(relief, 0.5, 0.01, 0.0, 1);
    let nowhere: Vec<Point3<f64>> = first.iter().map(|p| p + Vector3::new(0.0, 0.0, 1.0)).collect();
    let params = narrow();
    assert_eq!(
        measure(&first, &nowhere, &[Point3::origin()], &params)[0].motion,
        Err(MotionFailure::Disagreement)
    );
    let mut few = stone(&first, 1, Point3::origin());
    few.points.truncate(10);
    let result = align(
        &block(&first, &params),
        &block(&nowhere, &params),
        &[few],
        &params,
    );
    assert!(matches!(
        result[0].motion,
        Err(MotionFailure::TooFewPoints { first: 10, .. })
    ));
    let empty = measure(&first, &[], &[Point3::origin()], &params);
    assert_eq!(empty[0].motion, Err(MotionFailure::Disagreement));
}

#[test]
fn one_stone_among_still_ones_is_loose() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let sigma = 5e-4;
    let mut stones = Vec::new();

    for id in 0..100u32 {
        let centroid = Point3::new(f64::from(id % 10) * 0.3, f64::from(id / 10) * 0.2, 0.0);
        let error =
            Vector3::from_fn(|_, _| sigma * (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>());
        let own = if id == 44 {
            Vector3::new(0.0, 0.004, 0.0)
        } else {
            Vector3::zeros()
        };
        let result = PairResult {
            body: 0,
            first: StoneId(id),
            second: StoneId(id),
            motion: Ok(StoneMotion {
                second_from_first: Rigid3::identity(),
                displacement: Vector3::new(0.02, 0.0, 0.05) + own + error,
                rotation: Vector3::zeros(),
                covariance: Matrix6::identity() * sigma * sigma,
                relative: Vector3::zeros(),
                own_motion_p: 1.0,
                relative_covariance: Matrix3::zeros(),
                loose: false,
                p_loose: None,
                observability: 1.0,
                rmse_m: 0.0,
            }),
        };
        stones.push((centroid, result));
    }

    relate_to_neighbours(&mut stones, &GicpParams::default());
    let loose: Vec<usize> = (0..100)
        .filter(|&i| stones[i].1.motion.as_ref().unwrap().loose)
        .collect();
    assert_eq!(loose, [44]);
    let relative = stones[44].1.motion.as_ref().unwrap().relative;
    assert!((relative - Vector3::new(0.0, 0.004, 0.0)).norm() < 5.0 * sigma);
}

#[test]
fn a_window_holds_all_points_within_the_buffer_of_any_of_the_stone() {
    let points = scan(relief, 0.6, 0.012, 0.001, 4);
    let centre = Point3::new(0.1, -0.05, 0.0);
    let own = stone(&points, 1, centre).points;
    let block = block(&points, &narrow());
    for buffer_m in [0.05, 0.2, 0.35] {
        let window = window::window_points(&block, &centre, &own, buffer_m);
        let place = |&i: &u32| block.points[i as usize];
        let is_near = |p: &&Point3<f64>| own.iter().any(|i| (place(i) - *p).norm() <= buffer_m);
        let expected: Vec<Vector3<f64>> = block.points.iter().filter(is_near).map(|p| p - centre).collect();
        let found: Vec<Vector3<f64>> = window.iter().map(|p| p.arm).collect();
        assert!(
            own.len() < found.len() && found.len() < points.len(),
            "{}",
            found.len()
        );
        assert_eq!(found, expected);
    }
}

#[test]
fn parameters_name_themselves() {
    let text = serde_json::to_string(&GicpParams::default()).unwrap();
    assert_eq!(
        serde_json::from_str::<GicpParams>(&text).unwrap(),
        GicpParams::default()
    );
    assert!(serde_json::from_str::<GicpParams>(r#"{"bufer_m": 1.0}"#).is_err());
    let paper: GicpParams = serde_json::from_str(r#"{"start": "centroids"}"#).unwrap();
    assert_eq!((paper.start, paper.buffer_m), (GicpStart::Centroids, 0.6));
}

#[test]
fn a_block_of_voxels_holds_a_point_of_each() {
    let points = scan(relief, 0.3, 0.004, 0.001, 8);
    let params = GicpParams {
        voxel_m: 0.01,
        ..narrow()
    };
    // Another origin, the same voxels of the world.
    let origin = Point3::new(0.013, -0.2, 0.4);
    let cloud = Cloud::from_world(origin, points.iter().copied());
    let block = GicpBlock::new(&cloud, &params);
    let voxel = |p: &Point3<f64>| [0, 1, 2].map(|a| (p[a] / 0.01).floor() as i64);
    let mut members = std::collections::BTreeMap::<[i64; 3], Vec<u32>>::new();
    for i in 0..cloud.len() {
        members.entry(voxel(&cloud.world(i))).or_default().push(i as u32);
    }
    assert_eq!(block.len(), members.len());
    assert!(3 * block.len() < points.len());
    for inside in members.values() {
        let [standing] = block.standing_for(inside)[..] else {
            panic!("one point stands for a voxel");
        };
        let place = block.points[standing as usize];
        assert!(inside.iter().any(|&i| cloud.local(i as usize) == place));
    }
    assert_eq!(
        self::block(&points, &narrow()).standing_for(&[5, 3, 5]),
        [5, 3, 5]
    );
}

#[test]
fn voxels_keep_the_motion() {
    let (first, second) = (
        scan(relief, 0.6, 0.004, 0.0005, 1),
        scan(relief, 0.6, 0.004, 0.0005, 2),
    );
    let truth = Vector3::new(0.004, -0.003, 0.006);
    let second: Vec<Point3<f64>> = second.iter().map(|p| p + truth).collect();
    for voxel_m in [0.0, 0.01] {
        let params = GicpParams { voxel_m, ..narrow() };
        let found = measure(&first, &second, &[Point3::origin()], &params);
        let motion = found[0].motion.as_ref().unwrap();
        let error = motion.displacement - truth;
        assert!(error.norm() < 1e-3, "{voxel_m}: {error}");
        let sigmas = Vector3::from_fn(|a, _| error[a] / motion.covariance[(a, a)].sqrt());
        assert!(sigmas.amax() < 4.0, "{voxel_m}: {sigmas}");
    }
}
