//! How the wall moved between the epochs: fields that every stone follows as a rigid body, and stones that
//! are loose.

use crate::world::noise::normal;
use crate::world::wall::{SimStone, Wall};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use stonewise_core::geometry::Rigid3;
use stonewise_core::registration::{AdjustmentParams, draw_motions};

/// One cause of motion; a survey has any number of them, and they add up. No entry: nothing moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum WallMotion {
    /// All stones move alike.
    Translation {
        /// Displacement, world frame, metres.
        d_m: [f64; 3],
    },
    /// The face swells: `depth cos^2(pi r / diameter)` along the outward normal.
    Bulge {
        /// Centre on the face, along and up, metres.
        centre_m: [f64; 2],
        /// Displacement of the centre, metres; negative swells inwards.
        depth_m: f64,
        /// Where the bulge ends, metres.
        diameter_m: f64,
    },
    /// A part of the wall creeps in one direction: `d_m cos^2(pi r / diameter)`.
    Zone {
        /// Centre on the face, along and up, metres.
        centre_m: [f64; 2],
        /// Displacement of the centre: along, up, out, metres.
        d_m: [f64; 3],
        /// Where the zone ends, metres.
        diameter_m: f64,
    },
    /// The foundation gives way on one side: down, linearly from nothing at `from_m` to `depth_m` at `to_m`.
    Settlement {
        /// Where it starts, metres along the face.
        from_m: f64,
        /// Where it is complete, metres along the face.
        to_m: f64,
        /// Largest settlement, metres, positive downwards.
        depth_m: f64,
    },
    /// The crown moves out against the foot, as a dam that the sun warms or the water loads: quadratic in
    /// height.
    Bending {
        /// Displacement of the crown along the outward normal, metres.
        crown_m: f64,
    },
    /// A joint opens: everything right of a line through the wall moves.
    Crack {
        /// Where the line crosses u = 0, metres along the face.
        along_m: f64,
        /// How far the line goes sideways per metre of height.
        slope: f64,
        /// Displacement of the right side: along, up, out, metres.
        d_m: [f64; 3],
    },
    /// Single stones that move on their own.
    Loose {
        /// Share of the stones, 0..1.
        share: f64,
        /// At least this many.
        at_least: usize,
        /// Smallest and largest displacement, metres, any direction (outwards more than inwards).
        shift_m: [f64; 2],
        /// Largest rotation, radians.
        rotation_rad: f64,
    },
    /// Every stone moves and turns a little on its own, about its middle; it does not count as loose.
    Own {
        /// Standard deviation of the displacement per axis, metres.
        shift_m: f64,
        /// Standard deviation of the rotation per axis, radians: unlike that of the neighbours.
        rotation_rad: f64,
    },
    /// What the adjustment assumes of walls beforehand, drawn ([`draw_motions`]); for walls of up to 200 stones.
    Assumed,
}

/// What one stone did, with its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueMotion {
    /// World frame: `p2 = second_from_first * p1`.
    pub second_from_first: Rigid3,
    /// Motion that it shares with its neighbours, at its middle, metres.
    pub shared: Vector3<f64>,
    /// Moves on its own.
    pub loose: bool,
}

