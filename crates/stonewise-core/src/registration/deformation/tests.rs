use super::*;
use crate::geometry::lever;
use crate::linalg::{BlockMatrix, BlockPattern};
use crate::progress::Silent;
use crate::registration::adjustment::joint_motions::{JointStone, Pull};
use nalgebra::{DMatrix, Matrix3, Point3, SMatrix, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stonewise_testing::normal;

const COLUMNS: usize = 10;
const ROWS: usize = 8;
/// Error of a stone along each axis, metres.
pub(super) const SD_M: f64 = 1e-4;

/// A wall of equal stones in rows and columns; x is out of it.
pub(super) struct Grid {
    pub columns: usize,
    pub rows: usize,
    /// Width and height of a stone, metres.
    pub stone_m: [f64; 2],
}

const GRID: Grid = Grid {
    columns: COLUMNS,
    rows: ROWS,
    stone_m: [0.3, 0.2],
};

impl Grid {
    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    pub fn place(&self, k: usize) -> Point3<f64> {
        Point3::new(
            0.02 * (k % 3) as f64,
            self.stone_m[0] * (k % self.columns) as f64,
            self.stone_m[1] * (k / self.columns) as f64,
        )
    }

    /// Neighbours in rows and columns.
    fn edges(&self) -> Vec<(usize, usize)> {
        let mut edges = Vec::new();
        for k in 0..self.count() {
            if k % self.columns + 1 < self.columns {
                edges.push((k, k + 1));
            }
            if k + self.columns < self.count() {
                edges.push((k, k + self.columns));
            }
        }
        edges.sort_unstable();
        edges
    }
}

fn place(k: usize) -> Point3<f64> {
    GRID.place(k)
}

fn wall(moved: impl Fn(usize) -> Vector3<f64>, error: impl Fn(usize) -> Vector3<f64>) -> JointMotions {
    wall_of(&GRID, |k| moved(k) + error(k))
}

/// A wall for whose stones these motions are measured.
pub(super) fn wall_of(grid: &Grid, measured: impl Fn(usize) -> Vector3<f64>) -> JointMotions {
    let edges = grid.edges();
    let mut information = BlockPattern::<9>::new(grid.count(), &edges).unwrap().zeros();
    information
        .diagonal
        .iter_mut()
        .for_each(|d| *d = SMatrix::identity());
    let of_stone = Matrix3::identity() / (SD_M * SD_M);

    let stone = |k: usize| {
        let displacement = measured(k);
        Some(JointStone {
            id: StoneId(k as u32 + 1),
            place: grid.place(k),
            face_from_world: Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
            body: 1,
            is_loose: false,
            displacement,
            by_field: SMatrix::zeros(),
            own: Matrix3::identity() * (SD_M * SD_M),
            octave: Matrix3::zeros(),
            by_poses: Vec::new(),
            observed: (of_stone, of_stone * displacement),
        })
    };

    let pull = |k: usize| Pull {
        stone: StoneId(k as u32 + 1),
        on_field: SMatrix::zeros(),
        on_stone: Matrix3::identity(),
    };
    JointMotions {
        pulls: (0..grid.count()).map(pull).collect(),
        stones: (0..grid.count()).map(stone).collect(),
        edges,
        information,
        poses: DMatrix::zeros(0, 0),
        octaves: 1.0,
        step_m: 0.25,
    }
}

fn errors(seed: u64) -> Vec<Vector3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || Vector3::from_fn(|_, _| SD_M * normal(&mut rng));
    (0..COLUMNS * ROWS).map(|_| draw()).collect()
}

fn still(_: usize) -> Vector3<f64> {
    Vector3::zeros()
}

/// A bulge of 1.2 m about the middle of the wall.
fn bulge(k: usize) -> Vector3<f64> {
    let r = (place(k) - Point3::new(0.02, 1.35, 0.7)).norm();
    let share = if r < 0.6 {
        (std::f64::consts::PI * r / 1.2).cos().powi(2)
    } else {
        0.0
    };
    Vector3::new(0.8e-3 * share, 0.0, 0.0)
}

