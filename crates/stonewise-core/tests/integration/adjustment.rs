//! The adjustment on small synthetic walls whose motion is known.
//!
//! The generator is independent of the estimator: stones are patches of a sum of random waves, scanned at
//! random places with white noise. Sizes are small so that the whole file runs in seconds.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stonewise_core::cloud::Cloud;
use stonewise_core::id::StoneId;
use stonewise_core::progress::{Progress, Silent};
use stonewise_core::registration::{
    AdjustError, AdjustmentParams, AdjustmentReport, MemoryPairs, PairPoints, PairSource, adjust,
};
use stonewise_core::stone::{MotionFailure, PairResult, StoneMotion};
use stonewise_testing::normal;

/// A wall of stones facing x (radius: of its plan, infinite where flat), its sensor and its motion.
struct Wall {
    seed: u64,
    rows: u32,
    columns: u32,
    noise_m: f64,
    points: usize,
    relief: f64,
    radius_m: f64,
}

impl Default for Wall {
    fn default() -> Self {
        Self {
            seed: 1,
            rows: 5,
            columns: 7,
            noise_m: 0.0015,
            points: 900,
            relief: 1.0,
            radius_m: f64::INFINITY,
        }
    }
}

const PITCH: f64 = 0.25;
const SIDE: f64 = 0.2;

impl Wall {
    /// Place on the wall of a point (along, up, out) of its unrolled face.
    fn place(&self, a: f64, u: f64, n: f64) -> Point3<f64> {
        if self.radius_m.is_infinite() {
            return Point3::new(n, a, u);
        }
        let angle = a / self.radius_m;
        let r = self.radius_m + n;
        Point3::new(r * angle.cos() - self.radius_m, r * angle.sin(), u)
    }

    fn centre(&self, k: u32) -> (f64, f64) {
        let (row, column) = (k / self.columns, k % self.columns);
        (
            PITCH * (f64::from(column) + 0.5 * f64::from(row % 2)),
            PITCH * f64::from(row),
        )
    }

    /// Pairs whose second epoch moved by `motion` (of a centroid: translation, rotation vector).
    fn pairs(&self, motion: impl Fn(u32, &Point3<f64>) -> (Vector3<f64>, Vector3<f64>)) -> Vec<PairPoints> {
        (0..self.rows * self.columns)
            .map(|k| self.pair(k, &motion))
            .collect()
    }

    fn pair(
        &self,
        k: u32,
        motion: &impl Fn(u32, &Point3<f64>) -> (Vector3<f64>, Vector3<f64>),
    ) -> PairPoints {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed * 1000 + u64::from(k));
        let waves: Vec<[f64; 4]> = (0..14)
            .map(|i| {
                let wavelength = 0.3 / (1.0 + 0.6 * f64::from(i));
                let angle = rng.random_range(0.0..std::f64::consts::TAU);
                let w = std::f64::consts::TAU / wavelength;
                let height = self.relief * 0.02 * wavelength.powf(1.2);
                [
                    w * angle.cos(),
                    w * angle.sin(),
                    rng.random_range(0.0..std::f64::consts::TAU),
                    height,
                ]
            })
            .collect();
        let (a0, u0) = self.centre(k);
        let mut scan = || -> Vec<Point3<f64>> {
            (0..self.points)
                .map(|_| {
                    let (a, u) = (
                        rng.random_range(-0.5..0.5) * SIDE,
                        rng.random_range(-0.5..0.5) * SIDE,
                    );
                    let h: f64 = waves
                        .iter()
                        .map(|w| w[3] * (w[0] * a + w[1] * u + w[2]).sin())
                        .sum();
                    self.place(a0 + a, u0 + u, h + self.noise_m * normal(&mut rng))
                })
                .collect()
        };
        let (first, mut second) = (scan(), scan());
        let centroid = mean(&first);
        let (shift, turn) = motion(k, &centroid);
        let turn = Rotation3::new(turn);
        second
            .iter_mut()
            .for_each(|p| *p = centroid + turn * (*p - centroid) + shift);
        let normal = self.place(a0, u0, 1.0) - self.place(a0, u0, 0.0);
        pair(k, &first, &second, normal)
    }
}

