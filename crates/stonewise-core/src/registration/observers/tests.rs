//! The observers' errors, against surveys drawn from their model and against closed forms.

mod influence;

use super::component_estimate::estimate;
use super::components::{ObserverComponents, SensorClass};
use super::datum::Datum;
use super::epoch_error::{EpochErrors, epoch_errors};
use super::epoch_pair::{EpochErrorParams, EpochPair};
use super::model::{Prior, Problem, Unknowns};
use super::observation::Observation;
use super::sight::{SeenStone, Sight, Source, SourcePoints, Target};
use super::stable::{StableParams, StablePoints, stable_observations};
use crate::cloud::Cloud;
use crate::progress::Silent;
use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0
}

fn sources(count: usize) -> Vec<Source> {
    (0..2 * count)
        .map(|s| Source {
            name: format!("{s}"),
            epoch: s / count,
            has_times: true,
            same_as: None,
        })
        .collect()
}

fn sight(source: usize, place: Point3<f64>) -> Sight {
    Sight {
        source,
        time_s: 10.0 * source as f64 + place.y,
        place,
        target: Target::Stone { normal: Vector3::x() },
    }
}

/// Differences of the displacements that `sources` show of a place, each with noise `sd_m`.
fn difference(sources: &[usize], seen: &[Vector3<f64>], place: Point3<f64>, sd_m: f64) -> Observation {
    let others = sources.len() - 1;
    Observation {
        sights: sources.iter().map(|&s| sight(s, place)).collect(),
        directions: vec![Vector3::x(), Vector3::y(), Vector3::z()],
        values: DVector::from_fn(3 * others, |r, _| seen[1 + r / 3][r % 3] - seen[0][r % 3]),
        covariance: DMatrix::from_fn(3 * others, 3 * others, |r, c| {
            let shared = if r % 3 == c % 3 { 1.0 } else { 0.0 };
            sd_m * sd_m * (shared + if r == c { 1.0 } else { 0.0 })
        }),
        face_from_world: Matrix3::identity(),
        weight: 1.0,
    }
}

/// Differences of `count` sources on 60 places, each source shifted by `errors`, seen with noise `sd_m`.
fn observations(epoch: usize, errors: &[Vector3<f64>], sd_m: f64, seed: u64) -> Vec<Observation> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let count = errors.len() / 2;
    let of_epoch: Vec<usize> = (0..errors.len()).filter(|s| s / count == epoch).collect();
    (0..60)
        .map(|k| {
            let place = Point3::new(0.0, 0.3 * f64::from(k % 12), 0.25 * f64::from(k / 12));
            let seen: Vec<Vector3<f64>> = of_epoch
                .iter()
                .map(|&s| errors[s] + Vector3::from_fn(|_, _| sd_m * normal(&mut rng)))
                .collect();
            difference(&of_epoch, &seen, place, sd_m)
        })
        .collect()
}

#[test]
fn the_size_of_the_sources_errors_is_found_within_its_sampling_range() {
    // Ten sources in each epoch: 54 independent numbers, so that their scatter is known to 10 %.
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let count = 10;
    let errors: Vec<Vector3<f64>> = (0..2 * count)
        .map(|_| Vector3::from_fn(|_, _| 0.003 * normal(&mut rng)))
        .collect();
    let list: Vec<Observation> = (0..2)
        .flat_map(|e| observations(e, &errors, 0.002, 7 + e as u64))
        .collect();
    let all: Vec<&Observation> = list.iter().collect();
    let sights: Vec<Sight> = list.iter().flat_map(|o| o.sights.clone()).collect();
    let unknowns = Unknowns::new(&sources(count), &sights, SensorClass::Airborne);
    let found = estimate(&Problem::new(&unknowns, &all), SensorClass::Airborne, &Silent).unwrap();
    assert!((0.0022..0.0042).contains(&found.translation_m), "{found:?}");
    assert!(found.drift_m < 0.001 && found.noise_scale < 1.5, "{found:?}");
}

