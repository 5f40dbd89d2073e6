//! Tests of the poses' adjustment.

use super::*;
use crate::geometry::{Camera, FaceFrame, Rigid3, View};
use crate::id::ImageId;
use crate::registration::photos::{ByRows, FaceMotion, Photo, PhotoStatus};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn track(sights: Vec<Sight>) -> Track {
    Track {
        likeness: 10.0,
        status: PhotoStatus::Tracked,
        sights,
        place: [0.0; 2],
        radius_m: 0.1,
        apart_m: [0.0; 2],
        start: FaceMotion::none(),
        pictures: None,
    }
}

fn tracks(centres: &[Point3<f64>], places: &[Point3<f64>], turn: &Matrix3<f64>) -> Vec<Track> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut of_place = |at: &Point3<f64>| {
        let sights = centres.iter().enumerate().map(|(photo, centre)| {
            let ray = turn * (at - centre);
            Sight {
                photo,
                shift: Vector2::from_fn(|_, _| rng.random_range(-2e-3..2e-3)),
                covariance: Matrix2::new(2.0, 0.4, 0.4, 1.0) * 1e-8,
                parallax: [-ray.x / ray.z, -ray.y / ray.z],
                turn: None,
                by_rows: ByRows {
                    shift: Matrix2::from_fn(|_, _| rng.random_range(-1e-3..1e-3)),
                    ..ByRows::none()
                },
                correlation: 0.9,
            }
        });
        track(sights.collect())
    };
    places.iter().map(&mut of_place).collect()
}

fn pose_stones<'a>(
    tracks: &'a [Track],
    places: &[Point3<f64>],
    turn: &'a Matrix3<f64>,
    clouds: CloudMotion,
) -> Vec<PoseStone<'a>> {
    let of_place = |(track, at): (&'a Track, &Point3<f64>)| PoseStone {
        track,
        centroid: *at,
        face_from_world: turn,
        clouds,
    };
    tracks.iter().zip(places).map(of_place).collect()
}

/// The centres of five photos before nine stones, and the places of these.
fn scene() -> (Vec<Point3<f64>>, Vec<Point3<f64>>) {
    let centres = (0..5)
        .map(|i| Point3::new(6.0, f64::from(i) - 2.0, 0.5 * f64::from(i % 3)))
        .collect();
    let places = (0..9)
        .map(|i| Point3::new(0.0, f64::from(i % 3) - 1.0, f64::from(i / 3)))
        .collect();
    (centres, places)
}

#[test]
fn poses_and_displacements_are_those_of_dense_least_squares() {
    for rolling_shutter in [true, false] {
        for stones in [1, 9, 17] {
            compare_with_dense_least_squares(rolling_shutter, stones);
        }
    }
}

