//! Camera models against OpenCV, the formulae of Metashape's manual, and themselves.

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use stonewise_core::geometry::{Brown, Camera, Distortion, Rigid3, View};
use stonewise_core::id::ImageId;

/// A camera with points in its frame and the pixels that another implementation gave them.
struct Case {
    name: String,
    camera: Camera,
    points: Vec<(Point3<f64>, [f64; 2])>,
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list: Vec<f64> = value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    list.try_into().unwrap()
}

fn cases() -> Vec<Case> {
    let text = include_str!("../../../../testdata/cameras/lens.json");
    let file: Value = serde_json::from_str(text).unwrap();
    let read = |case: &Value| {
        let (radial, tangential) = (numbers(&case["radial"]), numbers(&case["tangential"]));
        let distortion = match case["model"].as_str().unwrap() {
            "brown" => Distortion::brown(radial, numbers(&case["rational"]), tangential),
            _ => Distortion::fisheye(radial, tangential),
        };
        let points = case["points"].as_array().unwrap().iter().map(|row| {
            let [x, y, z, u, v] = numbers(row);
            (Point3::new(x, y, z), [u, v])
        });
        Case {
            name: case["name"].as_str().unwrap().to_owned(),
            camera: Camera {
                width: case["width"].as_u64().unwrap() as u32,
                height: case["height"].as_u64().unwrap() as u32,
                focal_px: numbers(&case["focal_px"]),
                center_px: numbers(&case["center_px"]),
                skew_px: case["skew_px"].as_f64().unwrap(),
                distortion,
                near: None,
            },
            points: points.collect(),
        }
    };
    let cases: Vec<Case> = file.as_array().unwrap().iter().map(read).collect();
    assert_eq!(cases.len(), 9);
    cases
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn projection_agrees_with_other_implementations() {
    for case in cases() {
        assert_eq!(case.points.len(), 40);
        for (point, expected) in &case.points {
            let pixel = case.camera.project_camera_point(point).unwrap();
            let error = distance(pixel, *expected);
            assert!(error < 1e-6, "{}: {error:e} px at {point}", case.name);
        }
    }
}

#[test]
fn every_pixel_comes_back_from_its_ray() {
    for case in cases() {
        let camera = &case.camera;
        for y in (0..=camera.height).step_by(50) {
            for x in (0..=camera.width).step_by(50) {
                let pixel = [f64::from(x), f64::from(y)];
                let Some(ray) = camera.unproject(pixel) else {
                    // A fisheye's image circle need not reach the corners.
                    let r = distance(pixel, camera.center_px) / camera.focal_px[1];
                    let is_outside = case.name.contains("fisheye") && r > 1.4;
                    assert!(is_outside, "{} at {pixel:?}", case.name);
                    continue;
                };
                assert_eq!(ray.z, 1.0);
                let again = camera.project_camera_point(&Point3::from(ray * 7.3)).unwrap();
                let error = distance(pixel, again);
                assert!(error < 1e-8, "{}: {error:e} px at {pixel:?}", case.name);
            }
        }
    }
}

#[test]
fn points_behind_the_camera_have_no_pixel() {
    for case in cases() {
        for z in [0.0, -1e-300, -5.0, f64::NAN] {
            let point = Point3::new(0.01, 0.02, z);
            assert_eq!(case.camera.project_camera_point(&point), None, "{}", case.name);
        }
    }
}

#[test]
fn a_barrel_lens_ends_where_its_polynomial_turns_back() {
    // r (1 - 0.3 r^2) is largest at r = 1 / sqrt(0.9).
    let camera = Camera {
        distortion: Distortion::brown([-0.3, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2]),
        ..Camera::pinhole(4000, 3000, 2000.0)
    };
    let Distortion::Brown(brown) = &camera.distortion else {
        panic!()
    };
    assert!((brown.max_radius() - 1.0 / 0.9f64.sqrt()).abs() < 1e-9);
    assert!(
        camera
            .project_camera_point(&Point3::new(1.05, 0.0, 1.0))
            .is_some()
    );
    // Beyond, the polynomial alone would put the point back into the middle of the photo.
    let folded: f64 = 1.75 * (1.0 - 0.3 * 1.75 * 1.75);
    assert!(folded.abs() < 0.2);
    assert_eq!(camera.project_camera_point(&Point3::new(1.75, 0.0, 1.0)), None);
    // And no ray comes from where the lens never draws.
    let farthest = brown.max_radius() * 2.0 / 3.0 * 2000.0;
    assert!(camera.unproject([2000.0 + farthest - 0.1, 1500.0]).is_some());
    assert!(camera.unproject([2000.0 + farthest + 0.1, 1500.0]).is_none());
}

#[test]
fn the_end_of_the_range_matches_a_brute_force_search() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut ended = 0;
    for _ in 0..40 {
        let radial: [f64; 4] = std::array::from_fn(|_| rng.random_range(-0.4..0.4));
        let brown = Brown::new(radial, [0.0; 3], [0.0; 2], 3.0);
        let place = |r: f64| brown_radius(radial, r);
        let step = 1e-5;
        let turn = (1..300_000)
            .map(|i| f64::from(i) * step)
            .find(|&r| place(r) <= place(r - step));
        let expected = turn.unwrap_or(3.0);
        assert!((brown.max_radius() - expected).abs() < 3e-5, "{radial:?}");
        ended += usize::from(turn.is_some());
    }
    assert!(ended > 10);
}