fn mean(points: &[Point3<f64>]) -> Point3<f64> {
    (points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64).into()
}

fn pair(k: u32, first: &[Point3<f64>], second: &[Point3<f64>], normal: Vector3<f64>) -> PairPoints {
    let centroid = mean(first);
    PairPoints {
        first: StoneId(k + 1),
        second: StoneId(k + 1),
        centroid,
        centroid_second: mean(second),
        normal,
        points_first: Cloud::from_world(centroid, first.iter().copied()),
        points_second: Cloud::from_world(centroid, second.iter().copied()),
        nearby_second: Cloud::new(centroid, Vec::new()),
        window: None,
    }
}

fn run(pairs: Vec<PairPoints>) -> AdjustmentReport {
    adjust(&MemoryPairs::new(pairs), &AdjustmentParams::default(), &Silent).unwrap()
}

fn motions(report: &AdjustmentReport) -> Vec<&StoneMotion> {
    report
        .results
        .iter()
        .map(|r| r.motion.as_ref().unwrap())
        .collect()
}

/// A settlement that grows along the wall and a bulge: millimetres per stone from one to the next.
fn smooth(p: &Point3<f64>) -> Vector3<f64> {
    let bulge = (-((p.y - 1.0).powi(2) + (p.z - 0.7).powi(2)) / 0.5).exp();
    Vector3::new(0.02 * bulge, 0.004, -0.004 * p.y)
}

fn errors(
    pairs: &[PairPoints],
    report: &AdjustmentReport,
    truth: impl Fn(&Point3<f64>) -> Vector3<f64>,
) -> Vec<Vector3<f64>> {
    motions(report)
        .iter()
        .zip(pairs)
        .map(|(m, p)| m.displacement - truth(&p.centroid))
        .collect()
}

#[test]
fn intervals_cover_what_they_claim() {
    let (mut inside, mut all, mut called) = (0.0, 0.0, 0);
    for (seed, noise_m, points) in [
        (1, 0.0015, 900),
        (2, 0.0015, 900),
        (3, 0.006, 500),
        (4, 0.012, 400),
    ] {
        let wall = Wall {
            seed,
            noise_m,
            points,
            ..Wall::default()
        };
        let pairs = wall.pairs(|_, c| (smooth(c), Vector3::zeros()));
        let report = run(pairs.clone());
        called += report.loose;
        for (e, m) in errors(&pairs, &report, smooth).iter().zip(motions(&report)) {
            for a in 0..3 {
                all += 1.0;
                inside += f64::from(u8::from(e[a].abs() <= 1.96 * m.covariance[(a, a)].sqrt()));
            }
        }
    }
    let coverage = inside / all;
    println!("coverage {coverage} called {called}");
    assert!((0.91..=0.99).contains(&coverage), "{coverage}");
    assert!(called <= 2, "{called} of 140 stones called loose");
}

#[test]
fn a_loose_stone_is_found_and_does_not_pull_its_neighbours() {
    let wall = Wall::default();
    let own = |k: u32| {
        if k == 20 {
            Vector3::new(0.006, -0.004, 0.008)
        } else {
            Vector3::zeros()
        }
    };
    let pairs = wall.pairs(|k, c| (smooth(c) + own(k), Vector3::zeros()));
    let report = run(pairs.clone());
    let found: Vec<u32> = report
        .results
        .iter()
        .filter(|r| r.motion.as_ref().unwrap().loose)
        .map(|r| r.first.0)
        .collect();
    assert_eq!(found, [21]);
    for (k, e) in errors(&pairs, &report, smooth).into_iter().enumerate() {
        let sd = motions(&report)[k]
            .covariance
            .fixed_view::<3, 3>(0, 0)
            .trace()
            .sqrt();
        assert!(
            (e - own(k as u32)).norm() < (3.0 * sd).min(3e-3),
            "stone {k}: {e}"
        );
    }
    let relative = motions(&report)[20].relative;
    assert!((relative - own(20)).norm() < 3e-3, "{relative}");
}