/// Differences of stations 10 m apart along y, each of which sees 15 m to either side, shifted by `errors` and
/// stretched by `stretch` about itself.
fn chain(epoch: usize, errors: &[Vector3<f64>], stretch: f64, sd_m: f64, seed: u64) -> Vec<Observation> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let count = errors.len() / 2;
    let station = |s: usize| 10.0 * (s % count) as f64;
    (0..4 * count)
        .map(|k| {
            let place = Point3::new(0.0, 2.5 * k as f64 - 3.7, 2.0);
            let seeing: Vec<usize> = (epoch * count..(epoch + 1) * count)
                .filter(|&s| (station(s) - place.y).abs() < 15.0)
                .collect();
            let seen: Vec<Vector3<f64>> = seeing
                .iter()
                .map(|&s| {
                    let noise = Vector3::from_fn(|_, _| sd_m * normal(&mut rng));
                    errors[s] + Vector3::y() * stretch * (place.y - station(s)) + noise
                })
                .collect();
            difference(&seeing, &seen, place, sd_m)
        })
        .collect()
}

#[test]
fn a_stretch_that_all_stations_share_is_not_taken_for_errors_of_their_registration() {
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let (count, stretch) = (12, 4e-5);
    let errors: Vec<Vector3<f64>> = (0..2 * count)
        .map(|_| Vector3::from_fn(|_, _| 0.3e-3 * normal(&mut rng)))
        .collect();
    let list: Vec<Observation> = (0..2)
        .flat_map(|e| chain(e, &errors, stretch, 0.1e-3, 3 + e as u64))
        .collect();
    let all: Vec<&Observation> = list.iter().collect();
    let sights: Vec<Sight> = list.iter().flat_map(|o| o.sights.clone()).collect();
    let class = SensorClass::Terrestrial;
    let unknowns = Unknowns::new(&sources(count), &sights, class);
    let problem = Problem::new(&unknowns, &all);
    let components = estimate(&problem, class, &Silent).unwrap();
    // The scatter of 72 shifts has a standard error of a tenth.
    assert!(
        (0.2e-3..0.4e-3).contains(&components.translation_m),
        "{components:?}"
    );
    let solution = problem.solve(&Prior::new(&components, 0.0), &components).unwrap();
    let found = unknowns.stretches(&solution.mean).unwrap();
    // 0.3 mm on twelve stations over 110 m leaves 2.5 ppm.
    for of_epoch in found {
        assert!((of_epoch - stretch).abs() < 8e-6, "{found:?}");
    }
}

/// Covariance of all differences, unknowns included, and their values.
fn dense(
    unknowns: &Unknowns,
    all: &[&Observation],
    prior: &Prior,
    c: &ObserverComponents,
) -> (DMatrix<f64>, DVector<f64>) {
    let covariance_of_unknowns = unknowns.prior(prior).0.try_inverse().unwrap();
    let rows: usize = all.iter().map(|o| o.len()).sum();
    let mut design = DMatrix::zeros(rows, unknowns.count());
    let mut values = DVector::zeros(rows);
    let mut noise = DMatrix::zeros(rows, rows);
    let mut at = 0;
    for o in all {
        let (indices, matrix) = unknowns.design(o);
        for (k, &i) in indices.iter().enumerate() {
            design
                .view_mut((at, i), (o.len(), 1))
                .copy_from(&matrix.column(k));
        }
        values.rows_mut(at, o.len()).copy_from(&o.values);
        let own = o.covariance(c.noise_scale, c.nugget_m);
        noise.view_mut((at, at), (o.len(), o.len())).copy_from(&own);
        at += o.len();
    }
    (
        &design * covariance_of_unknowns * design.transpose() + noise,
        values,
    )
}

