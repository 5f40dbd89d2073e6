//! Joints between neighbouring stones, and how they open, slide and step.

use super::statistics::Sorted;
use super::{ResultSet, RowMotion, StoneRow};
use nalgebra::{Matrix3, Point2, Point3, Vector2, Vector3};
use std::collections::BTreeMap;
use stonewise_core::id::StoneId;

/// Distance between samples of an outline, metres.
const STEP_M: f64 = 0.02;
/// Widest joint, as a share of the square root of a stone's median area, and its bounds, metres.
const REACH_SHARE: f64 = 0.3;
const REACH_M: [f64; 2] = [0.04, 0.12];
/// A joint is at least this long, metres.
const MIN_LENGTH_M: f64 = 0.05;
/// A pair of points this many times farther apart than the median of its joint lies askew.
const ASKEW: f64 = 1.5;
/// 97.5 % quantile of the normal distribution: 95 % lie within this many standard deviations.
const QUANTILE: f64 = 1.959_963_984_540_054;

/// The joint between two stones.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Indices of the two stones in [`ResultSet::stones`]; the first is the lower.
    pub stones: [usize; 2],
    /// Its middle line in the unrolled facade, metres.
    pub line: [Point2<f64>; 2],
    /// Its middle line in the world frame, metres.
    pub world: [Point3<f64>; 2],
    /// Unit vector across the joint in (along, up), from the first stone to the second.
    pub across: Vector2<f64>,
    /// Mean width between the outlines in the first epoch, metres.
    pub width_m: f64,
    /// What happened to it, where both stones were measured.
    pub motion: Option<JointMotion>,
}

/// Motion of the second stone against the first, in the directions of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    /// Across the joint, metres; positive: it opens.
    pub opening_m: f64,
    /// Along the joint, metres; positive: the second stone moves to the left of a walker from the first to
    /// the second.
    pub sliding_m: f64,
    /// Out of the face, metres; positive: the second stone stands out.
    pub step_m: f64,
    /// Standard deviation of the opening, metres, from [`ResultSet::neighbours`]. If the two stones have no
    /// covariance there, it is an upper bound: both stones' covariances without the registration error of the
    /// epochs, added as if they were independent.
    pub opening_sigma_m: f64,
}

impl JointMotion {
    /// Whether the opening differs from zero at 95 %.
    pub fn is_significant(&self) -> bool {
        self.opening_m.abs() > QUANTILE * self.opening_sigma_m
    }
}

/// All joints, ascending by their stones.
///
/// Stones share a joint where one outline is the nearest to the other within the joint's width over at least
/// 5 cm. The direction of a joint is the principal axis of the points midway between the outlines. Cost:
/// O(length of all outlines).
pub fn joints(results: &ResultSet) -> Vec<Joint> {
    let samples = Samples::of(results);
    let mut contacts: BTreeMap<[usize; 2], Vec<Contact>> = BTreeMap::new();
    for (i, sample) in samples.all.iter().enumerate() {
        if let Some(other) = samples.nearest_of_another(i) {
            let other = &samples.all[other];
            let (a, b) = if sample.stone < other.stone {
                (sample, other)
            } else {
                (other, sample)
            };
            contacts.entry([a.stone, b.stone]).or_default().push(Contact {
                middle: nalgebra::center(&a.flat, &b.flat),
                world: nalgebra::center(&a.world, &b.world),
                gap: b.flat - a.flat,
            });
        }
    }
    contacts
        .into_iter()
        .filter_map(|(stones, contacts)| joint(results, stones, &contacts))
        .collect()
}

/// A point of one outline and the nearest of another.
struct Contact {
    middle: Point2<f64>,
    world: Point3<f64>,
    /// From the first stone to the second.
    gap: Vector2<f64>,
}

fn joint(results: &ResultSet, stones: [usize; 2], contacts: &[Contact]) -> Option<Joint> {
    let median = Sorted::new(contacts.iter().map(|c| c.gap.norm())).median()?;
    // Round the corner, the nearest point of the neighbour is far and lies askew.
    let contacts: Vec<&Contact> = contacts
        .iter()
        .filter(|c| c.gap.norm() <= ASKEW * median)
        .collect();
    let n = contacts.len() as f64;
    let mean: Vector2<f64> = contacts.iter().map(|c| c.middle.coords).sum::<Vector2<f64>>() / n;
    let spread = contacts
        .iter()
        .map(|c| c.middle.coords - mean)
        .map(|d| d * d.transpose())
        .sum::<nalgebra::Matrix2<f64>>();
    let eigen = spread.symmetric_eigen();

    let tangent: Vector2<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
    let gap: Vector2<f64> = contacts.iter().map(|c| c.gap).sum::<Vector2<f64>>() / n;
    let across = Vector2::new(-tangent.y, tangent.x);
    let across = if across.dot(&gap) < 0.0 { -across } else { across };
    let place = |c: &&Contact| (c.middle.coords - mean).dot(&tangent);
    let first = contacts.iter().min_by(|a, b| place(a).total_cmp(&place(b)))?;
    let last = contacts.iter().max_by(|a, b| place(a).total_cmp(&place(b)))?;
    if place(last) - place(first) < MIN_LENGTH_M {
        return None;
    }
    let on_line = |c: &&Contact| Point2::from(mean + tangent * place(c));

    Some(Joint {
        stones,
        line: [on_line(first), on_line(last)],
        world: [first.world, last.world],
        across,
        width_m: gap.dot(&across),
        motion: motion(results, stones, &across),
    })
}