#[test]
fn a_noisy_stone_that_went_farther_than_its_relief_reaches_is_found() {
    let wall = Wall {
        noise_m: 0.011,
        points: 700,
        relief: 3.0,
        ..Wall::default()
    };
    let far = Vector3::new(0.0, 0.024, 0.0);
    let moved = [8, 17, 26];
    let report = run(wall.pairs(|k, _| {
        let shift = if moved.contains(&k) { far } else { Vector3::zeros() };
        (shift, Vector3::zeros())
    }));
    let found: Vec<u32> = (0..35)
        .filter(|&k| report.results[k as usize].motion.as_ref().is_ok_and(|m| m.loose))
        .collect();
    assert_eq!(found, moved);
    for k in moved {
        let motion = report.results[k as usize].motion.as_ref().unwrap();
        let error = motion.displacement - far;
        let sd = motion.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
        assert!(error.norm() < 3.0 * sd && sd < 0.01, "{error} {sd}");
    }
}

/// The pairs with the epochs exchanged.
fn exchanged(pairs: &[PairPoints]) -> Vec<PairPoints> {
    let points = |cloud: &Cloud| (0..cloud.len()).map(|i| cloud.world(i)).collect::<Vec<_>>();
    pairs
        .iter()
        .zip(0..)
        .map(|(p, k)| pair(k, &points(&p.points_second), &points(&p.points_first), p.normal))
        .collect()
}

#[test]
fn exchanging_the_epochs_inverts_the_motions() {
    let turn = Vector3::new(0.001, -0.002, 0.0015);
    let moved = |c: &Point3<f64>| Vector3::new(0.002, 0.004, -0.003) + turn.cross(&c.coords);
    let scanned = Wall::default().pairs(|_, c| (moved(c), turn));
    // The second epoch by a drone: noisier by 11 mm, and with every third point.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut flown = |p: &PairPoints, k: u32| {
        let first: Vec<_> = (0..p.points_first.len())
            .map(|i| p.points_first.world(i))
            .collect();
        let second: Vec<_> = (0..p.points_second.len())
            .step_by(3)
            .map(|i| p.points_second.world(i) + p.normal * (0.011 * normal(&mut rng)))
            .collect();
        pair(k, &first, &second, p.normal)
    };
    let pairs: Vec<PairPoints> = scanned.iter().zip(0..).map(|(p, k)| flown(p, k)).collect();
    let (there, back) = (run(pairs.clone()), run(exchanged(&pairs)));
    assert!(there.converged && back.converged);
    let (mut apart, mut ratio): (f64, f64) = (0.0, 1.0);
    for ((a, b), p) in motions(&there).iter().zip(motions(&back)).zip(&pairs) {
        let returned = b.second_from_first * (a.second_from_first * p.centroid);
        let sd = a.covariance.fixed_view::<3, 3>(0, 0).diagonal().map(f64::sqrt);
        let sd_back = b.covariance.fixed_view::<3, 3>(0, 0).diagonal().map(f64::sqrt);
        for axis in 0..3 {
            apart = apart.max((returned - p.centroid)[axis].abs() / sd[axis]);
            ratio = ratio.max(sd[axis] / sd_back[axis]).max(sd_back[axis] / sd[axis]);
        }
    }
    // The grids of the surfaces lie elsewhere on the stones.
    assert!(apart < 0.3 && ratio < 1.3, "{apart} {ratio}");
}

#[test]
fn the_field_breaks_at_a_crack() {
    let wall = Wall::default();
    let side = |p: &Point3<f64>| {
        if p.y > 1.1 {
            Vector3::new(0.0, 0.008, -0.006)
        } else {
            Vector3::zeros()
        }
    };
    let pairs = wall.pairs(|_, c| (side(c), Vector3::zeros()));
    let report = run(pairs.clone());
    let errors = errors(&pairs, &report, side);
    let square: f64 = errors.iter().map(Vector3::norm_squared).sum();
    let rms = (square / errors.len() as f64).sqrt();
    assert!(rms < 8e-4, "{rms}");
    assert!(!report.breaks.is_empty());
    for b in &report.breaks {
        let at = |id: StoneId| side(&pairs[id.0 as usize - 1].centroid);
        let truth = at(b.to) - at(b.from);
        assert!(truth.norm() > 0.0, "{} and {} did not part", b.from.0, b.to.0);
        assert!((b.jump - truth).norm() < 3e-3, "{}", b.jump);
    }
}