#[test]
fn the_marginal_likelihood_is_that_of_the_dense_covariance() {
    let errors = [
        Vector3::new(0.001, 0.0, 0.002),
        Vector3::zeros(),
        Vector3::zeros(),
        Vector3::zeros(),
    ];
    let list = observations(0, &errors, 0.001, 3);
    let list: Vec<Observation> = list.into_iter().step_by(9).collect();
    let all: Vec<&Observation> = list.iter().collect();
    let sights: Vec<Sight> = list.iter().flat_map(|o| o.sights.clone()).collect();
    let unknowns = Unknowns::new(&sources(2), &sights, SensorClass::Terrestrial);
    let problem = Problem::new(&unknowns, &all);
    let dense = |c: &ObserverComponents| {
        let (total, values) = dense(&unknowns, &all, &Prior::new(c, 1e-3), c);
        let log_det: f64 = total.clone().symmetric_eigenvalues().iter().map(|v| v.ln()).sum();
        log_det + values.dot(&(total.try_inverse().unwrap() * &values))
    };
    let a = ObserverComponents::expected(SensorClass::Airborne);
    let b = a.scaled(0.5);
    let fast = |c: &ObserverComponents| problem.deviance(&Prior::new(c, 1e-3), c).unwrap();
    let (expected, found) = (dense(&a) - dense(&b), fast(&a) - fast(&b));
    assert!(
        (expected - found).abs() < 1e-4 * expected.abs().max(1.0),
        "{expected} {found}"
    );
}

/// A plane z = 0 with a wall y = 2, each source shifted as a whole.
fn stable_points(errors: &[Vector3<f64>], noise_m: f64) -> Vec<StablePoints> {
    stable_area(0, &Vector3::zeros(), errors, noise_m)
}

/// Three planes at right angles, as one of several stable areas, at `place`; each source is shifted as a whole.
fn stable_area(
    area: usize,
    place: &Vector3<f64>,
    errors: &[Vector3<f64>],
    noise_m: f64,
) -> Vec<StablePoints> {
    let mut rng = ChaCha8Rng::seed_from_u64(11 + area as u64);
    let mut part = |source: usize| {
        let points: Vec<Point3<f64>> = (0..9000)
            .map(|k| {
                let (a, b) = (rng.random_range(0.0..2.0), rng.random_range(0.0..2.0));
                let off = noise_m * normal(&mut rng);
                let p = match k % 3 {
                    0 => Point3::new(a, b, off),
                    1 => Point3::new(a, 2.0 + off, b),
                    _ => Point3::new(2.0 + off, a, b),
                };
                p + errors[source] + place
            })
            .collect();
        StablePoints {
            area,
            source,
            points: Cloud::from_world(Point3::new(1.0, 1.0, 1.0) + place, points),
            times_s: vec![10.0 * source as f64; 9000],
        }
    };
    (0..errors.len()).map(&mut part).collect()
}

#[test]
fn cells_of_a_plane_on_a_cell_boundary_show_its_whole_offset() {
    // The ground lies on z = 0, where cubes meet: cut there, the noise of 10 mm would halve what is seen of 5
    // mm.
    let errors = [Vector3::zeros(), Vector3::new(0.0, 0.0, 0.005)];
    let cells = stable_observations(&stable_points(&errors, 0.01), 0.01, &StableParams::default());
    let ground: Vec<f64> = cells
        .iter()
        .filter(|o| o.directions[0].z.abs() > 0.9)
        .map(|o| o.values[0] * o.directions[0].z.signum())
        .collect();
    let mean = ground.iter().sum::<f64>() / ground.len() as f64;
    assert!(
        ground.len() >= 40 && (mean - 0.005).abs() < 1e-3,
        "{} cells, {mean}",
        ground.len()
    );
}

/// A wall of bumpy stones seen by sources with these errors.
fn wall(errors: &[Vector3<f64>], noise_m: f64, seed: u64) -> Vec<SeenStone> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..20)
        .map(|k| {
            let centroid = Point3::new(0.0, 0.3 * f64::from(k % 5), 0.3 * f64::from(k / 5));
            let phase: f64 = rng.random_range(0.0..6.0);
            let sights = (0..errors.len()).map(|source| {
                let points = (0..900).map(|_| {
                    let (y, z): (f64, f64) = (rng.random_range(-0.12..0.12), rng.random_range(-0.12..0.12));
                    let relief = 0.008 * ((35.0 * y + phase).sin() + (30.0 * z - phase).cos());
                    let local = Vector3::new(relief + noise_m * normal(&mut rng), y, z);
                    centroid + local + errors[source]
                });
                SourcePoints {
                    source,
                    count: 900,
                    time_s: 10.0 * source as f64 + centroid.y,
                    points: Cloud::from_world(centroid, points.collect::<Vec<_>>()),
                }
            });
            SeenStone {
                centroid,
                normal: Vector3::x(),
                sights: sights.collect(),
            }
        })
        .collect()
}

