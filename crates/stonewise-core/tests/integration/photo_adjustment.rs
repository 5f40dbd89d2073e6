//! Stones tracked in photos, from a drawn wall to motions: noisy points, textured faces, wrong poses, changed
//! appearance.

use nalgebra::{DMatrix, Matrix2, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::convert::Infallible;
use stonewise_core::cloud::Cloud;
use stonewise_core::geometry::{Camera, Rigid3, View};
use stonewise_core::id::{ImageId, StoneId};
use stonewise_core::progress::Silent;
use stonewise_core::registration::photos::{Chip, Photo, PhotoParams, PhotoSource, PhotoStatus};
use stonewise_core::registration::{
    AdjustmentParams, AdjustmentReport, FaceShift, MemoryPairs, PairPoints, PhotoReport, adjust,
    adjust_with_photos,
};
use stonewise_core::statistics::split_mix;

const COLUMNS: usize = 8;
const ROWS: usize = 6;
const WIDTH_M: f64 = 0.26;
const HEIGHT_M: f64 = 0.2;
/// Mortar between stones.
const JOINT_M: f64 = 0.02;
/// The stone that slid, and the one whose face changed.
const SLID: usize = 20;
const STAINED: usize = 29;
/// Edge of the pictures of matched faces.
const PICTURE_PX: usize = 32;

fn centre(k: usize) -> Point3<f64> {
    Point3::new(
        0.0,
        WIDTH_M * (k % COLUMNS) as f64,
        HEIGHT_M * (k / COLUMNS) as f64,
    )
}

/// Motion of a stone in the face, metres: y, z.
fn motion(k: usize) -> Vector3<f64> {
    let all = Vector3::new(0.0, 0.002, -0.001);
    if k == SLID {
        all + Vector3::new(0.0, 0.006, 0.003)
    } else {
        all
    }
}

/// Grain of 4 and of 12 mm, -1..1.
fn texture(y: f64, z: f64) -> f64 {
    let lattice = |i: i64, j: i64, s: u64| {
        let number = (i + 50_000) as u64 * 200_003 + (j + 50_000) as u64 + s * 77_777_777;
        split_mix(number) as f64 / u64::MAX as f64 - 0.5
    };
    let grain = |size: f64, s: u64| {
        let (a, b) = (y / size, z / size);
        let (i, j) = (a.floor(), b.floor());
        let ease = |t: f64| t * t * (3.0 - 2.0 * t);
        let (u, v) = (ease(a - i), ease(b - j));
        let at = |di: i64, dj: i64| lattice(i as i64 + di, j as i64 + dj, s);
        (1.0 - v) * ((1.0 - u) * at(0, 0) + u * at(1, 0)) + v * ((1.0 - u) * at(0, 1) + u * at(1, 1))
    };
    grain(0.009, 1) + grain(0.02, 2)
}

/// Grey value of the wall at a place in an epoch.
fn wall(epoch: usize, y: f64, z: f64, stain: f64) -> f64 {
    let nearest = |shift: &dyn Fn(usize) -> Vector3<f64>| {
        let (column, row) = ((y / WIDTH_M).round(), (z / HEIGHT_M).round());
        let inside = (0.0..COLUMNS as f64).contains(&column) && (0.0..ROWS as f64).contains(&row);
        let k = if inside {
            row as usize * COLUMNS + column as usize
        } else {
            return None;
        };
        let d = Point3::new(0.0, y, z) - (centre(k) + shift(k));
        (d.y.abs() < 0.5 * (WIDTH_M - JOINT_M) && d.z.abs() < 0.5 * (HEIGHT_M - JOINT_M)).then_some(k)
    };
    let light = [1.0, 0.7 + 0.1 * y][epoch];
    let found = match epoch {
        0 => nearest(&|_| Vector3::zeros()),
        _ => nearest(&motion),
    };
    let Some(k) = found else { return 40.0 };
    let d = if epoch == 0 { Vector3::zeros() } else { motion(k) };
    let value = texture(y - d.y, z - d.z);
    if epoch == 1 && k == STAINED && y - centre(k).y > -0.02 {
        // Moss with a grain of its own covers a good half of the face.
        let moss = texture(y + 3.0, z - 1.0);
        return light * (120.0 + 90.0 * ((1.0 - stain) * value + stain * moss));
    }
    light * (120.0 + 90.0 * value)
}

struct Drawn {
    photos: Vec<Photo>,
    params: PhotoParams,
    chips: Vec<Vec<Chip>>,
}

impl PhotoSource<Infallible> for Drawn {
    fn photos(&self) -> &[Photo] {
        &self.photos
    }

    fn params(&self) -> &PhotoParams {
        &self.params
    }

    fn picture_px(&self) -> usize {
        PICTURE_PX
    }

    fn load(&self, batch: usize) -> Result<Vec<Vec<Chip>>, Infallible> {
        Ok(self.chips.iter().skip(64 * batch).take(64).cloned().collect())
    }
}

/// Photos from 4.5 m whose poses are wrong by some tenths of a pixel.
fn drawn(stain: f64) -> Drawn {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let params = PhotoParams::default();
    let (mut photos, mut chips) = (Vec::new(), vec![Vec::new(); COLUMNS * ROWS]);
    for number in 0..8_u32 {
        let epoch = (number / 4) as usize;
        let place = Point3::new(
            4.5,
            0.1 + 0.6 * f64::from(number % 4),
            0.2 + 0.4 * f64::from(number % 2),
        );
        let target = Point3::new(0.0, 0.9, 0.5);
        let turn = Rotation3::face_towards(&(target - place), &-Vector3::z());
        let world = Rigid3::from_parts(
            Translation3::from(place),
            UnitQuaternion::from_rotation_matrix(&turn),
        );
        let view = |world: Rigid3| View {
            image: ImageId(number),
            name: number.to_string(),
            camera: Camera::pinhole(1400, 1000, 1500.0),
            cam_from_world: world.inverse(),
        };
        let mut small = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
        let wrong = Rigid3::new(small(1e-3), small(2e-4));
        let given = world * wrong;
        let (seen, told) = (view(world), view(given));
        for (k, of_stone) in chips.iter_mut().enumerate() {
            let corners = [-1.0, 1.0].map(|s| {
                let at =
                    centre(k) + Vector3::new(0.0, -s * (0.5 * WIDTH_M + 0.1), s * (0.5 * HEIGHT_M + 0.1));
                told.project(&at).unwrap().pixel
            });
            let clip = |v: f64, most: f64| v.clamp(0.0, most) as u32;
            let low = [
                clip(corners[0][0].min(corners[1][0]), 1400.0),
                clip(corners[0][1].min(corners[1][1]), 1000.0),
            ];
            let high = [
                clip(corners[0][0].max(corners[1][0]), 1400.0),
                clip(corners[0][1].max(corners[1][1]), 1000.0),
            ];
            let mut grey = Vec::new();
            for y in low[1]..high[1] {
                for x in low[0]..high[0] {
                    let (from, ray) = seen.ray([f64::from(x) + 0.5, f64::from(y) + 0.5]).unwrap();
                    let at = from + ray * (-from.x / ray.x);
                    let noise: f64 = rng.random_range(-4.0..4.0);
                    grey.push((wall(epoch, at.y, at.z, stain) + noise).clamp(0.0, 255.0) as u8);
                }
            }
            of_stone.push(Chip {
                photo: number,
                corner: low,
                width: high[0] - low[0],
                height: high[1] - low[1],
                grey,
            });
        }
        photos.push(Photo {
            name: number.to_string(),
            epoch,
            camera: Box::new(told),
        });
    }
    Drawn {
        photos,
        params,
        chips,
    }
}

/// Points every 8 mm with noise of 6 mm, as of a drone.
fn pairs() -> MemoryPairs {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let pairs = (0..COLUMNS * ROWS).map(|k| {
        let mut scan = |shift: Vector3<f64>| {
            let points: Vec<Point3<f64>> = (0..30 * 22)
                .map(|i| {
                    let (y, z) = (
                        0.008 * f64::from(i % 30) - 0.116,
                        0.008 * f64::from(i / 30) - 0.084,
                    );
                    let relief = 0.004 * ((31.0 * (y + 0.1 * k as f64)).sin() + (37.0 * z).cos());
                    let noise = stonewise_testing::normal(&mut rng);
                    centre(k) + shift + Vector3::new(relief * 0.1 + 0.006 * noise, y, z)
                })
                .collect();
            Cloud::from_world(centre(k), points)
        };
        PairPoints {
            first: StoneId(k as u32 + 1),
            second: StoneId(k as u32 + 1),
            centroid: centre(k),
            centroid_second: centre(k) + motion(k),
            normal: Vector3::x(),
            points_first: scan(Vector3::zeros()),
            points_second: scan(motion(k)),
            nearby_second: Cloud::new(centre(k), Vec::new()),
            window: None,
        }
    });
    MemoryPairs::new(pairs.collect())
}

/// Error of a stone's motion against the mean error of all, in the face, metres.
fn errors(report: &AdjustmentReport) -> Vec<Vector3<f64>> {
    let error = |k: usize| {
        let found = report.results[k].motion.as_ref().unwrap().displacement;
        let d = found - motion(k);
        Vector3::new(0.0, d.y, d.z)
    };
    let all: Vec<Vector3<f64>> = (0..COLUMNS * ROWS).map(error).collect();
    let mean = all.iter().sum::<Vector3<f64>>() / all.len() as f64;
    all.iter().map(|e| e - mean).collect()
}

/// Errors less the gradient over the wall that they share, which the photos' poses leave open by millimetres per metre.
fn without_gradient(errors: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let linear = DMatrix::from_fn(errors.len(), 3, |k, c| [1.0, centre(k).y, centre(k).z][c]);
    let found = DMatrix::from_fn(errors.len(), 3, |k, axis| errors[k][axis]);
    let fit = linear.clone().svd(true, true).solve(&found, 1e-12).unwrap();
    let rest = found - linear * fit;
    rest.row_iter()
        .map(|row| Vector3::new(row[0], row[1], row[2]))
        .collect()
}

fn rms(errors: &[Vector3<f64>]) -> f64 {
    (errors.iter().map(Vector3::norm_squared).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn photos_find_a_slide_that_noisy_points_do_not_show() {
    let (pairs, photos, params) = (pairs(), drawn(0.0), AdjustmentParams::default());
    let clouds = adjust(&pairs, &params, &Silent).unwrap();
    let both = adjust_with_photos(&pairs, Some(&photos), &params, &Silent).unwrap();
    let part = both.photos.as_ref().unwrap();
    let tracked = part
        .stones
        .iter()
        .filter(|s| s.status == PhotoStatus::Tracked)
        .count();
    assert!(tracked >= COLUMNS * ROWS - 2, "{tracked}: {part:?}");
    check_evidence(part, &photos.photos);
    let [before, after] = [&clouds, &both].map(errors);
    assert!(after[SLID].norm() < 0.001, "{:?} {:?}", before[SLID], after[SLID]);
    let [rest_before, rest_after] = [&before, &after].map(|errors| rms(&without_gradient(errors)));
    assert!(
        rest_after < 0.0001 && rest_after < 0.5 * rest_before,
        "{rest_before} {rest_after}"
    );
    let loose: Vec<usize> = (0..COLUMNS * ROWS)
        .filter(|&k| both.results[k].motion.as_ref().is_ok_and(|m| m.loose))
        .collect();
    assert_eq!(loose, [SLID]);
    // The intervals hold what is left.
    for (k, error) in after.iter().enumerate() {
        let covariance = both.results[k].motion.as_ref().unwrap().covariance;
        let sd = covariance[(1, 1)].max(covariance[(2, 2)]).sqrt();
        assert!(error.norm() < 4.0 * sd, "{k}: {error:?} {sd}");
    }
}

/// Length of a shift's error in standard deviations of its covariance.
fn deviations(shift: &FaceShift, truth: [f64; 2]) -> f64 {
    let [aa, au, uu] = shift.covariance_m2;
    let error = Vector2::from(shift.shift_m) - Vector2::from(truth);
    let inverse = Matrix2::new(aa, au, au, uu).try_inverse().unwrap();
    error.dot(&(inverse * error)).sqrt()
}

/// What clouds and each photo say is near the truth, and the pictures are there.
fn check_evidence(part: &PhotoReport, photos: &[Photo]) {
    // The wall is seen from +x: along is +y, up is +z.
    let truth = |k: usize| [motion(k).y, motion(k).z];
    let error = |k: usize| {
        let photos = part.evidence[k].as_ref()?.photos?;
        let error = Vector2::from(photos.shift_m) - Vector2::from(truth(k));
        Some(Vector3::new(0.0, error.x, error.y))
    };
    let errors: Option<Vec<Vector3<f64>>> = (0..COLUMNS * ROWS).map(error).collect();
    // The common part of the photos is the clouds'.
    for (k, error) in without_gradient(&errors.unwrap()).iter().enumerate() {
        assert!(error.norm() < 0.0002, "{k}: {error:?}");
    }
    let tracked = part.evidence.iter().enumerate();
    for (k, evidence) in tracked.filter_map(|(k, e)| Some((k, e.as_ref()?))) {
        let (clouds, together) = (evidence.clouds.unwrap(), evidence.photos.unwrap());
        assert!(deviations(&clouds, truth(k)) < 4.5, "{k}: {clouds:?}");
        // A pixel is 3 mm; one photo shows a shift to a third of it at worst.
        for shift in &evidence.shifts {
            let moved = if shift.epoch == 1 {
                together.shift_m
            } else {
                [0.0; 2]
            };
            let apart = Vector2::from(shift.shift.shift_m) - Vector2::from(moved);
            assert!(apart.norm() < 0.001, "{k}: {shift:?}");
        }
        let counts = [0, 1].map(|epoch| evidence.shifts.iter().filter(|s| s.epoch == epoch).count());
        assert_eq!(counts, part.stones[k].photos);
        let pictures = evidence.pictures.as_ref().unwrap();
        assert_eq!(pictures.photos.map(|p| photos[p].epoch), [0, 1]);
        assert_eq!(
            pictures.grey.each_ref().map(Vec::len),
            [PICTURE_PX * PICTURE_PX; 2]
        );
    }
}

/// How much of the local contrast of a stone's face changed between its pictures.
fn change(part: &PhotoReport, k: usize) -> Option<f64> {
    let pictures = part.evidence[k].as_ref()?.pictures.as_ref()?;
    let squares = pictures
        .difference
        .iter()
        .map(|d| (f64::from(*d) - 128.0).powi(2));
    Some(squares.sum::<f64>().sqrt())
}

#[test]
fn a_face_that_changed_is_not_called_loose() {
    let (pairs, params) = (pairs(), AdjustmentParams::default());
    for stain in [0.5, 1.0] {
        let both = adjust_with_photos(&pairs, Some(&drawn(stain)), &params, &Silent).unwrap();
        let stained = both.results[STAINED].motion.as_ref().unwrap();
        assert!(
            !stained.loose,
            "{stain}: {:?}",
            both.photos.unwrap().stones[STAINED]
        );
        let error = errors(&both)[STAINED].norm();
        assert!(
            error < 0.0015,
            "{stain}: {error} {:?}",
            both.photos.unwrap().stones[STAINED]
        );
        // Moss shows in the difference of the face that it grew on, and not in others'. A face that it covers
        // altogether may not be matched any more.
        let part = both.photos.unwrap();
        let mut all: Vec<f64> = (0..COLUMNS * ROWS).filter_map(|k| change(&part, k)).collect();
        all.sort_by(f64::total_cmp);
        let usual = all[all.len() / 2];
        match change(&part, STAINED) {
            Some(change) => assert!(change > 1.5 * usual, "{stain}: {change} {all:?}"),
            None => {
                let status = part.stones[STAINED].status;
                assert!(
                    stain > 0.5 && status != PhotoStatus::Tracked,
                    "{stain}: {status:?}"
                );
            }
        }
    }
}

#[test]
fn without_photos_nothing_changes() {
    let (pairs, params) = (pairs(), AdjustmentParams::default());
    let plain = adjust(&pairs, &params, &Silent).unwrap();
    let none = adjust_with_photos(&pairs, None, &params, &Silent).unwrap();
    assert_eq!(plain.results, none.results);
    assert!(none.photos.is_none() && none.components.appearance_m.is_none());
}