fn motion(results: &ResultSet, stones: [usize; 2], across: &Vector2<f64>) -> Option<JointMotion> {
    let [a, b] = stones.map(|i| &results.stones[i]);
    let (first, second) = (a.motion.as_ref()?, b.motion.as_ref()?);
    let difference = second.face - first.face;
    let direction = Vector3::new(across.x, across.y, 0.0);
    let variance = match between_neighbours(results, [a, b], &direction) {
        Some(variance) => variance,
        None => {
            variance_apart(results, a, first, &direction) + variance_apart(results, b, second, &direction)
        }
    };
    Some(JointMotion {
        opening_m: difference.xy().dot(across),
        sliding_m: difference.xy().dot(&Vector2::new(-across.y, across.x)),
        step_m: difference.z,
        opening_sigma_m: variance.sqrt(),
    })
}

/// Variance of the motion of two stones against each other in a direction (along, up, out) of the first;
/// `None` where their joint covariance is not known.
fn between_neighbours(results: &ResultSet, [a, b]: [&StoneRow; 2], direction: &Vector3<f64>) -> Option<f64> {
    let ids = [a.stone_id.min(b.stone_id), a.stone_id.max(b.stone_id)].map(StoneId);
    let world = results.world_from_face(a) * direction;
    let found = results
        .neighbours
        .binary_search_by_key(&ids, |pair| pair.stones)
        .ok()?;
    let covariance = &results.neighbours[found].covariance;
    Some(world.dot(&(covariance * world)).max(0.0))
}

/// Variance of a stone's motion in a direction (along, up, out), without the registration error of the
/// epochs, which neighbours share and which drops out between them; at least that of its motion against its
/// neighbours.
fn variance_apart(
    results: &ResultSet,
    stone: &StoneRow,
    motion: &RowMotion,
    direction: &Vector3<f64>,
) -> f64 {
    let world = results.world_from_face(stone) * direction;
    let along = |covariance: &Matrix3<f64>| world.dot(&(covariance * world));
    let datum = results.datum().and_then(|d| d.covariance_at(&stone.centroid));
    let registration = datum.map_or(0.0, |covariance| along(&covariance));
    let against_neighbours = along(&motion.relative_covariance);
    (along(&motion.covariance) - registration)
        .max(against_neighbours)
        .max(0.0)
}

/// A point of an outline.
struct Sample {
    stone: usize,
    flat: Point2<f64>,
    world: Point3<f64>,
}

/// Points of all outlines, by squares of the reach.
struct Samples {
    all: Vec<Sample>,
    reach_m: f64,
    squares: BTreeMap<(i64, i64), Vec<u32>>,
}

impl Samples {
    fn of(results: &ResultSet) -> Self {
        let areas = Sorted::new(results.stones.iter().map(|s| s.area_m2.max(0.0)));
        let reach_m = (REACH_SHARE * areas.median().unwrap_or(0.0).sqrt()).clamp(REACH_M[0], REACH_M[1]);
        let mut samples = Self {
            all: Vec::new(),
            reach_m,
            squares: BTreeMap::new(),
        };
        for (i, stone) in results.stones.iter().enumerate() {
            let Some(outline) = results.outlines.get(&stone.stone_id) else {
                continue;
            };
            let flat = results.unrolled(stone);
            let is_finite = |p: &Point2<f64>| p.x.is_finite() && p.y.is_finite();
            if flat.iter().all(is_finite) {
                samples.add(i, &flat, &outline.ring);
            }
        }
        samples
    }

    fn add(&mut self, stone: usize, flat: &[Point2<f64>], world: &[Point3<f64>]) {
        for k in 0..flat.len() {
            let next = (k + 1) % flat.len();
            let steps = ((flat[next] - flat[k]).norm() / STEP_M).ceil().max(1.0);
            for step in 0..steps as usize {
                let t = step as f64 / steps;
                let sample = Sample {
                    stone,
                    flat: flat[k] + (flat[next] - flat[k]) * t,
                    world: world[k] + (world[next] - world[k]) * t,
                };
                let square = self.square(&sample.flat);
                self.squares
                    .entry(square)
                    .or_default()
                    .push(self.all.len() as u32);
                self.all.push(sample);
            }
        }
    }

    fn square(&self, p: &Point2<f64>) -> (i64, i64) {
        (
            (p.x / self.reach_m).floor() as i64,
            (p.y / self.reach_m).floor() as i64,
        )
    }