fn found(wall: &JointMotions) -> Deformation {
    deformation(wall, None, &Silent).unwrap()
}

#[test]
fn the_covariance_is_that_of_dense_algebra() {
    // A field that joins the stones, errors of three unknowns that all share, and errors of their own.
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut wall = wall(still, |_| Vector3::zeros());
    let count = COLUMNS * ROWS;
    let mut dense = DMatrix::<f64>::zeros(9 * count, 9 * count);
    let mut information: BlockMatrix<9> = BlockPattern::<9>::new(count, &wall.edges).unwrap().zeros();

    for (i, d) in information.diagonal.iter_mut().enumerate() {
        let m = SMatrix::<f64, 9, 9>::from_fn(|_, _| rng.random_range(-1.0..1.0));
        *d = (m * m.transpose() + SMatrix::identity() * 40.0) * 1e7;
        dense.view_mut((9 * i, 9 * i), (9, 9)).copy_from(d);
    }

    for (block, &(low, high)) in information.edges.iter_mut().zip(&wall.edges) {
        *block = SMatrix::from_fn(|_, _| 1e7 * rng.random_range(-1.0..1.0));
        dense.view_mut((9 * high, 9 * low), (9, 9)).copy_from(block);
        dense
            .view_mut((9 * low, 9 * high), (9, 9))
            .copy_from(&block.transpose());
    }

    wall.information = information;
    wall.poses = DMatrix::from_fn(3, 3, |r, c| if r == c { 4e-8 } else { 1e-8 });
    let mut by_field = DMatrix::<f64>::zeros(3 * count, 9 * count);
    let mut by_poses = DMatrix::<f64>::zeros(3 * count, 3);

    for (i, stone) in wall.stones.iter_mut().flatten().enumerate() {
        stone.by_field = SMatrix::from_fn(|_, _| rng.random_range(-1.0..1.0));
        by_field
            .view_mut((3 * i, 9 * i), (3, 9))
            .copy_from(&stone.by_field);
        stone.by_poses = (0..3)
            .map(|k| (k, Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0))))
            .collect();
        for (k, by) in &stone.by_poses {
            by_poses.view_mut((3 * i, *k), (3, 1)).copy_from(by);
        }
    }

    let covariance = &by_field * dense.try_inverse().unwrap() * by_field.transpose()
        + &by_poses * &wall.poses * by_poses.transpose()
        + DMatrix::identity(3 * count, 3 * count) * (SD_M * SD_M);
    // Nothing moved, so that all stones count fully: each with the inverse of its own covariance.
    let mut rigid = DMatrix::<f64>::zeros(3 * count, 6);
    let mut weights = DMatrix::<f64>::zeros(3 * count, 3 * count);

    for i in 0..count {
        rigid
            .view_mut((3 * i, 0), (3, 6))
            .copy_from(&lever(&place(i).coords));
        let own = covariance.view((3 * i, 3 * i), (3, 3)).try_inverse().unwrap();
        weights.view_mut((3 * i, 3 * i), (3, 3)).copy_from(&own);
    }

    let fit = (rigid.transpose() * &weights * &rigid).try_inverse().unwrap() * rigid.transpose() * &weights;
    let rest = DMatrix::identity(3 * count, 3 * count) - &rigid * fit;
    let expected = &rest * &covariance * rest.transpose();

    for (i, stone) in found(&wall).stones.iter().enumerate() {
        let expected: Matrix3<f64> = expected.fixed_view::<3, 3>(3 * i, 3 * i).into_owned();
        assert!(
            (stone.covariance - expected).norm() < 1e-6 * expected.norm(),
            "{i}"
        );
        assert!(stone.deformation.norm() < 1e-12);
    }
}