fn compare_with_dense_least_squares(rolling_shutter: bool, stones: usize) {
    let turn = FaceFrame::from_normal(&Vector3::x()).face_from_world();
    let (centres, _) = scene();
    let places: Vec<Point3<f64>> = (0..stones)
        .map(|i| Point3::new(0.0, (i % 3) as f64 - 1.0, (i / 3) as f64))
        .collect();
    let mut tracks = tracks(&centres, &places, &turn);
    // Photos in another order, one that does not show a stone, and one that shows it twice.
    for (k, track) in tracks.iter_mut().enumerate() {
        match k % 4 {
            1 => track.sights.reverse(),
            2 => drop(track.sights.remove(3)),
            3 => track.sights.push(Sight {
                shift: Vector2::new(1e-3, -5e-4),
                ..track.sights[1]
            }),
            _ => (),
        }
    }
    let clouds = CloudMotion {
        mean: Vector3::new(1e-3, 2e-3, -1e-3),
        covariance: Matrix3::from_diagonal(&Vector3::new(9e-6, 4e-6, 1e-6)),
    };
    let problem = PoseProblem {
        centres: &centres,
        epochs: &[0, 1, 0, 1, 1],
        scales: &[[0.003, 6.0]; 5],
        pose_error_px: 0.5,
        rolling_shutter,
        stones: pose_stones(&tracks, &places, &turn, clouds),
        middle: Point3::new(0.0, 0.0, 1.0),
        extent_m: 2.0,
    };

    let weights: Vec<Vec<f64>> = tracks
        .iter()
        .map(|track| {
            let weights = [1.0, 0.5, 1.0, 0.8, 1.0, 0.6];
            weights[..track.sights.len()].to_vec()
        })
        .collect();
    let bias_m = 5e-4;
    let scatter = Scatter {
        factor: 3.0,
        rows_px: [0.7, 0.4],
    };
    let (corrections, covariance) = problem
        .solve_weighted(&weights, &vec![1.0; stones], &scatter, bias_m, &vec![1.0; stones])
        .unwrap();

    // All unknowns side by side.
    let count = problem.unknowns();
    let all = count + STONE * stones;
    let (of_photo, of_all) = (problem.of_photo(), problem.of_all());
    let mut normal = DMatrix::<f64>::zeros(all, all);
    let mut right = DVector::<f64>::zeros(all);
    (0..count).for_each(|k| normal[(k, k)] = 1.0);

    for (k, stone) in problem.stones.iter().enumerate() {
        let at = count + STONE * k;
        normal[(at + 2, at + 2)] += HEIGHT_M.powi(-2);
        for a in 0..3 {
            let bias = if a < 2 { bias_m * bias_m } else { 0.0 };
            let w = 1.0 / (clouds.covariance[(a, a)] + bias);
            normal[(at + 3 + a, at + 3 + a)] += w;
            right[at + 3 + a] += w * clouds.mean[a];
        }
        for (sight, w) in stone.track.sights.iter().zip(&weights[k]) {
            let (own, pose, shared) = problem.rows(stone, sight, &scatter);
            let mut row = DMatrix::<f64>::zeros(2, all);
            row.view_mut((0, at), (2, STONE)).copy_from(&own);
            row.view_mut((0, of_photo * sight.photo), (2, of_photo))
                .copy_from(&pose.columns(0, of_photo));
            row.view_mut((0, of_photo * 5), (2, of_all))
                .copy_from(&shared.columns(0, of_all));
            let weight = problem.weight(sight, scatter.factor) * *w;
            normal += row.transpose() * weight * &row;
            right += row.transpose() * (weight * sight.shift);
        }
    }

    let inverse = normal.clone().try_inverse().unwrap();
    let solution = &inverse * &right;
    assert!((&corrections - solution.rows(0, count)).norm() < 1e-7 * corrections.norm());
    assert!((&covariance - inverse.view((0, 0), (count, count))).norm() < 1e-6 * covariance.norm());

    // A stone's displacement with the poses as they are.
    let poses = Poses {
        corrections,
        covariance,
        scatter,
        weights: weights.clone(),
        trust: vec![1.0; stones],
    };
    let [one, other] = [stones / 2, stones - 1];
    let system = problem.system(&problem.stones[one], &weights[one], &scatter);
    let (information, vector, by_poses) = system.displacement(&poses).unwrap();
    let bias = Matrix3::from_diagonal(&Vector3::new(bias_m * bias_m, bias_m * bias_m, 0.0));
    let prior = (clouds.covariance + bias).try_inverse().unwrap();
    let joined = (information + prior).try_inverse().unwrap() * (vector + prior * clouds.mean);
    let expected = solution.fixed_rows::<3>(count + STONE * one + 3);
    assert!(
        (joined - expected).norm() < 1e-6 * expected.norm(),
        "{joined} {expected}"
    );

    // Derivatives by differences: each unknown of the poses is changed by one.
    let other = problem.system(&problem.stones[other], &weights[other], &scatter);
    let changes = |system: &StoneSystem| -> DMatrix<f64> {
        let displacement = |step: Option<usize>| {
            let mut poses = poses.clone();
            step.into_iter().for_each(|k| poses.corrections[k] += 1.0);
            let (information, vector, _) = system.displacement(&poses).unwrap();
            information.try_inverse().unwrap() * vector
        };
        let columns = (0..count).map(|k| displacement(Some(k)) - displacement(None));
        DMatrix::from_fn(3, count, |r, k| columns.clone().nth(k).unwrap()[r])
    };

    let expected = changes(&system) * &poses.covariance * changes(&other).transpose();
    let (_, _, other) = other.displacement(&poses).unwrap();
    let found = by_poses.covariance_with(&other, &poses.covariance);
    assert!(
        (found - &expected).norm() < 1e-6 * expected.norm(),
        "{found} {expected}"
    );
}