/// The rigid motion of every stone. `seed`: which stones are loose, and how they move.
pub fn move_stones(wall: &Wall, motions: &[WallMotion], seed: u64) -> Vec<TrueMotion> {
    let mut moved: Vec<TrueMotion> = wall.stones.iter().map(|s| follow(wall, s, motions)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for motion in motions {
        match *motion {
            WallMotion::Loose {
                share,
                at_least,
                shift_m,
                rotation_rad,
            } => {
                let whole: Vec<usize> = (0..wall.stones.len()).filter(|&i| !wall.stones[i].edge).collect();
                let wanted = ((share * whole.len() as f64).round() as usize).max(at_least);
                for i in choose(&whole, wanted, &mut rng) {
                    loosen(&mut moved[i], &wall.stones[i], shift_m, rotation_rad, &mut rng);
                }
            }
            WallMotion::Own {
                shift_m,
                rotation_rad,
            } => {
                for (stone, motion) in wall.stones.iter().zip(&mut moved) {
                    let mut draw = |sd: f64| Vector3::from_fn(|_, _| sd * normal(&mut rng));
                    let (shift, turn) = (draw(shift_m), draw(rotation_rad));
                    motion.second_from_first *= about_middle(stone, shift, turn);
                }
            }
            WallMotion::Assumed => {
                let place = |s: &SimStone| {
                    let middle = s.world_from_stone.translation.vector;
                    (middle.into(), wall.face.frame(s.middle[0]).out)
                };
                let places: Vec<_> = wall.stones.iter().map(place).collect();
                let drawn = draw_motions(&places, &AdjustmentParams::default(), seed).unwrap_or_default();
                for ((stone, motion), drawn) in wall.stones.iter().zip(&mut moved).zip(drawn) {
                    motion.second_from_first *= about_middle(stone, drawn.displacement, drawn.rotation);
                    motion.shared += drawn.shared;
                    motion.loose |= drawn.loose;
                }
            }
            _ => {}
        }
    }

    moved
}

/// Displacement that the motions prescribe for a place on the face, world frame, metres; loose stones apart.
pub fn shared_displacement(wall: &Wall, motions: &[WallMotion], a: f64, u: f64) -> Vector3<f64> {
    motions.iter().map(|m| displacement(wall, m, a, u, false)).sum()
}

fn displacement(wall: &Wall, motion: &WallMotion, a: f64, u: f64, without_breaks: bool) -> Vector3<f64> {
    let frame = wall.face.frame(a);
    let in_world = |d: [f64; 3]| frame.along * d[0] + frame.up * d[1] + frame.out * d[2];
    match motion {
        WallMotion::Translation { d_m } => Vector3::from(*d_m),
        WallMotion::Bulge {
            centre_m,
            depth_m,
            diameter_m,
        } => frame.out * (depth_m * cosine_squared(*centre_m, *diameter_m, [a, u])),
        WallMotion::Zone {
            centre_m,
            d_m,
            diameter_m,
        } => in_world(*d_m) * cosine_squared(*centre_m, *diameter_m, [a, u]),
        WallMotion::Settlement {
            from_m,
            to_m,
            depth_m,
        } => {
            let t = ((a - from_m) / (to_m - from_m)).clamp(0.0, 1.0);
            Vector3::new(0.0, 0.0, -depth_m * t)
        }
        WallMotion::Bending { crown_m } => {
            let t = (u / wall.params().height_m).max(0.0);
            frame.out * (crown_m * t * t)
        }
        WallMotion::Crack { along_m, slope, d_m } => {
            if without_breaks || a < along_m + slope * u {
                Vector3::zeros()
            } else {
                in_world(*d_m)
            }
        }
        WallMotion::Loose { .. } | WallMotion::Own { .. } | WallMotion::Assumed => Vector3::zeros(),
    }
}

/// 1 at the centre, 0 from half the diameter on.
fn cosine_squared(centre_m: [f64; 2], diameter_m: f64, place: [f64; 2]) -> f64 {
    let r = (place[0] - centre_m[0]).hypot(place[1] - centre_m[1]);
    if r < diameter_m / 2.0 {
        (PI * r / diameter_m).cos().powi(2)
    } else {
        0.0
    }
}

/// A stone follows the field at its middle, and turns with the field's gradient there.
fn follow(wall: &Wall, stone: &SimStone, motions: &[WallMotion]) -> TrueMotion {
    const STEP_M: f64 = 0.02;
    let [a, u] = stone.middle;
    let smooth =
        |a: f64, u: f64| -> Vector3<f64> { motions.iter().map(|m| displacement(wall, m, a, u, true)).sum() };
    let frame = wall.face.frame(a);
    let to_face = frame.face_from_world();
    let by_a = to_face * (smooth(a + STEP_M, u) - smooth(a - STEP_M, u)) / (2.0 * STEP_M);
    let by_u = to_face * (smooth(a, u + STEP_M) - smooth(a, u - STEP_M)) / (2.0 * STEP_M);
    let turn = Vector3::new(by_u.z, -by_a.z, 0.5 * (by_a.y - by_u.x));
    let shared = shared_displacement(wall, motions, a, u);
    TrueMotion {
        second_from_first: about_middle(stone, shared, to_face.transpose() * turn),
        shared,
        loose: false,
    }
}

fn loosen(
    motion: &mut TrueMotion,
    stone: &SimStone,
    shift_m: [f64; 2],
    rotation_rad: f64,
    rng: &mut ChaCha8Rng,
) {
    let mut direction = Vector3::from_fn(|_, _| normal(rng));
    let out = stone.world_from_stone * Vector3::z();
    let outwards = direction.dot(&out);
    if outwards < 0.0 {
        // The wall behind holds a stone back.
        direction -= 1.5 * outwards * out;
    }
    let shift = direction.normalize() * rng.random_range(shift_m[0]..=shift_m[1]);
    let axis = Vector3::from_fn(|_, _| normal(rng)).normalize();
    let turn = axis * (rotation_rad * rng.random::<f64>());
    let own = about_middle(stone, shift, turn);
    motion.second_from_first *= own;
    motion.loose = true;
}

/// The motion that turns a stone about its middle and then shifts it.
fn about_middle(stone: &SimStone, shift: Vector3<f64>, turn: Vector3<f64>) -> Rigid3 {
    let middle = stone.world_from_stone.translation.vector;
    let rotation = UnitQuaternion::from_scaled_axis(turn);
    Rigid3::from_parts(Translation3::from(middle + shift - rotation * middle), rotation)
}

/// `count` different entries, in the order they are drawn.
fn choose(from: &[usize], count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut pool = from.to_vec();
    (0..count.min(pool.len()))
        .map(|_| pool.swap_remove(rng.random_range(0..pool.len())))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::FacePoint;
    use crate::world::wall_params::WallParams;
    use nalgebra::Point3;

    fn wall() -> Wall {
        Wall::new(&WallParams {
            plan_radius_m: 50.0,
            ..WallParams::default()
        })
    }

    #[test]
    fn a_zone_that_creeps_out_of_the_wall_is_a_bulge() {
        let wall = wall();
        let (centre_m, depth_m, diameter_m) = ([0.2, 1.4], 0.05, 2.25);
        let bulge = WallMotion::Bulge {
            centre_m,
            depth_m,
            diameter_m,
        };
        let zone = WallMotion::Zone {
            centre_m,
            d_m: [0.0, 0.0, depth_m],
            diameter_m,
        };
        let moved = [zone, bulge].map(|motion| move_stones(&wall, &[motion], 1));
        for (zone, bulge) in moved[0].iter().zip(&moved[1]) {
            let apart = zone.second_from_first.to_homogeneous() - bulge.second_from_first.to_homogeneous();
            assert!(apart.norm() < 1e-12 && (zone.shared - bulge.shared).norm() < 1e-12);
        }
    }

    #[test]
    fn stones_follow_a_bulge_to_second_order() {
        let wall = wall();
        let (depth_m, diameter_m) = (0.05, 2.25);
        let bulge = WallMotion::Bulge {
            centre_m: [0.2, 1.4],
            depth_m,
            diameter_m,
        };
        // Largest second derivative of depth cos^2(pi r / diameter).
        let curvature = depth_m * 2.0 * (PI / diameter_m).powi(2);
        for (stone, motion) in wall.stones.iter().zip(move_stones(&wall, &[bulge], 1)) {
            let size = 0.08;
            for (da, du) in [(0.0, 0.0), (size, 0.0), (-size, 0.0), (0.0, size), (0.0, -size)] {
                let (a, u) = (stone.middle[0] + da, stone.middle[1] + du);
                let p = wall.face.world_of(&FacePoint { a, u, n: 0.0 });
                let r = (a - 0.2).hypot(u - 1.4);
                let size = if r < diameter_m / 2.0 {
                    depth_m * (PI * r / diameter_m).cos().powi(2)
                } else {
                    0.0
                };
                let error = motion.second_from_first * p - p - wall.face.frame(a).out * size;
                let allowed = 0.5 * curvature * (da * da + du * du)
                    + 3e-4 * f64::from(u8::from(da != 0.0 || du != 0.0));
                assert!(error.norm() <= allowed + 1e-9, "{} above {allowed}", error.norm());
            }
        }
    }

    #[test]
    fn own_motions_have_the_stated_size_about_each_middle() {
        let wall = wall();
        let own = WallMotion::Own {
            shift_m: 3e-4,
            rotation_rad: 1e-3,
        };
        let moved: Vec<TrueMotion> = (0..20)
            .flat_map(|seed| move_stones(&wall, std::slice::from_ref(&own), seed))
            .collect();
        let stones = wall.stones.iter().cycle();
        let (mut shifts, mut turns) = (0.0, 0.0);
        for (stone, motion) in stones.zip(&moved) {
            let middle = Point3::from(stone.world_from_stone.translation.vector);
            shifts += (motion.second_from_first * middle - middle).norm_squared();
            turns += motion.second_from_first.rotation.scaled_axis().norm_squared();
            assert!(!motion.loose && motion.shared.norm() == 0.0);
        }
        let per_axis = |sum: f64| (sum / (3 * moved.len()) as f64).sqrt();
        assert!(
            (per_axis(shifts) / 3e-4 - 1.0).abs() < 0.03,
            "{}",
            per_axis(shifts)
        );
        assert!((per_axis(turns) / 1e-3 - 1.0).abs() < 0.03, "{}", per_axis(turns));
    }

    #[test]
    fn causes_add_up_and_leave_the_other_side_of_a_crack_alone() {
        let wall = wall();
        let motions = [
            WallMotion::Translation {
                d_m: [0.0, 0.02, 0.05],
            },
            WallMotion::Crack {
                along_m: 0.0,
                slope: 0.0,
                d_m: [0.0, 0.01, 0.0],
            },
            WallMotion::Loose {
                share: 0.03,
                at_least: 1,
                shift_m: [0.005, 0.03],
                rotation_rad: 0.03,
            },
        ];
        let moved = move_stones(&wall, &motions, 5);
        let loose = moved.iter().filter(|m| m.loose).count();
        let whole = wall.stones.iter().filter(|s| !s.edge).count();
        assert_eq!(loose, (0.03 * whole as f64).round() as usize);
        for (stone, motion) in wall.stones.iter().zip(&moved) {
            let middle = Point3::from(stone.world_from_stone.translation.vector);
            let d = motion.second_from_first * middle - middle;
            let mut expected = Vector3::new(0.0, 0.02, 0.05);
            if stone.middle[0] >= 0.0 {
                expected += wall.face.frame(stone.middle[0]).up * 0.01;
            }
            let own = (d - expected).norm();
            if motion.loose {
                assert!((0.004..0.031).contains(&own), "{own}");
            } else {
                assert!(own < 1e-12 && motion.second_from_first.rotation.angle() < 1e-9);
            }
        }
    }
}