/// Errors of two sources in each of two epochs, metres.
const ERRORS: [Vector3<f64>; 4] = [
    Vector3::new(0.001, 0.0, -0.001),
    Vector3::new(-0.001, 0.001, 0.0),
    Vector3::new(0.004, -0.003, 0.002),
    Vector3::new(0.002, -0.002, 0.004),
];

#[test]
fn stable_areas_take_the_error_of_the_epoch_off_within_its_uncertainty() {
    let stones = wall(&ERRORS, 0.002, 1);
    let stable = stable_points(&ERRORS, 0.002);
    let sources = sources(2);
    let found = |stable: &[StablePoints]| {
        let pair = EpochPair {
            neighbours: &[[0, 1], [0, 4], [3, 3]],
            stable,
            ..EpochPair::new(&sources, &stones, 0.002)
        };
        epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap()
    };
    let truth = 0.5 * (ERRORS[2] + ERRORS[3] - ERRORS[0] - ERRORS[1]);
    let with = found(&stable);
    assert_eq!(with.datum, Datum::Stable);
    for at in &with.at {
        for a in 0..3 {
            let sd = at.covariance[(a, a)].sqrt();
            assert!(
                (at.mean[a] - truth[a]).abs() < 4.0 * sd && sd < 5e-4,
                "{} {sd} {truth}",
                at.mean
            );
        }
    }
    // Without them the mean of each epoch's sources stays as uncertain as the sources are unlike each other.
    let without = found(&[]);
    assert_eq!(without.datum, Datum::Sources);
    let sd = without.at[0].covariance[(0, 0)].sqrt();
    assert!((6e-4..4e-3).contains(&sd), "{sd}");
    assert!(without.at[0].mean.norm() < 5e-4, "{}", without.at[0].mean);
    // The nearer two stones are, the more of the error they share.
    let [near, far] = [0, 1].map(|k| without.between[k].trace().sqrt());
    assert!(
        0.0 < near && near < 0.5 * far && far < 0.5 * sd,
        "{near} {far} {sd}"
    );
    let itself = without.between[2].trace();
    assert!(itself.abs() < 1e-12 * sd * sd, "{itself}");
}

#[test]
fn a_motion_of_some_cells_is_that_of_generalised_least_squares_with_all_unknowns_in_the_covariance() {
    let errors = [
        Vector3::zeros(),
        Vector3::new(0.001, 0.0, 0.0),
        Vector3::new(0.0, 0.002, 0.003),
        Vector3::zeros(),
    ];
    let mut list = observations(0, &errors, 0.002, 4);
    list.truncate(6);
    let cells = stable_observations(&stable_points(&errors, 0.004), 0.004, &StableParams::default());
    list.extend(cells.into_iter().step_by(12));
    let all: Vec<&Observation> = list.iter().collect();
    let sights: Vec<Sight> = list.iter().flat_map(|o| o.sights.clone()).collect();
    let unknowns = Unknowns::new(&sources(2), &sights, SensorClass::Airborne).with_planes(&list);
    let c = ObserverComponents::expected(SensorClass::Airborne);
    let prior = Prior::with_planes(&c, Matrix3::identity() * 1e-4, 0.001);
    let problem = Problem::new(&unknowns, &all);
    let solution = problem.solve(&prior, &c).unwrap();
    let number = |o: &Observation| o.plane().map(|p| p.number);
    let doubted = list.iter().find_map(number);
    let is_doubted = |o: &Observation| number(o).is_some() && number(o) == doubted;
    let (information, vector) = problem.motion_of(&solution, &c, is_doubted);
    // By hand: sources 2 and 3 are those of the later epoch.
    let (total, values) = dense(&unknowns, &all, &prior, &c);
    let mut motion = DMatrix::zeros(values.len(), 3);
    let mut row = 0;
    for o in &all {
        for s in &o.sights[1..] {
            let sign = (s.source / 2) as f64 - (o.sights[0].source / 2) as f64;
            for d in &o.directions {
                if is_doubted(o) {
                    motion.row_mut(row).copy_from(&(d.transpose() * sign));
                }
                row += 1;
            }
        }
    }
    let weighted = total.try_inverse().unwrap() * &motion;
    let (expected, of_values) = (motion.transpose() * &weighted, weighted.transpose() * values);
    assert!(expected.norm() > 1e2, "{expected}");
    assert!(
        (information - &expected).norm() < 1e-6 * expected.norm(),
        "{information} {expected}"
    );
    assert!((vector - &of_values).norm() < 1e-6 * of_values.norm());
}