fn brown_radius([a, b, c, d]: [f64; 4], r: f64) -> f64 {
    r + a * r.powi(3) + b * r.powi(5) + c * r.powi(7) + d * r.powi(9)
}

#[test]
fn random_lenses_can_be_inverted_over_their_whole_range() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for _ in 0..300 {
        let radial = std::array::from_fn(|i| rng.random_range(-0.3..0.3) / f64::from(1 << i));
        let tangential = std::array::from_fn(|_| rng.random_range(-0.003..0.003));
        let lens = if rng.random_bool(0.5) {
            Distortion::brown(
                radial,
                std::array::from_fn(|_| rng.random_range(-0.05..0.05)),
                tangential,
            )
        } else {
            Distortion::fisheye(radial, tangential)
        };
        let (Distortion::Brown(brown) | Distortion::Fisheye(brown)) = &lens else {
            panic!()
        };
        for _ in 0..30 {
            let radius = 0.98 * brown.max_radius().min(1.2) * rng.random_range(0.0..1.0);
            let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
            let place = [radius * angle.cos(), radius * angle.sin()];
            let Some(distorted) = lens.distort(place) else {
                panic!("{lens:?} at {place:?}");
            };
            let Some(again) = lens.undistort(distorted) else {
                panic!("{lens:?} at {place:?}, {distorted:?}");
            };
            assert!(distance(place, again) < 1e-9, "{lens:?} at {place:?}: {again:?}");
        }
    }
}

#[test]
fn a_view_sends_a_ray_through_the_point_it_shows() {
    let pose = Rigid3::from_parts(
        Translation3::new(3.0, -1.0, 12.0),
        UnitQuaternion::from_euler_angles(0.3, -1.1, 2.0),
    );
    for case in cases() {
        let view = View {
            image: ImageId(0),
            name: case.name.clone(),
            camera: case.camera,
            cam_from_world: pose,
        };
        for (point, pixel) in case.points {
            let world = pose.inverse() * point;
            let projection = view.project(&world).unwrap();
            assert!(distance(projection.pixel, pixel) < 1e-6);
            assert!((projection.depth_m - point.z).abs() < 1e-9);
            let (origin, direction) = view.ray(projection.pixel).unwrap();
            assert!((origin - view.centre()).norm() < 1e-12);
            assert!((direction.norm() - 1.0).abs() < 1e-12);
            let off: Vector3<f64> = (world - origin).cross(&direction);
            assert!(off.norm() < 1e-9, "{}", case.name);
        }
    }
}

#[test]
fn a_pixel_covers_more_ground_farther_away() {
    let view = View {
        image: ImageId(0),
        name: "photo".to_owned(),
        camera: Camera::pinhole(100, 50, 2000.0),
        cam_from_world: Rigid3::identity(),
    };
    assert!((view.gsd_m(10.0) - 0.005).abs() < 1e-15);
    let a = view.project(&Point3::new(0.0, 0.0, 10.0)).unwrap().pixel;
    let b = view
        .project(&Point3::new(view.gsd_m(10.0), 0.0, 10.0))
        .unwrap()
        .pixel;
    assert!((b[0] - a[0] - 1.0).abs() < 1e-9);
    assert!(view.is_inside(a) && view.is_inside([0.0, 49.99]));
    assert!(!view.is_inside([100.0, 10.0]) && !view.is_inside([-1e-9, 10.0]));
}