#[test]
fn a_rigid_motion_of_the_whole_wall_changes_nothing() {
    let noise = errors(5);
    let before = found(&wall(bulge, |k| noise[k]));
    let datum = Vector6::new(0.002, -0.002, 0.002, 1e-3, -1e-3, 1e-3);
    let after = found(&wall(
        |k| bulge(k) + lever(&place(k).coords) * datum,
        |k| noise[k],
    ));
    let [a, b] = [&before, &after].map(|d| d.p.unwrap().ln());
    assert!((a - b).abs() < 1e-6 * a.abs(), "{a} {b}");
    assert_eq!(before.zones.len(), after.zones.len());
    for (a, b) in before.stones.iter().zip(&after.stones) {
        assert!((a.deformation - b.deformation).norm() < 1e-9);
        assert_eq!(a.zone, b.zone);
    }
}

#[test]
fn still_walls_are_rarely_called_deformed_and_intervals_hold_nothing() {
    let (mut called, mut held, mut all) = (0, 0, 0);
    for seed in 0..60 {
        let noise = errors(100 + seed);
        let found = found(&wall(still, |k| noise[k]));
        called += usize::from(found.is_shown());
        assert_eq!(found.is_shown(), !found.zones.is_empty());
        for stone in &found.stones {
            for k in 0..3 {
                held += usize::from(stone.deformation[k].abs() < 1.96 * stone.covariance[(k, k)].sqrt());
                all += 1;
            }
        }
    }
    // 1 % of 60 walls, with three standard deviations.
    assert!(called <= 2, "{called}");
    let share = held as f64 / f64::from(all);
    assert!((share - 0.95).abs() < 0.01, "{share}");
}

#[test]
fn a_bulge_is_found_where_it_is_and_the_rest_stands_still() {
    let noise = errors(7);
    let found = found(&wall(bulge, |k| noise[k]));
    assert!(found.p.unwrap() < 1e-6, "{:?}", found.p);
    let [zone] = &found.zones[..] else {
        panic!("{:?}", found.zones)
    };
    assert_eq!(zone.kind, ZoneKind::Bulge);
    let [low, high] = zone.interval_m;
    assert!(low < 0.8e-3 && high > 0.8e-3 && high - low < 8e-4, "{zone:?}");
    for (k, stone) in found.stones.iter().enumerate() {
        let share = bulge(k).x / 0.8e-3;
        assert!(share < 0.6 || stone.zone == 1, "{k}");
        assert!(share > 0.0 || stone.zone == 0, "{k}");
        assert!((stone.deformation - bulge(k)).norm() < 5.0 * SD_M, "{k}");
    }
    // Such a wall shows a bulge of 1 m well below it.
    assert!(found.detection_limits_m[0].unwrap() < 0.8e-3);
    assert_eq!(found.detection_limits_m[2], None);
}

#[test]
fn what_is_seen_four_times_worse_has_four_times_the_limit() {
    let noise = errors(7);
    let limits = |worse: [f64; 3]| {
        let mut wall = wall(still, |k| noise[k]);
        for stone in wall.stones.iter_mut().flatten() {
            let sds = Vector3::from(worse) * SD_M;
            let information = Matrix3::from_diagonal(&sds.map(|sd| sd.powi(-2)));
            stone.observed = (information, information * stone.displacement);
        }
        let found = found(&wall);
        [found.detection_limits_m[0], found.limits_in_face_m[0]].map(Option::unwrap)
    };
    // The first axis is out of the wall.
    let [out, in_face] = limits([1.0; 3]);
    let of_all = limits([4.0; 3]);
    assert!((of_all[0] / out - 4.0).abs() < 1e-9 && (of_all[1] / in_face - 4.0).abs() < 1e-9);
    for (worse, least) in [
        ([1.0, 4.0, 4.0], 3.8),
        ([1.0, 4.0, 1.0], 3.0),
        ([1.0, 1.0, 4.0], 3.0),
    ] {
        // The limit of the test, which holds for all directions, differs a little. The rotation in the face takes up less
        // of one axis where the other is known better.
        let [a, b] = limits(worse);
        assert!((a / out - 1.0).abs() < 0.05, "{worse:?}: {a} {out}");
        assert!((least..4.2).contains(&(b / in_face)), "{worse:?}: {b} {in_face}");
    }
}