#[test]
fn an_area_that_moved_is_named_and_left_out() {
    let stones = wall(&ERRORS, 0.002, 1);
    let sources = sources(2);
    let found = |motion: Vector3<f64>| {
        let moved: Vec<Vector3<f64>> = (0..4)
            .map(|s| ERRORS[s] + if s < 2 { Vector3::zeros() } else { motion })
            .collect();
        let mut stable = stable_area(4, &Vector3::new(5.0, 0.0, 0.0), &moved, 0.002);
        stable.extend(stable_area(1, &Vector3::new(0.0, 4.0, 0.0), &ERRORS, 0.002));
        stable.extend(stable_area(2, &Vector3::new(5.0, 4.0, 0.0), &ERRORS, 0.002));
        let pair = EpochPair {
            stable: &stable,
            ..EpochPair::new(&sources, &stones, 0.002)
        };
        epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap()
    };
    let still = found(Vector3::zeros());
    assert_eq!(still.moved_areas, Vec::<usize>::new());
    let moved = found(Vector3::new(0.0, 0.0, 0.01));
    assert_eq!(moved.moved_areas, [4]);
    assert!(moved.observations[2] < still.observations[2]);
    let off = moved.at[0].mean - still.at[0].mean;
    assert!(off.norm() < 3e-4, "{off}");
    // So large a motion that the probabilities of all areas underflow to zero in 64-bit numbers.
    assert_eq!(found(Vector3::new(0.0, 0.0, -0.05)).moved_areas, [4]);
}

#[test]
fn stable_areas_correct_an_error_far_beyond_what_is_assumed() {
    // A scanner's epochs that are off by 30 mm, where half a millimetre is assumed.
    let off = Vector3::new(0.02, -0.015, 0.015);
    let errors = [
        Vector3::new(0.0002, 0.0, -0.0003),
        Vector3::new(-0.0002, 0.0003, 0.0),
        off + Vector3::new(0.0003, 0.0, 0.0),
        off + Vector3::new(-0.0003, 0.0002, 0.0),
    ];
    let (stones, sources) = (wall(&errors, 0.002, 1), sources(2));
    let pair = EpochPair {
        stable: &stable_points(&errors, 0.002),
        ..EpochPair::new(&sources, &stones, 0.002)
    };
    let found = epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap();
    let truth = 0.5 * (errors[2] + errors[3] - errors[0] - errors[1]);
    for at in &found.at {
        let rest = at.mean - truth;
        assert!(rest.norm() < 3e-4, "{rest}");
    }
}

#[test]
fn epochs_that_were_aligned_by_their_stones_keep_the_errors_of_stations() {
    let (stones, sources) = (wall(&ERRORS, 0.002, 1), sources(2));
    let found = |is_aligned| {
        let pair = EpochPair {
            is_aligned,
            ..EpochPair::new(&sources, &stones, 0.002)
        };
        epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap()
    };
    assert_eq!(found(false).datum, Datum::Sources);
    let aligned = found(true);
    assert_eq!(aligned.datum, Datum::Unknown);
    // Stations differ by one to three millimetres, and each stone has its own share of them.
    assert_eq!(aligned.relative.len(), stones.len());
    let largest = aligned
        .relative
        .iter()
        .map(|c| c.trace().sqrt())
        .fold(0.0, f64::max);
    assert!(largest > 1e-5 && largest < 3e-3, "{largest}");
}

