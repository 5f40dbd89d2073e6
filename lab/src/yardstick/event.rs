//! What happens to a survey besides the motion of its stones: each event is what some mechanism of the method is for.

use super::points::{SurveyPoint, mean};
use super::wall::{Truth, Wall};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;
use stonewise_core::geometry::Rigid3;
use stonewise_simulate::normal;

/// An event; y along the wall, z up, lengths in metres. Unless it says otherwise, it happens to the second epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Masks of 15 % of the stones are merged, halved or swapped.
    Masks,
    /// One mask in ten takes in the nearest corner of its neighbour.
    Corners,
    /// Four stones have the partner of another stone nearby.
    Partners,
    /// Leaves cover this share of the points left of y = -0.4.
    Ivy(f64),
    /// Snow hides the foot up to 20 cm, unevenly.
    Snow,
    /// A car hides an oblique strip, and a part of many stones.
    Car,
    /// Patches of mortar of 8 mm cover parts of stones.
    Repairs,
    /// Only the wall left of y = 0.3 was measured.
    Half,
    /// Of one stone in ten, photos show the upper third alone.
    Thirds,
    /// Neither epoch shows what lies around a few stones at the right end.
    Apart,
    /// Plastered panels of a hut before the wall pass for stones in both epochs, and move by this.
    Hut(f64),
    /// A door leaf passes for a stone, and is open by this angle in radians.
    Door(f64),
    /// The part of the wall within 45 cm of the middle stands out by `.0` in both epochs, and moves out by `.1`.
    Buttress(f64, f64),
    /// All points of a row of a scan are off by the same 0.8 mm (sd), in both epochs.
    ScanLines,
    /// Another sensor, noisy and sparse, measured what lies right of y = 0.6.
    OtherSensor,
    /// Noise of this sd out of the wall, in both epochs.
    Noise(f64),
    /// Coordinates of both epochs are rounded to this.
    Rounded(f64),
    /// Files tell neither sources nor times.
    Merged,
}

/// Numbers of what passes for stones.
const THINGS: u32 = 10_000;

impl Event {
    pub fn happen(self, wall: &mut Wall, rng: &mut ChaCha8Rng) {
        match self {
            Self::Masks => spoil(wall),
            Self::Corners => corners(wall),
            Self::Partners => partners(wall),
            Self::Ivy(share) => each(wall, &[1], |_, p| {
                let covered = p.place.y < -0.4 && rng.random_range(0.0..1.0) < share;
                p.place.x += if covered {
                    0.01 + 0.03 * normal(rng).abs()
                } else {
                    0.0
                };
            }),
            Self::Snow => keep(wall, &[1], |p| p.z > 0.2 + 0.06 * (3.0 * p.y).sin()),
            Self::Car => keep(wall, &[1], |p| (p.y + 0.3 - 0.2 * p.z).abs() > 0.22 || p.z > 1.3),
            Self::Repairs => {
                let patches: Vec<[f64; 2]> = (0..4)
                    .map(|_| [rng.random_range(-1.2..1.0), rng.random_range(0.3..1.5)])
                    .collect();
                each(wall, &[1], |_, p| {
                    let within = |at: &[f64; 2]| {
                        (0.0..0.3).contains(&(p.place.y - at[0]))
                            && (0.0..0.25).contains(&(p.place.z - at[1]))
                    };
                    p.place.x += if patches.iter().any(within) { 0.008 } else { 0.0 };
                });
            }
            Self::Half => keep(wall, &[1], |p| p.y < 0.3),
            Self::Thirds => thirds(wall),
            Self::Apart => keep(wall, &[0, 1], |p| {
                p.y < 0.2 || (p.y > 0.8 && (0.8..1.3).contains(&p.z))
            }),
            Self::Hut(moved_m) => {
                for k in 0..6 {
                    let corner = Point3::new(
                        0.7,
                        -0.9 + 0.42 * f64::from(k % 3),
                        0.05 + 0.42 * f64::from(k / 3),
                    );
                    let moved = Translation3::new(moved_m, 0.5 * moved_m, 0.0).into();
                    panel(wall, THINGS + k, corner, [0.4, 0.4], moved, rng);
                }
            }
            Self::Door(angle) => {
                let hinge = Point3::new(-0.05, 0.2, 0.1);
                let turn = UnitQuaternion::new(Vector3::z() * angle);
                let open = Rigid3::rotation_wrt_point(turn, hinge);
                keep(wall, &[0, 1], |p| {
                    !((0.2..0.8).contains(&p.y) && (0.1..1.3).contains(&p.z))
                });
                panel(wall, THINGS, hinge, [0.6, 1.2], open, rng);
            }
            Self::Buttress(out_m, moved_m) => buttress(wall, out_m, moved_m),
            Self::ScanLines => {
                let errors: Vec<[f64; 2]> = (0..2000).map(|_| [0.0; 2].map(|_| 8e-4 * normal(rng))).collect();
                each(wall, &[0, 1], |epoch, p| {
                    let row = ((p.place.z + 1.0).max(0.0) / 0.007) as usize % errors.len();
                    p.place.x += errors[row][epoch];
                });
            }
            Self::OtherSensor => {
                for points in wall.epochs[1].values_mut() {
                    points.retain(|p| p.place.y < 0.6 || rng.random_range(0.0..1.0) < 0.3);
                }
                each(wall, &[1], |_, p| {
                    if p.place.y >= 0.6 {
                        p.place.x += 0.008 * normal(rng);
                        p.source = 9;
                    }
                });
            }
            Self::Noise(sd_m) => each(wall, &[0, 1], |_, p| p.place.x += sd_m * normal(rng)),
            Self::Rounded(step_m) => each(wall, &[0, 1], |_, p| {
                p.place = (p.place / step_m).map(f64::round) * step_m;
            }),
            Self::Merged => {
                wall.has_times = [false; 2];
                each(wall, &[0, 1], |_, p| p.source = 0);
            }
        }
    }
}