#[test]
fn a_bulge_of_the_stated_limit_is_found_and_one_of_half_of_it_in_half_of_the_cases_at_most() {
    let limit_m = found(&wall(still, |_| Vector3::zeros())).detection_limits_m[0].unwrap();
    // The limit is the median over the wall: one bulge about each of forty stones.
    let found_of_40 = |amplitude_m: f64| {
        let is_found = |seed: &usize| {
            let middle = place(2 * seed);
            let moved = |k: usize| {
                let r = (place(k) - middle).norm().min(0.5);
                Vector3::x() * (amplitude_m * (std::f64::consts::PI * r).cos().powi(2))
            };
            let noise = errors(300 + *seed as u64);
            found(&wall(moved, |k| noise[k])).is_shown()
        };
        (0..40).filter(is_found).count()
    };
    let [whole, half] = [limit_m, 0.5 * limit_m].map(found_of_40);
    assert!(whole >= 34 && half <= 20, "{whole} {half}");
}

#[test]
fn one_stone_that_errs_beside_two_that_err_less_is_no_deformation() {
    // Together they are 4.6 standard deviations off, and 2.7 without the first.
    let moved = |k: usize| match k {
        34 => Vector3::x() * (3.3 * SD_M),
        35 | 45 => Vector3::x() * (2.3 * SD_M),
        _ => Vector3::zeros(),
    };
    let found = found(&wall(moved, |_| Vector3::zeros()));
    assert!(found.p.unwrap() > 0.05, "{:?}", found.p);
}

#[test]
fn what_the_field_smoothed_along_the_face_is_in_the_intervals() {
    // The wall bulged and sank by as much; the motions show the first alone.
    let noise = errors(13);
    let sank = |k: usize| Vector3::new(0.0, 0.0, -bulge(k).x);
    let mut wall = wall(bulge, |k| noise[k]);
    for (k, stone) in wall.stones.iter_mut().enumerate() {
        let stone = stone.as_mut().unwrap();
        stone.observed.1 += stone.observed.0 * sank(k);
    }
    for (k, stone) in found(&wall).stones.iter().enumerate() {
        let apart = stone.deformation - bulge(k) - sank(k);
        for axis in 0..3 {
            let sd = stone.covariance[(axis, axis)].sqrt();
            assert!(apart[axis].abs() < 4.0 * sd, "{k}, {axis}: {apart:?}, {sd}");
        }
    }
}

#[test]
fn the_larger_part_is_the_one_that_kept_its_shape() {
    // A third of the wall moved as one body, farther than any error.
    let noise = errors(8);
    let moved = |k: usize| match k % COLUMNS < 3 {
        true => Vector3::new(0.0, 0.0, -0.004),
        false => Vector3::zeros(),
    };
    let found = found(&wall(moved, |k| noise[k]));
    for (k, stone) in found.stones.iter().enumerate() {
        assert!(
            (stone.deformation - moved(k)).norm() < 5.0 * SD_M,
            "{k} {stone:?}"
        );
        assert_eq!(stone.zone, u32::from(k % COLUMNS < 3));
    }
    assert_eq!(found.zones[0].kind, ZoneKind::Settlement);
}

/// The zones of a wall whose stones rose by `risen_m`.
fn kinds_of_risen(risen_m: impl Fn(usize) -> f64) -> Vec<ZoneKind> {
    let noise = errors(8);
    let found = found(&wall(|k| Vector3::new(0.0, 0.0, risen_m(k)), |k| noise[k]));
    found.zones.iter().map(|zone| zone.kind).collect()
}