#[test]
fn an_error_that_one_stable_area_alone_shows_is_named() {
    let sources = sources(2);
    // Sources that differ, of epochs that agree on the mean.
    let mean = |e: usize| 0.5 * (ERRORS[e] + ERRORS[e + 1]);
    let errors = [0, 1, 2, 3].map(|k| 0.3 * (ERRORS[k] - mean(k / 2 * 2)));
    let shift = Vector3::new(0.02, -0.015, 0.0);
    let lone_area = |shift: Vector3<f64>, areas: usize| {
        let mut of_area = errors;
        of_area[2..].iter_mut().for_each(|e| *e += shift);
        let beside = |area: usize| Vector3::new(3.0 * area as f64, 0.0, 0.0);
        let stable: Vec<StablePoints> = (0..areas)
            .flat_map(|area| stable_area(area, &beside(area), &of_area, 0.002))
            .collect();
        let stones = wall(&errors, 0.002, 1);
        let pair = EpochPair {
            stable: &stable,
            ..EpochPair::new(&sources, &stones, 0.002)
        };
        epoch_errors(&pair, &EpochErrorParams::default(), &Silent)
            .unwrap()
            .lone_area
    };
    assert_eq!(lone_area(Vector3::zeros(), 1), None);
    let lone = lone_area(shift, 1).expect("nothing confirms 25 mm");
    assert_eq!(lone.area, 0);
    assert!((lone.shift - shift).norm() < 1e-3, "{}", lone.shift);
    // Twice the shift is twice as many standard deviations of the error without the area.
    let twice = lone_area(2.0 * shift, 1).unwrap();
    let ratio = twice.standard_deviations / lone.standard_deviations;
    assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
    assert_eq!(lone_area(shift, 2), None, "the areas confirm each other");
}

#[test]
fn surfaces_off_the_wall_show_an_error_that_the_sources_do_not() {
    let sources = sources(2);
    // The third area alone settled, by `settled_m`.
    let errors_with = |shift: &Vector3<f64>, settled_m: f64, is_offered: bool| {
        let mut errors = ERRORS;
        errors[2..].iter_mut().for_each(|e| *e += shift);
        let mut offered = stable_points(&errors, 0.002);
        for (area, x, down_m) in [(1, 3.0, 0.0), (2, -3.0, settled_m)] {
            let mut of_area = errors;
            of_area[2..].iter_mut().for_each(|e| e.z -= down_m);
            offered.extend(stable_area(area, &Vector3::new(x, 0.0, 0.0), &of_area, 0.002));
        }
        let stones = wall(&errors, 0.002, 1);
        let pair = EpochPair {
            offered: if is_offered { &offered } else { &[] },
            ..EpochPair::new(&sources, &stones, 0.002)
        };
        epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap()
    };
    // An error of the epoch as small as the differences between its sources: no contradiction.
    let own = 0.5 * (ERRORS[2] + ERRORS[3] - ERRORS[0] - ERRORS[1]);
    let sound = errors_with(&(-0.6 * own), 0.0, true);
    let check = sound.cross_check.clone().unwrap();
    assert!(check.p > 0.01, "{check:?}");
    assert!((check.error - 0.4 * own).norm() < 5e-4, "{check:?} {own}");
    let unused = EpochErrors {
        cross_check: None,
        ..sound
    };
    assert_eq!(unused, errors_with(&(-0.6 * own), 0.0, false));
    let shift = Vector3::new(-0.01, 0.01, 0.012);
    let check = errors_with(&shift, 0.05, true).cross_check.unwrap();
    assert!(check.p < 1e-6, "{check:?}");
    assert!((check.error - shift - own).norm() < 1e-3, "{check:?} {own}");
    assert!(check.found.norm() < 5e-4, "{check:?}");
}