#[test]
fn shifted_rows_do_not_move_stones() {
    let turn = FaceFrame::from_normal(&Vector3::x()).face_from_world();
    let places: Vec<Point3<f64>> = (0..30)
        .map(|i| Point3::new(0.0, f64::from(i % 6) * 0.8 - 2.0, f64::from(i / 6) * 0.8 - 1.6))
        .collect();

    let photo = |i: u32| {
        let centre = Point3::new(6.0, f64::from(i % 3) - 1.0, 0.7 * f64::from(i / 3 % 2) - 0.35);
        let look = Rigid3::face_towards(&centre, &Point3::origin(), &Vector3::z()).inverse();
        Photo {
            name: i.to_string(),
            epoch: usize::from(i >= 6),
            camera: Box::new(View {
                image: ImageId(i),
                name: i.to_string(),
                camera: Camera::pinhole(2000, 1500, 2000.0),
                cam_from_world: look,
            }),
        }
    };

    let photos: Vec<Photo> = (0..12).map(photo).collect();
    let centres: Vec<Point3<f64>> = photos.iter().map(|p| p.camera.centre()).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let each: Vec<Vector2<f64>> = (0..12)
        .map(|_| Vector2::from_fn(|_, _| rng.random_range(-4.0..4.0)))
        .collect();
    let of_epochs = [Vector2::new(3.0, -2.0), Vector2::new(-3.0, 2.0)];
    let alike: Vec<Vector2<f64>> = photos.iter().map(|p| of_epochs[p.epoch]).collect();

    let worst_m = |shifts_px: &[Vector2<f64>], known: f64| {
        let sight = |photo: usize, at: &Point3<f64>| {
            let by_rows = photos[photo].by_rows(at, &turn).unwrap();
            Sight {
                photo,
                shift: by_rows.shift * shifts_px[photo],
                covariance: Matrix2::identity() * 1e-9,
                parallax: photos[photo].parallax(at, &turn).unwrap(),
                turn: None,
                by_rows: ByRows {
                    shift: by_rows.shift * known,
                    ..by_rows
                },
                correlation: 0.9,
            }
        };
        let track = |at: &Point3<f64>| track((0..12).map(|p| sight(p, at)).collect());
        let tracks: Vec<Track> = places.iter().map(track).collect();
        let clouds = CloudMotion {
            mean: Vector3::zeros(),
            covariance: Matrix3::identity() * 1e-6,
        };
        let problem = PoseProblem {
            centres: &centres,
            epochs: &photos.iter().map(|p| p.epoch).collect::<Vec<_>>(),
            scales: &[[0.003, 6.0]; 12],
            pose_error_px: 0.5,
            rolling_shutter: true,
            stones: pose_stones(&tracks, &places, &turn, clouds),
            middle: Point3::origin(),
            extent_m: 2.0,
        };
        let poses = problem.solve(1e-4, &[1.0; 30]).unwrap();
        let moved = |(stone, weights): (&PoseStone, &Vec<f64>)| {
            let (information, vector, _) = problem
                .system(stone, weights, &poses.scatter)
                .displacement(&poses)
                .unwrap();
            (information.try_inverse().unwrap() * vector).xy().norm()
        };
        let stones = problem.stones.iter().zip(&poses.weights);
        stones.map(moved).fold(0.0, f64::max)
    };

    // The last row is shifted by up to four pixels of 3 mm in each direction; no stone has moved.
    for shifts_px in [each, alike] {
        let [known, unknown] = [1.0, 0.0].map(|known| worst_m(&shifts_px, known));
        assert!(known < 2e-4 && unknown > 5e-4, "{known} {unknown}");
    }
}