#[test]
fn what_rose_and_what_sank_beside_it_are_two_zones() {
    let kinds = kinds_of_risen(|k| match k % COLUMNS {
        3 | 4 => 0.004,
        5 | 6 => -0.003,
        _ => 0.0,
    });
    assert_eq!(kinds, [ZoneKind::Other, ZoneKind::Settlement]);
}

#[test]
fn a_zone_that_sank_unevenly_settled() {
    let kinds = kinds_of_risen(|k| match k % COLUMNS {
        3 if k < 2 * COLUMNS => -0.02,
        3 | 4 => -0.001,
        _ => 0.0,
    });
    assert_eq!(kinds, [ZoneKind::Settlement]);
}

#[test]
fn what_lies_beyond_a_crack_has_moved_against_the_larger_part() {
    let errors = errors(5);
    let is_beyond = |k: usize| k % COLUMNS >= 6;
    let settled = Vector3::new(0.0, 0.0, -0.0025);
    let moved = |k: usize| if is_beyond(k) { settled } else { Vector3::zeros() };
    let mut wall = wall(moved, |k| errors[k]);
    for (k, stone) in wall.stones.iter_mut().enumerate() {
        if let Some(stone) = stone {
            stone.body = if is_beyond(k) { 2 } else { 1 };
        }
    }
    let found = found(&wall);
    assert!(found.p < Some(0.001), "{:?}", found.p);
    for stone in &found.stones {
        let k = stone.stone.0 as usize - 1;
        let apart = stone.deformation - moved(k);
        assert!(apart.norm() < 6.0 * SD_M, "{k}: {apart:?}");
        assert_eq!(stone.zone > 0, is_beyond(k), "{k}");
    }
}

#[test]
fn a_wall_of_few_stones_is_not_judged() {
    let mut small = wall(bulge, |_| Vector3::zeros());
    small
        .stones
        .iter_mut()
        .skip(LEAST_STONES - 1)
        .for_each(|s| *s = None);
    assert_eq!(found(&small), Deformation::default());
}

#[test]
fn the_larger_end_of_a_settlement_without_a_crack_is_the_part_that_kept_its_shape() {
    // Four columns stood still and three settled; those between took part.
    let noise = errors(9);
    let moved = |k: usize| {
        let share = ((place(k).y - 1.1) / 0.8).clamp(0.0, 1.0);
        Vector3::new(0.0, 0.0, -0.0025 * share)
    };
    let found = found(&wall(moved, |k| noise[k]));
    for (k, stone) in found.stones.iter().enumerate() {
        let apart = stone.deformation - moved(k);
        assert!(apart.norm() < 6.0 * SD_M, "{k}: {apart:?}");
        let share = moved(k).z / -0.0025;
        assert!(share < 0.6 || stone.zone == 1, "{k}");
        assert!(share > 0.4 || stone.zone == 0, "{k}");
    }
    assert_eq!(found.zones[0].kind, ZoneKind::Settlement);
}

#[test]
fn of_two_equal_parts_the_one_that_moved_less_stood_still() {
    let noise = errors(10);
    for (low, high) in [(0.0, -0.0025), (-0.0025, 0.0)] {
        let moved = |k: usize| {
            let share = ((place(k).y - 1.05) / 0.6).clamp(0.0, 1.0);
            Vector3::new(0.0, 0.0, low + (high - low) * share)
        };
        for (k, stone) in found(&wall(moved, |k| noise[k])).stones.iter().enumerate() {
            let apart = stone.deformation - moved(k);
            assert!(apart.norm() < 6.0 * SD_M, "{k}: {apart:?}");
        }
    }
}