#[test]
fn a_zone_that_creeps_in_the_face_is_shown_and_the_rest_stays_where_it_is() {
    let wall = Wall {
        rows: 12,
        columns: 14,
        ..Wall::default()
    };
    let creeps = |c: &Point3<f64>| {
        let r = (c.y - 1.8).hypot(c.z - 1.4);
        let share = (std::f64::consts::PI * r / 2.0).cos().powi(2);
        Vector3::new(0.0, 0.0, if r < 1.0 { 0.002 * share } else { 0.0 })
    };
    let pairs = wall.pairs(|_, c| (creeps(c), Vector3::zeros()));
    let report = run(pairs.clone());
    let stones: Vec<(Vector3<f64>, f64)> = motions(&report)
        .iter()
        .zip(&pairs)
        .map(|(m, p)| (m.displacement, creeps(&p.centroid).z))
        .collect();
    let shown: f64 = stones.iter().map(|(d, by)| d.z * by).sum();
    let square: f64 = stones.iter().map(|(_, by)| by * by).sum();
    let rest: Vec<f64> = stones.iter().filter(|s| s.1 == 0.0).map(|s| s.0.z).collect();
    let rms = (rest.iter().map(|z| z * z).sum::<f64>() / rest.len() as f64).sqrt();
    assert!(report.converged);
    // One drift for the whole wall shows half.
    assert!(shown / square > 0.7, "{}", shown / square);
    assert!(rms < 2e-4, "{rms}");
    assert_eq!(report.loose, 0);
}

#[test]
fn a_crack_that_no_single_stone_shows_is_found_along_its_line() {
    let wall = Wall {
        noise_m: 0.005,
        points: 400,
        rows: 6,
        columns: 10,
        ..Wall::default()
    };
    // A leaning crack: what lies right of it moved by 1 cm. Stones alone are known to some millimetres in the
    // face.
    let is_right = |p: &Point3<f64>| p.y > 1.1 + 0.3 * p.z;
    let side = |p: &Point3<f64>| {
        if is_right(p) {
            Vector3::new(0.0, 0.009, 0.004)
        } else {
            Vector3::zeros()
        }
    };
    let pairs = wall.pairs(|_, c| (side(c), Vector3::zeros()));
    let report = run(pairs.clone());
    let crossing = report.breaks.iter().filter(|b| {
        let at = |id: StoneId| &pairs[id.0 as usize - 1].centroid;
        is_right(at(b.from)) != is_right(at(b.to))
    });
    let crossing = crossing.count();
    assert!(crossing >= 10, "{crossing} ties across the crack are broken");
    // Lines are straight and stones are not: a few at the crack may fall on the wrong side of it.
    assert!(
        report.breaks.len() - crossing <= crossing / 2,
        "{} broken",
        report.breaks.len()
    );
    let errors = errors(&pairs, &report, side);
    let square: f64 = errors.iter().map(Vector3::norm_squared).sum();
    let rms = (square / errors.len() as f64).sqrt();
    assert!(rms < 2.5e-3, "{rms}");
    let whole = run(wall.pairs(|_, c| (smooth(c), Vector3::zeros())));
    assert!(
        whole.breaks.is_empty(),
        "{} breaks in a wall without one",
        whole.breaks.len()
    );
}

