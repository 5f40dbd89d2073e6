//! The network of photos against a dense bundle.

use super::sight::{AT_SLOPE, PRINCIPAL_PX, QUADRATIC_PX, slopes};
use super::*;
use crate::geometry::Camera;
use crate::geometry::Rigid3;
use crate::id::ImageId;
use nalgebra::{DVector, Matrix2x3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

fn view(centre: [f64; 3], aim: [f64; 3], focal_px: f64) -> View {
    let (centre, aim) = (Point3::from(centre), Point3::from(aim));
    let turn = UnitQuaternion::look_at_rh(&(aim - centre), &Vector3::z());
    // The camera looks along +z and has y down.
    let flip = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let turn = flip * turn;
    View {
        image: ImageId(0),
        name: String::new(),
        camera: Camera::pinhole(3000, 2000, focal_px),
        cam_from_world: Rigid3::from_parts(Translation3::from(-(turn * centre.coords)), turn),
    }
}

fn network(is_joint: bool) -> PhotoNetwork {
    let photo = |y: f64, z: f64, focal_px: f64| view([5.0, y, z], [0.0, 0.8 * y, 1.0], focal_px);
    let later_focal = if is_joint { 2000.0 } else { 2001.0 };
    PhotoNetwork {
        photos: [
            [(-1.2, 0.6), (0.1, 1.5), (1.3, 0.8)]
                .map(|(y, z)| photo(y, z, 2000.0))
                .into(),
            [(-1.0, 1.4), (0.2, 0.5), (1.1, 1.3)]
                .map(|(y, z)| photo(y, z, later_focal))
                .into(),
        ],
        is_joint,
        shifts: Vec::new(),
    }
}

fn stones() -> Vec<SeenStone> {
    let stone = |k: usize| {
        let [y, z] = [0.5 * (k % 7) as f64 - 1.5, 0.35 * (k / 7) as f64];
        SeenStone {
            centroid: Point3::new(0.25 * (3.0 * y + k as f64).sin() - 0.1 * z, y, z),
            normal: Vector3::x(),
            sights: Vec::new(),
        }
    };
    (0..42).map(stone).collect()
}

/// A view after corrections of pose and camera: turn, shift, relative focal length, principal point, and two terms
/// of radial distortion.
fn seen(view: &View, place: &Point3<f64>, by: &[f64]) -> [f64; 2] {
    let turn = Rotation3::new(Vector3::new(by[0], by[1], by[2]));
    let centre = view.centre() + Vector3::new(by[3], by[4], by[5]);
    let p = view.cam_from_world.rotation * (turn * (place - centre));
    let [x, y] = [p.x / p.z, p.y / p.z];
    let square = x * x + y * y;
    let radial = 1.0 + by[9] * square + by[10] * square * square;
    let focal = view.camera.focal_px[0] * (1.0 + by[6]);
    [
        focal * x * radial + view.camera.center_px[0] + by[7],
        focal * y * radial + view.camera.center_px[1] + by[8],
    ]
}

/// The bundle in one dense matrix with all places as unknowns, by its pseudo-inverse: derivatives by differences.
fn dense(
    network: &PhotoNetwork,
    epochs: &[usize],
    stones: &[SeenStone],
    field: [usize; 2],
) -> Vec<Vec<Vec<f64>>> {
    const STEP: f64 = 1e-6;
    let photos: Vec<(usize, usize)> = epochs.iter().flat_map(|e| (0..3).map(move |k| (*e, k))).collect();
    let unknowns = 6 * photos.len() + 5 + 3 * stones.len();
    let mut design = DMatrix::zeros(2 * photos.len() * stones.len(), unknowns);
    let mut shifts = DVector::zeros(design.nrows());
    for (row, (stone, (at, (epoch, k)))) in stones
        .iter()
        .enumerate()
        .flat_map(|s| photos.iter().enumerate().map(move |p| (s, p)))
        .enumerate()
    {
        let view = &network.photos[*epoch][*k];
        let place = stone.1.centroid;
        let [x, y] = slopes(&view.camera, seen(view, &place, &[0.0; 11]));
        for unknown in 0..14 {
            let value = |step: f64| {
                let mut by = [0.0; 11];
                let mut place = place;
                if unknown < 11 {
                    by[unknown] = step
                } else {
                    place[unknown - 11] += step
                }
                seen(view, &place, &by)
            };
            let (after, before) = (value(STEP), value(-STEP));
            let column = match unknown {
                0..6 => 6 * at + unknown,
                6..11 => 6 * photos.len() + unknown - 6,
                _ => 6 * photos.len() + 5 + 3 * stone.0 + unknown - 11,
            };
            for axis in 0..2 {
                design[(2 * row + axis, column)] = (after[axis] - before[axis]) / (2.0 * STEP);
            }
        }
        if [*epoch, *k] == [field[0], field[1] / FIELDS] {
            let term = field[1] % FIELDS;
            let scale = QUADRATIC_PX / (AT_SLOPE * AT_SLOPE);
            let size = [PRINCIPAL_PX, scale * x * x, scale * x * y, scale * y * y][term / 2];
            shifts[2 * row + term % 2] = size;
        }
    }
    let scales = DVector::from_fn(unknowns, |c, _| design.column(c).norm().recip());
    let scaled = &design * DMatrix::from_diagonal(&scales);
    let found = scaled
        .svd(true, true)
        .solve(&shifts, 1e-8)
        .unwrap()
        .component_mul(&scales);
    let camera: Vec<f64> = found.rows(6 * photos.len(), 5).iter().copied().collect();
    let of_photo = |(at, _): (usize, _)| {
        let pose = found.rows(6 * at, 6);
        pose.iter().copied().chain(camera.iter().copied()).collect()
    };
    vec![photos.iter().enumerate().map(of_photo).collect()]
}

/// Where the photos of an epoch put a place by corrected cameras and shifted image points, less where it is.
fn matched(
    network: &PhotoNetwork,
    epoch: usize,
    corrections: &[Vec<f64>],
    place: &Point3<f64>,
    field: [usize; 2],
) -> Vector3<f64> {
    let mut found = *place;
    for _ in 0..6 {
        let (mut information, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (k, view) in network.photos[epoch].iter().enumerate() {
            let mut image = seen(view, place, &[0.0; 11]);
            if field[0] == epoch && field[1] / FIELDS == k {
                let [x, y] = slopes(&view.camera, image);
                let scale = QUADRATIC_PX / (AT_SLOPE * AT_SLOPE);
                let term = field[1] % FIELDS;
                image[term % 2] += [PRINCIPAL_PX, scale * x * x, scale * x * y, scale * y * y][term / 2];
            }
            let shown = seen(view, &found, &corrections[k]);
            let mut by_place = Matrix2x3::zeros();
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = 1e-6;
                let moved = seen(view, &(found + step), &corrections[k]);
                (0..2).for_each(|r| by_place[(r, axis)] = (moved[r] - shown[r]) / 1e-6);
            }
            let rest = nalgebra::Vector2::new(image[0] - shown[0], image[1] - shown[1]);
            information += by_place.transpose() * by_place;
            right += by_place.transpose() * rest;
        }
        found += information.try_inverse().unwrap() * right;
    }
    found - place
}

#[test]
fn clouds_bend_as_a_dense_bundle_and_its_matches_say() {
    let (network, stones) = (network(true), stones());
    let size = mean_square(&network.photos, &network.shifts, &stones).sqrt();
    let modes: Vec<_> = network
        .modes(&stones)
        .unwrap()
        .into_iter()
        .map(|by| by / size)
        .collect();
    let mut columns = vec![Matrix3xX::zeros(6 * FIELDS); stones.len()];
    for number in 0..6 * FIELDS {
        let field = [number / (3 * FIELDS), number % (3 * FIELDS)];
        let corrections = dense(&network, &[0, 1], &stones, field).remove(0);
        let [first, later] = [&corrections[..3], &corrections[3..]];
        for (stone, by) in stones.iter().zip(&mut columns) {
            let apart = matched(&network, 1, later, &stone.centroid, field)
                - matched(&network, 0, first, &stone.centroid, field);
            by.set_column(number, &apart);
        }
    }
    let expected = less_rigid(stones.iter().map(|s| s.centroid), columns).unwrap();
    for k in [0, 5, 17, 24, 41] {
        for other in [k, 3, 30] {
            let expected = &expected[k] * expected[other].transpose();
            let found = &modes[k] * modes[other].transpose();
            let scale = expected.norm().max(1e-7);
            assert!(
                (found - expected).norm() < 0.02 * scale,
                "{k} {other}: {found} {expected}"
            );
        }
    }
}

#[test]
fn one_bundle_of_both_epochs_bends_less_than_one_an_epoch() {
    let stones = stones();
    let size = |is_joint: bool| {
        let modes = network(is_joint).modes(&stones).unwrap();
        modes.iter().map(|by| by.norm_squared()).sum::<f64>().sqrt()
    };
    assert!(size(false) > 2.0 * size(true), "{} {}", size(false), size(true));
}

#[test]
fn draws_of_many_fields_have_their_covariance() {
    let all = fields(60);
    let covariance = &all * all.transpose();
    let apart = covariance - DMatrix::<f64>::identity(480, 480);
    // The mean square of the errors of sampled covariances of independent units is 1 / draws.
    let square = apart.norm_squared() / (480.0 * 480.0);
    assert!((0.8..1.2).contains(&(square * MOST_FIELDS as f64)), "{square}");
}

#[test]
fn photos_that_see_nothing_leave_no_error() {
    let away = PhotoNetwork {
        photos: [vec![view([5.0, 0.0, 1.0], [9.0, 0.0, 1.0], 2000.0)], Vec::new()],
        is_joint: false,
        shifts: Vec::new(),
    };
    assert!(away.modes(&stones()).is_none());
}

/// Shifts of tracked stones by fields of this size, in units of the class, beside the noise of matches.
fn tracked(network: &PhotoNetwork, stones: &[SeenStone], size: f64, seed: u64) -> Vec<NetworkShift> {
    const NOISE_M: f64 = 1e-4;
    let mut random = Random::new(seed);
    let mut shifts = Vec::new();
    for (epoch, photos) in network.photos.iter().enumerate() {
        for (photo, view) in photos.iter().enumerate() {
            let field = nalgebra::SVector::<f64, FIELDS>::from_fn(|_, _| size * random.normal());
            for (k, stone) in stones.iter().enumerate() {
                let sight = Sight::of(0, view, stone).unwrap();
                let axes = [Vector3::y(), Vector3::z()];
                let by_face = sight.by_place * nalgebra::Matrix3x2::from_columns(&axes);
                let noise = nalgebra::Vector2::from_fn(|_, _| NOISE_M * random.normal());
                shifts.push(NetworkShift {
                    stone: k,
                    epoch,
                    photo,
                    axes,
                    shift_m: by_face.try_inverse().unwrap() * sight.fields * field + noise,
                    covariance_m2: nalgebra::Matrix2::identity() * NOISE_M.powi(2),
                });
            }
        }
    }
    shifts
}

#[test]
fn tracked_stones_show_how_large_the_fields_are() {
    let stones = stones();
    for size in [0.3, 1.0, 2.0] {
        let mean: f64 = (0..20)
            .map(|seed| {
                let mut network = network(true);
                network.shifts = tracked(&network, &stones, size, seed);
                mean_square(&network.photos, &network.shifts, &stones).ln() / 20.0
            })
            .sum();
        let found = (0.5 * mean).exp();
        assert!((0.75..1.3).contains(&(found / size)), "{size}: {found}");
    }
    // Without any, the class.
    let square = mean_square(&network(true).photos, &[], &stones);
    assert!((square / (2.0 * 0.25f64).exp() - 1.0).abs() < 0.01, "{square}");
}

/// Two photos square on to the wall from 5 m with a base of 1 m: parallax times 12.5 mm a pixel is depth.
#[test]
fn matching_errs_in_depth_as_the_base_says() {
    let photo = |y: f64| view([5.0, y, 1.0], [0.0, y, 1.0], 2000.0);
    let photos = || vec![photo(-0.5), photo(0.5)];
    let network = PhotoNetwork {
        photos: [photos(), photos()],
        is_joint: true,
        shifts: Vec::new(),
    };
    let stone = |k: u32| SeenStone {
        centroid: Point3::new(0.0, 0.01 * f64::from(k), 1.0),
        normal: Vector3::x(),
        sights: Vec::new(),
    };
    let found = network.matching(&(0..8).map(stone).collect::<Vec<_>>()).unwrap();
    // Two photos give the parallax, and two epochs the difference.
    let depth_m = 0.0125 * 0.06 * 2.0;
    assert!(
        (found.covariances[0][(0, 0)].sqrt() / depth_m - 1.0).abs() < 0.02,
        "{found:?}"
    );
    assert!((found.length_m - 110.0 * 5.0 / 2000.0).abs() < 5e-3, "{found:?}");
    let none = PhotoNetwork {
        photos: [Vec::new(), Vec::new()],
        ..network
    };
    assert_eq!(none.matching(&[]), None);
}