#[test]
fn what_a_source_gets_wrong_on_single_stones_is_in_their_covariance() {
    let mut stones = wall(&ERRORS, 0.002, 1);
    // A stone that only the first source of each epoch shows has all of its own error, the others half of the
    // variance.
    let mut alone = stones[7].clone();
    alone.sights.retain(|s| s.source % 2 == 0);
    stones.push(alone);
    // The halves of a source are measured at the same times.
    for s in stones
        .iter_mut()
        .flat_map(|s| &mut s.sights)
        .filter(|s| s.source >= 2)
    {
        s.time_s -= 20.0;
    }
    let mut sources = sources(2);
    (0..2).for_each(|s| sources[2 + s].same_as = Some(s));
    let pair = EpochPair::new(&sources, &stones, 0.002);
    // One survey: nothing else is uncertain where the same sources count alike.
    let found = epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap();
    let [_, across] = found.components.unwrap().nugget_m;
    for (k, share) in [(3, 1.0), (20, 2.0)] {
        let covariance = found.at[k].covariance;
        let expected = [across, 0.0, 0.0].map(|s| share * s * s);
        for a in 0..3 {
            let excess = covariance[(a, a)] - expected[a];
            assert!((-1e-12..1e-8).contains(&excess), "{k} {a}: {excess}");
        }
    }
}

#[test]
fn sources_without_errors_leave_the_datum_unknown() {
    let errors = [Vector3::zeros(); 4];
    let stones = wall(&errors, 0.002, 2);
    let sources = sources(2);
    let pair = EpochPair::new(&sources, &stones, 0.002);
    let found = epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap();
    assert_eq!(
        found.datum,
        Datum::Unknown,
        "{:?} {}",
        found.components,
        found.significance
    );
}

/// The errors that are found where the points of the second source of each epoch on some stones are others.
fn with_others(
    is_other: impl Fn(usize) -> bool,
    other: impl Fn(usize, Point3<f64>) -> Point3<f64>,
) -> EpochErrors {
    let mut stones = wall(&ERRORS, 0.001, 3);
    for (k, stone) in stones.iter_mut().enumerate().filter(|(k, _)| is_other(*k)) {
        for sight in &mut stone.sights {
            let moved = |i: usize| match sight.source % 2 {
                1 => other(k, sight.points.world(i)),
                _ => sight.points.world(i),
            };
            // The source that shows something else shows more of it on every second stone.
            let count = sight.points.len() - usize::from(k % 2 == sight.source % 2);
            let points: Vec<_> = (0..count).map(moved).collect();
            sight.points = Cloud::from_world(stone.centroid, points);
        }
    }
    let sources = sources(2);
    let pair = EpochPair::new(&sources, &stones, 0.001);
    epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap()
}

#[test]
fn sources_that_show_two_sides_of_a_corner_are_not_compared_there() {
    // The last stone of each course has a second face at its right edge.
    let at_corner = |k: usize| k % 5 == 4;
    let flank = |_, p: Point3<f64>| Point3::new(1.2 - p.y - 0.12, 1.32 + p.x, p.z);
    let (all, found) = (with_others(|_| false, flank), with_others(at_corner, flank));
    assert_eq!((all.observations, found.observations), ([20, 20, 0], [16, 16, 0]));
    let rotation_m = |e: &EpochErrors| e.components.unwrap().rotation_m;
    assert!(
        rotation_m(&found) < 2.0 * rotation_m(&all),
        "{:?}",
        found.components
    );
}

#[test]
fn stones_of_which_all_sources_show_a_flank_are_not_compared() {
    // The right fifth of the last stone of each course is folded back, as of a stone at the corner of a pier.
    let mut stones = wall(&ERRORS, 0.001, 3);
    for stone in stones.iter_mut().skip(4).step_by(5) {
        let edge = stone.centroid.y + 0.07;
        for sight in &mut stone.sights {
            let folded = |p: Point3<f64>| match p.y > edge {
                true => Point3::new(p.x - (p.y - edge), edge, p.z),
                false => p,
            };
            let points = (0..sight.points.len()).map(|i| folded(sight.points.world(i)));
            sight.points = Cloud::from_world(stone.centroid, points.collect::<Vec<_>>());
        }
    }
    let sources = sources(2);
    let pair = EpochPair::new(&sources, &stones, 0.001);
    let found = epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap();
    assert_eq!(found.observations, [16, 16, 0]);
}