#[test]
fn the_common_motion_is_known_as_well_as_its_covariance_says() {
    let shift = Vector3::new(0.004, -0.003, 0.002);
    let mut normalised: Vec<f64> = (0..8)
        .map(|seed| {
            let wall = Wall {
                seed: 40 + seed,
                noise_m: 0.004,
                points: 300,
                rows: 3,
                columns: 5,
                ..Wall::default()
            };
            let report = run(wall.pairs(|_, _| (shift, Vector3::zeros())));
            let error = report.common_motion - shift;
            error.dot(&(report.common_covariance.try_inverse().unwrap() * error)) / 3.0
        })
        .collect();
    normalised.sort_by(f64::total_cmp);
    // Chi-square with three degrees of freedom over three: 99 of 100 medians of eight lie in this range.
    let median = 0.5 * (normalised[3] + normalised[4]);
    assert!((0.15..=2.2).contains(&median), "{normalised:?}");
}

#[test]
fn a_rotation_of_the_epoch_does_not_count_as_strain_where_it_is_free() {
    let wall = Wall::default();
    let (turn, middle) = (Vector3::new(2e-3, -1.5e-3, 2.5e-3), Point3::new(0.0, 0.85, 0.5));
    let still = |_: u32, _: &Point3<f64>| (Vector3::zeros(), Vector3::zeros());
    let turned = |_: u32, c: &Point3<f64>| (turn.cross(&(c - middle)), turn);
    let adjusted = |pairs: Vec<PairPoints>, free_rotation| {
        let params = AdjustmentParams {
            free_rotation,
            ..AdjustmentParams::default()
        };
        adjust(&MemoryPairs::new(pairs), &params, &Silent).unwrap()
    };
    let in_face = |report: &AdjustmentReport| report.components.strain[0];
    let expected = adjusted(wall.pairs(still), false);
    let tied = adjusted(wall.pairs(turned), false);
    let free = adjusted(wall.pairs(turned), true);
    let strains = [&expected, &tied, &free].map(in_face);
    assert!(strains[1] > 1e-3, "{strains:?}");
    assert!(strains[2] < strains[0] + 0.05 * strains[1], "{strains:?}");
    for (free, expected) in motions(&free).iter().zip(motions(&expected)) {
        assert!((free.rotation - turn).norm() < 1e-3, "{free:?}");
        let [a, b] = [free, expected].map(|m| m.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt());
        assert!(a < 1.1 * b, "{a} {b}");
    }
}

#[test]
fn stones_of_the_wrong_partner_are_refused() {
    let wall = Wall::default();
    let mut pairs = wall.pairs(|_, c| (smooth(c), Vector3::zeros()));
    let other = pairs[12].points_second.clone();
    let to = pairs[12].centroid_second;
    pairs[12].points_second = pairs[13].points_second.clone();
    pairs[12].centroid_second = pairs[13].centroid_second;
    pairs[13].points_second = other;
    pairs[13].centroid_second = to;
    let report = run(pairs.clone());
    for (k, r) in report.results.iter().enumerate() {
        match &r.motion {
            Ok(m) => {
                assert!(k != 12 && k != 13, "a swapped stone was reported");
                assert!((m.displacement - smooth(&pairs[k].centroid)).norm() < 1.5e-3);
            }
            Err(e) => {
                assert_eq!(*e, MotionFailure::Disagreement);
                assert!(k == 12 || k == 13, "a good stone was refused");
            }
        }
    }
}

#[test]
fn stones_that_ivy_covers_are_refused_and_leave_the_others_as_they_were() {
    let wall = Wall::default();
    let pairs = wall.pairs(|_, c| (smooth(c), Vector3::zeros()));
    let is_covered = |k: usize| k % wall.columns as usize <= 1;
    let grown = |(k, pair): (usize, &PairPoints)| {
        let mut rng = ChaCha8Rng::seed_from_u64(900 + k as u64);
        let mut covered = |p: Point3<f64>| match is_covered(k) && rng.random_bool(0.8) {
            true => p + Vector3::x() * (0.01 + 0.03 * normal(&mut rng).abs()),
            false => p,
        };
        let points = (0..pair.points_second.len()).map(|i| pair.points_second.world(i));
        PairPoints {
            points_second: Cloud::from_world(pair.centroid, points.map(&mut covered)),
            ..pair.clone()
        }
    };
    let report = run(pairs.iter().enumerate().map(grown).collect());
    for (k, r) in report.results.iter().enumerate() {
        match &r.motion {
            Ok(m) => {
                assert!(!is_covered(k), "{k}: {}", m.displacement);
                assert!((m.displacement - smooth(&pairs[k].centroid)).norm() < 1.5e-3);
            }
            Err(e) => assert!(
                is_covered(k) && *e == MotionFailure::Disagreement && r.body == 0,
                "{k}: {e}"
            ),
        }
    }
}