    /// The nearest sample of another stone within reach.
    fn nearest_of_another(&self, sample: usize) -> Option<usize> {
        let Sample { stone, flat, .. } = &self.all[sample];
        let (x, y) = self.square(flat);
        let around = (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| (x, y)));
        around
            .filter_map(|square| self.squares.get(&square))
            .flatten()
            .map(|&j| j as usize)
            .filter(|&j| self.all[j].stone != *stone)
            .map(|j| ((self.all[j].flat - flat).norm(), j))
            .filter(|(d, _)| *d <= self.reach_m)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .map(|(_, j)| j)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::{Datum, DatumState};
    use crate::testing::{folder, registration_record, rows};
    use nalgebra::Matrix6;
    use stonewise_core::stone::NeighbourCovariance;

    #[test]
    fn a_bonded_wall_has_its_bed_and_head_joints() {
        let folder = folder(&rows());
        let results = ResultSet::read(folder.path()).unwrap();
        let all = joints(&results);
        // 6 x 4 stones in stack bond: 5 x 4 head joints and 6 x 3 bed joints, 2 cm wide.
        assert_eq!(all.len(), 38);
        for joint in &all {
            let head = joint.stones[1] == joint.stones[0] + 1;
            let expected = if head { Vector2::x() } else { Vector2::y() };
            assert!((joint.across - expected).norm() < 1e-6, "{joint:?}");
            assert!((joint.width_m - 0.02).abs() < 1e-3, "{joint:?}");
            let length = (joint.line[1] - joint.line[0]).norm();
            // The ends are sampled every 2 cm, and a corner belongs to the nearer of its joints.
            let expected = if head { 0.23 } else { 0.38 };
            assert!((expected - 0.045..expected + 0.005).contains(&length), "{length}");
            assert!((joint.world[1] - joint.world[0]).norm() > 0.9 * length);
        }
        // Stone 8 (index 7) moved 20 mm along, stone 7 (index 6) did not: the joint between opens by the
        // difference.
        let opened = all.iter().find(|j| j.stones == [6, 7]).unwrap().motion.unwrap();
        assert!((opened.opening_m - 0.020_2).abs() < 1e-9, "{opened:?}");
        assert!((opened.step_m - 0.0027).abs() < 1e-9 && opened.is_significant());
        // Against its neighbours each is half as certain as by itself, in variance.
        assert!((opened.opening_sigma_m - 0.0005 * (2.0 + 2f64).sqrt()).abs() < 1e-9);
        // Stone 9 (index 8) closes in on the other side by as much.
        let closed = all.iter().find(|j| j.stones == [7, 8]).unwrap().motion.unwrap();
        assert!((closed.opening_m + 0.020_2).abs() < 1e-9, "{closed:?}");
        // Stone 3 (index 2) was not measured.
        assert!(
            all.iter()
                .filter(|j| j.stones.contains(&2))
                .all(|j| j.motion.is_none())
        );
    }

    #[test]
    fn the_joint_covariance_of_neighbours_is_that_of_the_opening() {
        let folder = folder(&rows());
        let mut results = ResultSet::read(folder.path()).unwrap();
        let ids = [6, 7].map(|i: usize| results.stones[i].stone_id);
        // The wall looks along x; the joint opens along y.
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-4, 9e-8, 1e-4));
        results.neighbours.push(NeighbourCovariance {
            stones: ids.map(StoneId),
            covariance,
        });
        let all = joints(&results);
        let sigma = |stones: [usize; 2]| {
            let joint = all.iter().find(|j| j.stones == stones).unwrap();
            joint.motion.unwrap().opening_sigma_m
        };
        assert!((sigma([6, 7]) - 3e-4).abs() < 1e-7, "{}", sigma([6, 7]));
        assert!((sigma([7, 8]) - 0.0005 * (2.0 + 2f64).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn the_error_of_the_registration_drops_out_of_an_opening() {
        let folder = folder(&rows());
        let mut results = ResultSet::read(folder.path()).unwrap();
        let sigma = |results: &ResultSet| {
            let all = joints(results);
            all.iter()
                .find(|j| j.stones == [6, 7])
                .unwrap()
                .motion
                .unwrap()
                .opening_sigma_m
        };
        let alone = sigma(&results);
        // The same stones, measured in a survey that lies somewhere within 4 mm.
        let shared = Matrix6::from_diagonal(&[1.6e-5, 1.6e-5, 1.6e-5, 0.0, 0.0, 0.0].into());
        let mut record = registration_record();
        record.datum = Datum::known(DatumState::Sources, &Point3::origin(), &shared, String::new());
        results.registration = Some(record);
        for motion in results.stones.iter_mut().filter_map(|s| s.motion.as_mut()) {
            motion.covariance += Matrix3::identity() * 1.6e-5;
        }
        assert!(
            (sigma(&results) / alone - 1.0).abs() < 1e-9,
            "{} {alone}",
            sigma(&results)
        );
    }
}
