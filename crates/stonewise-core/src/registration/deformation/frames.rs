//! The axes along which the deformation of each stone is told: along the wall, up and out.

use super::body::{Body, BodyStone};
use crate::geometry::FaceFrame;
use nalgebra::{Matrix3, Vector3};

/// Cosine of the angle to the vertical above which a face lies level, as on a step or a crest.
const LEVEL: f64 = 0.7;

/// Takes world components to along, up and out of the wall at each stone. Those of a level face are of the upright
/// wall around it, or of the whole body: what moves out of a level face rises. `next`: neighbours of each stone.
pub(super) fn frames(body: &Body, next: &[Vec<usize>]) -> Vec<Matrix3<f64>> {
    let out = |stone: &BodyStone| stone.joint.face_from_world.row(2).transpose();
    let is_level = |stone: &BodyStone| out(stone).z.abs() > LEVEL;
    let upright = |stones: &mut dyn Iterator<Item = &BodyStone>| {
        let sum: Vector3<f64> = stones.filter(|s| !is_level(s)).map(out).sum();
        Vector3::new(sum.x, sum.y, 0.0).try_normalize(0.0)
    };
    let of_body = upright(&mut body.stones.iter());
    let frame = |(stone, next): (&BodyStone, &Vec<usize>)| {
        let around = || upright(&mut next.iter().map(|&j| &body.stones[j])).or(of_body);
        match is_level(stone).then(around).flatten() {
            Some(out) => FaceFrame::from_normal(&out).face_from_world(),
            None => stone.joint.face_from_world,
        }
    };
    body.stones.iter().zip(next).map(frame).collect()
}