/// Changes the points of these epochs.
fn each(wall: &mut Wall, epochs: &[usize], mut to: impl FnMut(usize, &mut SurveyPoint)) {
    for &epoch in epochs {
        wall.epochs[epoch]
            .values_mut()
            .flatten()
            .for_each(|p| to(epoch, p));
    }
}

/// Keeps some points of these epochs; stones that lose most of theirs do not count.
fn keep(wall: &mut Wall, epochs: &[usize], is_kept: impl Fn(&Point3<f64>) -> bool) {
    for epoch in epochs {
        for (id, points) in &mut wall.epochs[*epoch] {
            let before = points.len();
            points.retain(|p| is_kept(&p.place));
            if let Some(truth) = wall.truth.get_mut(id).filter(|_| 2 * points.len() < before) {
                truth.is_countable = false;
            }
        }
    }
}

fn mark_odd(wall: &mut Wall, ids: &[u32]) {
    for id in ids {
        if let Some(truth) = wall.truth.get_mut(id) {
            (truth.is_countable, truth.is_odd) = (false, true);
        }
    }
}

/// Some stones of the second epoch, one in `every`, each with the next.
fn some(wall: &Wall, every: usize) -> Vec<[u32; 2]> {
    let ids: Vec<u32> = wall.epochs[1].keys().copied().filter(|id| *id > 0).collect();
    let next = |(k, id): (usize, &u32)| (k % every == 3).then(|| [*id, ids[(k + 1) % ids.len()]]);
    ids.iter().enumerate().filter_map(next).collect()
}

fn spoil(wall: &mut Wall) {
    for (k, [id, next]) in some(wall, 7).into_iter().enumerate() {
        let second = &mut wall.epochs[1];
        match k % 3 {
            0 => {
                let extra = second.remove(&next).unwrap_or_default();
                second.entry(id).or_default().extend(extra);
            }
            1 => {
                let middle = mean(&second[&id]).y;
                second.entry(id).or_default().retain(|p| p.place.y > middle);
            }
            _ => swap(wall, id, next),
        }
        let touched = [id, next];
        mark_odd(wall, if k % 3 == 1 { &touched[..1] } else { &touched });
    }
}