#[test]
fn errors_of_the_clouds_move_the_poses_as_solving_with_them_does() {
    let turn = FaceFrame::from_normal(&Vector3::new(0.9, 0.1, 0.3)).face_from_world();
    let (centres, places) = scene();
    let tracks = tracks(&centres, &places, &turn);
    let clouds = CloudMotion {
        mean: Vector3::new(1e-3, 2e-3, -1e-3),
        covariance: Matrix3::new(9e-6, 1e-6, 0.0, 1e-6, 4e-6, 0.0, 0.0, 0.0, 1e-6),
    };
    let octaves = || {
        let octave = |share: f64, of_stones: [usize; 9]| OctavePatches {
            share,
            of_stones: of_stones.to_vec(),
            count: of_stones.iter().max().unwrap() + 1,
        };
        vec![
            octave(1.0, [0, 0, 1, 0, 0, 1, 2, 2, 2]),
            octave(0.3, [0, 0, 0, 0, 0, 1, 1, 1, 1]),
        ]
    };
    let (bias_m, factors, trust) = (5e-4, [1.5; 9], [1.0, 0.7, 1.0, 0.4, 1.0, 1.0, 0.9, 1.0, 1.0]);
    let weights: Vec<Vec<f64>> = vec![vec![1.0, 0.5, 1.0, 0.8, 1.0]; 9];
    let scatter = Scatter {
        factor: 3.0,
        rows_px: [0.7, 0.4],
    };
    let problem = |error: &dyn Fn(usize) -> Vector3<f64>| {
        let mut stones = pose_stones(&tracks, &places, &turn, clouds);
        for (k, stone) in stones.iter_mut().enumerate() {
            stone.clouds.mean += error(k);
        }
        PoseProblem {
            centres: &centres,
            epochs: &[0, 1, 0, 1, 1],
            scales: &[[0.003, 6.0]; 5],
            pose_error_px: 0.5,
            rolling_shutter: true,
            stones,
            middle: Point3::new(0.0, 0.0, 1.0),
            extent_m: 2.0,
        }
    };
    let solve = |error: &dyn Fn(usize) -> Vector3<f64>| {
        let problem = problem(error);
        problem
            .solve_weighted(&weights, &trust, &scatter, bias_m, &factors)
            .unwrap()
    };

    let (corrections, covariance) = solve(&|_| Vector3::zeros());
    let poses = Poses {
        corrections: corrections.clone(),
        covariance,
        scatter,
        weights: weights.clone(),
        trust: trust.to_vec(),
    };
    let pulled = problem(&|_| Vector3::zeros()).pulled_by(&octaves(), &poses, bias_m, &factors);
    for (axis, pulled) in pulled.iter().enumerate() {
        let found = &poses.covariance * pulled * &poses.covariance;
        let mut expected = DMatrix::zeros(corrections.len(), corrections.len());
        for octave in octaves() {
            for patch in 0..octave.count {
                let error = |k: usize| Vector3::ith(axis, f64::from(u8::from(octave.of_stones[k] == patch)));
                let moved = solve(&error).0 - &corrections;
                expected += &moved * moved.transpose() * octave.share;
            }
        }
        assert!(
            (&found - &expected).norm() < 1e-6 * expected.norm(),
            "{axis}: {} {}",
            found.norm(),
            expected.norm()
        );
    }
}