#[test]
fn a_few_stones_that_a_source_shows_wrong_leave_the_errors_of_the_others() {
    let moved = |k: usize, p: Point3<f64>| p + Vector3::new(0.02, 0.0, 0.01) * (k as f64 / 6.0 - 1.0);
    let (all, found) = (with_others(|_| false, moved), with_others(|k| k % 6 == 2, moved));
    let components = found.components.unwrap();
    assert!(
        components.rotation_m < 2e-4 && components.noise_scale < 1.5,
        "{components:?}"
    );
    assert!(
        components.nugget_m.into_iter().all(|m| m < 6e-4),
        "{components:?}"
    );
    for (found, expected) in found.at.iter().zip(&all.at) {
        assert!(
            (found.mean - expected.mean).norm() < 2e-4,
            "{} {}",
            found.mean,
            expected.mean
        );
    }
}

#[test]
fn merged_points_are_as_uncertain_against_each_other_as_their_dense_covariance_less_a_rigid_motion() {
    let places: Vec<Point3<f64>> = (0..60)
        .map(|k| {
            Point3::new(
                0.1 * f64::from(k % 3),
                3.0 * f64::from(k / 3),
                2.0 * f64::from(k % 3),
            )
        })
        .collect();
    let sight = |source, place: &Point3<f64>| SourcePoints {
        source,
        count: 100,
        time_s: 0.0,
        points: Cloud::new(*place, Vec::new()),
    };
    let stones: Vec<SeenStone> = places
        .iter()
        .map(|p| SeenStone {
            centroid: *p,
            normal: Vector3::x(),
            sights: vec![sight(0, p), sight(1, p)],
        })
        .collect();
    let neighbours = [[4, 7], [0, 59]];
    let sources = sources(1);
    let pair = EpochPair {
        neighbours: &neighbours,
        ..EpochPair::new(&sources, &stones, 0.002)
    };
    let found = epoch_errors(&pair, &EpochErrorParams::default(), &Silent).unwrap();
    assert_eq!(
        (found.datum, found.merged_error_m),
        (Datum::Unknown, Some(0.7e-3))
    );
    // Both epochs: twice a Matern 3/2 process of 0.7 mm and 15 m along the wall, for each axis.
    let n = places.len();
    let matern = |k: usize, l: usize| {
        let scaled = 3f64.sqrt() * (places[k].y - places[l].y).abs() / 15.0;
        2.0 * 0.7e-3 * 0.7e-3 * (1.0 + scaled) * (-scaled).exp()
    };
    let all = DMatrix::from_fn(3 * n, 3 * n, |r, c| match r % 3 == c % 3 {
        true => matern(r / 3, c / 3),
        false => 0.0,
    });
    let mut levers = DMatrix::zeros(3 * n, 6);
    for (k, p) in places.iter().enumerate() {
        let arm = p.coords - Vector3::new(0.1, 28.5, 2.0);
        levers
            .view_mut((3 * k, 0), (3, 3))
            .copy_from(&Matrix3::identity());
        levers
            .view_mut((3 * k, 3), (3, 3))
            .copy_from(&-arm.cross_matrix());
    }
    let normal = (levers.transpose() * &levers).try_inverse().unwrap();
    let rest = DMatrix::identity(3 * n, 3 * n) - &levers * normal * levers.transpose();
    let expected = &rest * all * rest.transpose();
    let block = |r: usize, c: usize| expected.fixed_view::<3, 3>(3 * r, 3 * c).into_owned();
    let close = |found: &Matrix3<f64>, expected: &Matrix3<f64>| {
        // Between knots, 2 m apart, the drift is linear, which takes off up to 1.2 % of its variance.
        let off = (found - expected).amax();
        assert!(off < 0.015 * 2.0 * 0.7e-3 * 0.7e-3, "{found} {expected}");
    };
    for k in 0..n {
        close(&found.relative[k], &block(k, k));
    }
    for (k, [i, j]) in neighbours.into_iter().enumerate() {
        let expected = block(i, i) + block(j, j) - block(i, j) - block(j, i);
        close(&found.between[k], &expected);
    }
}