#[test]
fn the_answer_turns_with_the_world() {
    let wall = Wall {
        rows: 4,
        columns: 5,
        points: 500,
        ..Wall::default()
    };
    let pairs = wall.pairs(|_, c| (smooth(c), Vector3::zeros()));
    let turned = Isometry3::from_parts(
        Translation3::new(4.5e5, 5.6e6, 300.0),
        UnitQuaternion::from_scaled_axis(Vector3::z() * 0.9),
    );
    let moved = pairs
        .iter()
        .map(|p| {
            let carry = |c: &Cloud| {
                let points: Vec<Point3<f64>> = (0..c.len()).map(|i| turned * c.world(i)).collect();
                Cloud::from_world(turned * p.centroid, points)
            };
            PairPoints {
                centroid: turned * p.centroid,
                centroid_second: turned * p.centroid_second,
                normal: turned * p.normal,
                points_first: carry(&p.points_first),
                points_second: carry(&p.points_second),
                ..p.clone()
            }
        })
        .collect();
    let (here, there) = (run(pairs), run(moved));
    for (a, b) in motions(&here).iter().zip(motions(&there)) {
        assert!((turned * a.displacement - b.displacement).norm() < 5e-5);
    }
}

#[test]
fn a_curved_wall_that_moves_as_one_is_measured_as_one() {
    let wall = Wall {
        radius_m: 3.0,
        columns: 12,
        rows: 4,
        ..Wall::default()
    };
    let shift = Vector3::new(0.012, -0.020, 0.015);
    let pairs = wall.pairs(|_, _| (shift, Vector3::zeros()));
    let report = run(pairs.clone());
    for e in errors(&pairs, &report, |_| shift) {
        assert!(e.norm() < 3e-4, "{e}");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let wall = Wall {
        rows: 3,
        columns: 4,
        points: 300,
        ..Wall::default()
    };
    let pairs = wall.pairs(|_, c| (smooth(c), Vector3::zeros()));
    let with = |threads: usize| stonewise_testing::on_threads(threads, || run(pairs.clone()).results);
    assert_eq!(with(1), with(3));
}

#[test]
fn few_points_are_said_to_be_few() {
    let wall = Wall {
        rows: 3,
        columns: 4,
        points: 300,
        ..Wall::default()
    };
    let mut pairs = wall.pairs(|_, _| (Vector3::zeros(), Vector3::zeros()));
    let few: Vec<Point3<f64>> = (0..5).map(|i| pairs[5].points_second.world(i)).collect();
    pairs[5].points_second = Cloud::from_world(pairs[5].centroid, few);
    let report = run(pairs);
    assert!(matches!(
        report.results[5].motion,
        Err(MotionFailure::TooFewPoints { second: 5, .. })
    ));
    assert_eq!(report.results.iter().filter(|r| r.motion.is_ok()).count(), 11);
}

#[test]
fn a_flat_wall_does_not_show_motion_in_its_plane() {
    let wall = Wall {
        rows: 2,
        columns: 3,
        points: 300,
        relief: 0.0,
        ..Wall::default()
    };
    let report = run(wall.pairs(|_, _| (Vector3::new(0.0, 0.01, 0.0), Vector3::zeros())));
    for r in &report.results {
        let Err(MotionFailure::Unobservable { direction }) = &r.motion else {
            panic!("a motion was reported: {:?}", r.motion)
        };
        assert!(direction.x.abs() < 0.1);
    }
}

#[test]
fn nothing_in_nothing_out() {
    assert!(run(Vec::new()).results.is_empty());
}

#[test]
fn a_wall_of_more_than_600_stones_is_measured_too() {
    // Components are estimated on parts of such a wall, and weights follow once an iteration.
    let wall = Wall {
        noise_m: 0.002,
        points: 60,
        rows: 20,
        columns: 31,
        relief: 2.0,
        ..Wall::default()
    };
    let pairs = wall.pairs(|_, c| (smooth(c), Vector3::zeros()));
    let params = AdjustmentParams {
        max_iterations: 3,
        ..AdjustmentParams::default()
    };
    let report = adjust(&MemoryPairs::new(pairs.clone()), &params, &Silent).unwrap();
    assert_eq!((report.results.len(), report.iterations), (620, 3));
    // After three iterations a few are tried on their own and not yet evaluated there.
    let mut errors: Vec<f64> = report
        .results
        .iter()
        .zip(&pairs)
        .filter_map(|(r, p)| Some((r.motion.as_ref().ok()?.displacement - smooth(&p.centroid)).norm()))
        .collect();
    errors.sort_by(f64::total_cmp);
    let count = errors.len();
    assert!(count >= 600, "{count} of 620 stones measured");
    assert!(errors[count / 2] < 1e-3, "{}", errors[count / 2]);
}

#[test]
fn every_phase_stops_when_no_iterations_are_left() {
    let wall = Wall {
        rows: 3,
        columns: 4,
        points: 100,
        ..Wall::default()
    };
    let source = MemoryPairs::new(wall.pairs(|_, c| (smooth(c), Vector3::zeros())));
    // Align 4, probe 1, variance components 5; then the adjustment settles.
    for allowed in [0, 1, 4, 5, 10] {
        let params = AdjustmentParams {
            max_iterations: allowed,
            ..AdjustmentParams::default()
        };
        let report = adjust(&source, &params, &Silent).unwrap();
        assert_eq!((report.iterations, report.converged), (allowed, false));
        assert_eq!(report.results.len(), if allowed == 0 { 0 } else { 12 });
    }
}

#[test]
fn a_stone_that_still_moves_has_no_motion() {
    let wall = Wall::default();
    let own = |k: u32| Vector3::new(0.0, 0.0, if k.is_multiple_of(2) { 0.004 } else { -0.004 });
    let source = MemoryPairs::new(wall.pairs(|k, _| (own(k), Vector3::zeros())));
    let after = |max_iterations: usize| {
        let params = AdjustmentParams {
            max_iterations,
            ..AdjustmentParams::default()
        };
        let report = adjust(&source, &params, &Silent).unwrap();
        let unsettled = |r: &&PairResult| matches!(r.motion, Err(MotionFailure::NotConverged));
        report.results.iter().filter(unsettled).count()
    };
    let stones = wall.rows * wall.columns;
    // The first step takes every stone from its neighbours' motion to its own.
    assert!(after(1) > stones as usize / 2, "{} of {stones}", after(1));
    assert_eq!(after(60), 0);
}

/// Stops after this number of checks.
struct Impatient(std::sync::atomic::AtomicUsize);

impl Progress for Impatient {
    fn begin(&self, _what: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn is_cancelled(&self) -> bool {
        self.0.fetch_sub(1, std::sync::atomic::Ordering::Relaxed) == 0
    }
}

/// Pairs whose file cannot be read.
struct Unreadable;

impl PairSource for Unreadable {
    type Error = std::io::Error;

    fn batch_count(&self) -> usize {
        1
    }

    fn load(&self, _batch: usize) -> Result<Vec<PairPoints>, Self::Error> {
        Err(std::io::Error::other("gone"))
    }
}

#[test]
fn a_caller_that_stops_and_a_source_that_fails_are_told_apart() {
    let wall = Wall {
        rows: 3,
        columns: 4,
        points: 100,
        ..Wall::default()
    };
    let source = MemoryPairs::new(wall.pairs(|_, _| (Vector3::zeros(), Vector3::zeros())));
    let stopped = adjust(&source, &AdjustmentParams::default(), &Impatient(3.into()));
    assert!(matches!(stopped, Err(AdjustError::Interrupted(_))));
    let failed = adjust(&Unreadable, &AdjustmentParams::default(), &Silent);
    assert!(matches!(failed, Err(AdjustError::Source(_))));
}