fn thirds(wall: &mut Wall) {
    for [id, _] in some(wall, 10) {
        let Some(points) = wall.epochs[1].get_mut(&id) else {
            continue;
        };
        points.sort_by(|a, b| b.place.z.total_cmp(&a.place.z));
        points.truncate(points.len() / 3);
        mark_odd(wall, &[id]);
    }
}

fn swap(wall: &mut Wall, one: u32, other: u32) {
    let second = &mut wall.epochs[1];
    if let [Some(a), Some(b)] = [one, other].map(|id| second.remove(&id)) {
        second.insert(one, b);
        second.insert(other, a);
    }
}

fn partners(wall: &mut Wall) {
    for [one, other] in some(wall, 20).into_iter().take(4) {
        swap(wall, one, other);
        mark_odd(wall, &[one, other]);
    }
}

/// The part of the next stone that lies nearest, a quarter of its points, joins a mask.
fn corners(wall: &mut Wall) {
    for [id, next] in some(wall, 10) {
        let second = &mut wall.epochs[1];
        let middle = mean(&second[&id]);
        let Some(mut other) = second.remove(&next) else {
            continue;
        };
        other.sort_by(|a, b| {
            let apart = |p: &SurveyPoint| (p.place - middle).norm();
            apart(a).total_cmp(&apart(b))
        });
        let rest = other.split_off(other.len() / 4);
        second.entry(id).or_default().extend(other);
        second.insert(next, rest);
    }
}

/// Adds a flat panel that passes for a stone to both epochs. `corner`: its lower left one.
fn panel(
    wall: &mut Wall,
    id: u32,
    corner: Point3<f64>,
    size_m: [f64; 2],
    moved: Rigid3,
    rng: &mut ChaCha8Rng,
) {
    let model: Vec<SurveyPoint> = wall
        .epochs
        .iter()
        .map(|e| e.values().flatten().next().copied().unwrap())
        .collect();
    let count = (size_m[0] * size_m[1] / 0.007f64.powi(2)) as usize;
    for (epoch, model) in model.iter().enumerate() {
        let point = |_| {
            let [y, z] = size_m.map(|s| rng.random_range(0.0..s));
            let out = 4e-4 * (9.0 * PI * y).sin() + 1.5e-3 * normal(rng);
            let place = corner + Vector3::new(out, y, z);
            SurveyPoint {
                place: if epoch == 0 { place } else { moved * place },
                ..*model
            }
        };
        let points = (0..count).map(point).collect();
        wall.epochs[epoch].insert(id, points);
    }
    let of_panel = Truth {
        normal: Vector3::x(),
        motion: moved,
        shared: moved * corner - corner,
        is_loose: moved != Rigid3::identity(),
        is_countable: false,
        is_odd: false,
    };
    wall.truth.insert(id, of_panel);
}

/// A block of the wall stands out and moves; the wall has no other motions.
fn buttress(wall: &mut Wall, out_m: f64, moved_m: f64) {
    let inside: Vec<u32> = wall.epochs[0]
        .iter()
        .filter(|(id, points)| **id > 0 && mean(points).y.abs() < 0.45)
        .map(|(id, _)| *id)
        .collect();
    for (epoch, stones) in wall.epochs.iter_mut().enumerate() {
        for (id, points) in stones {
            for p in points {
                let is_inside = match id {
                    0 => p.place.y.abs() < 0.45 && p.place.x < 0.1,
                    id => inside.contains(id),
                };
                p.place.x += if is_inside {
                    out_m + epoch as f64 * moved_m
                } else {
                    0.0
                };
            }
        }
    }
    for id in inside {
        if let Some(truth) = wall.truth.get_mut(&id) {
            let shift = Translation3::new(moved_m, 0.0, 0.0);
            truth.motion = Rigid3::from(shift) * truth.motion;
            truth.shared += shift.vector;
        }
    }
    if moved_m != 0.0 {
        (wall.is_still, wall.is_still_elsewhere) = (false, false);
    }
}