#[test]
fn a_small_part_beyond_a_crack_is_measured_against_the_wall() {
    let noise = errors(12);
    let is_beyond = |k: usize| k % COLUMNS == COLUMNS - 1;
    let settled = Vector3::new(0.0, 0.0, -0.0025);
    let mut wall = wall(
        |k| if is_beyond(k) { settled } else { Vector3::zeros() },
        |k| noise[k],
    );
    for (k, stone) in wall.stones.iter_mut().enumerate() {
        stone.as_mut().unwrap().body = if is_beyond(k) { 2 } else { 1 };
    }
    let found = found(&wall);
    assert_eq!(found.stones.len(), COLUMNS * ROWS);
    assert!(found.zones.is_empty(), "{:?}", found.zones);
    for stone in found.stones.iter().filter(|s| is_beyond(s.stone.0 as usize - 1)) {
        assert!((stone.deformation - settled).norm() < 6.0 * SD_M, "{stone:?}");
    }
}

#[test]
fn no_single_stone_is_a_deformation_and_three_neighbours_are() {
    let errors = errors(91);
    let out = |by_m: f64| Vector3::new(by_m, 0.0, 0.0);
    let moved = |stones: &[usize], by_m: f64| {
        let of_stone = |k: usize| if stones.contains(&k) { out(by_m) } else { out(0.0) };
        found(&wall(of_stone, |k| errors[k]))
    };
    for stone in [0, 35, 44, 79] {
        let one = moved(&[stone], 40.0 * SD_M);
        assert!(
            one.p.unwrap() > 0.05 && one.zones.is_empty(),
            "{stone}: {:?}",
            one.p
        );
    }
    assert!(moved(&[34, 35, 45], 10.0 * SD_M).p.unwrap() < 0.01);
}

#[test]
fn what_the_field_smooths_of_a_bulge_widens_its_intervals() {
    let noise = errors(12);
    let mut smoothed = wall(bulge, |k| noise[k]);
    for (k, stone) in smoothed.stones.iter_mut().flatten().enumerate() {
        stone.displacement = 0.2 * bulge(k);
    }
    let found = found(&smoothed);
    assert!(found.p.unwrap() < 0.01);
    let mut missed: Vec<f64> = Vec::new();
    for (k, stone) in found.stones.iter().enumerate() {
        let sd = stone.covariance[(0, 0)].sqrt();
        if bulge(k).x > 0.4e-3 {
            missed.push((bulge(k).x - stone.deformation.x).abs() / sd);
        }
        assert!(bulge(k).x > 0.0 || sd < 3.0 * SD_M, "{k}: {sd}");
    }
    // By the covariance of the motions alone the largest are five to six standard deviations.
    assert!(missed.iter().all(|m| *m < 3.0), "{missed:?}");
}

#[test]
fn what_the_field_smooths_of_a_bulge_that_is_not_shown_widens_its_intervals_too() {
    let noise = errors(12);
    // Four tenths of the bulge are not shown; a field that follows the stones leaves nothing out.
    let faint = |k: usize| 0.4 * bulge(k);
    let sd_of = |follows: bool| {
        let mut wall = wall(faint, |k| noise[k]);
        for (k, stone) in wall.stones.iter_mut().flatten().enumerate() {
            stone.displacement = if follows {
                faint(k) + noise[k]
            } else {
                Vector3::zeros()
            };
        }
        let found = found(&wall);
        assert!(found.zones.is_empty() && found.p.unwrap() > 0.01, "{:?}", found.p);
        let sd: Vec<f64> = found.stones.iter().map(|s| s.covariance[(0, 0)].sqrt()).collect();
        sd
    };
    let [smoothed, followed] = [false, true].map(sd_of);
    for (k, (smoothed, followed)) in smoothed.iter().zip(&followed).enumerate() {
        let is_widened = *smoothed > 1.1 * followed;
        assert!(is_widened || bulge(k).x < 0.6e-3, "{k}: {smoothed} {followed}");
        assert!(
            *followed < 1.05 * SD_M && (bulge(k).x > 0.0 || *smoothed < 1.3 * SD_M),
            "{k}"
        );
    }
}
