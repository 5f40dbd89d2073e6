//! The joint distribution of the motions, from the last solution.

use super::candidate::Moving;
use super::estimate::Estimate;
use super::field::{information, stone_from_field};
use super::joint_motions::{JointMotions, JointStone, Pull};
use super::octaves::Octaves;
use super::solution::Solution;
use super::state::Adjustment;
use crate::linalg::{root, without_negative};
use crate::stone::{MotionFailure, PairResult};
use nalgebra::{Matrix3, Vector6};
use rayon::prelude::*;

/// The joint distribution as the last solution has it.
pub(super) fn joint_motions(
    adjustment: &Adjustment,
    solution: &Solution,
    results: &[PairResult],
    estimates: &[Result<Estimate, MotionFailure>],
    octaves: &Octaves,
) -> JointMotions {
    let one = octaves.one();
    let stone = |i: usize| {
        let motion = results[i].motion.as_ref().ok()?;
        let estimate = estimates[i].as_ref().ok()?;
        let node = &adjustment.prior.graph.nodes[i];
        let frame = node.face_from_world;
        let world = frame.transpose();
        let in_world = |m: &Matrix3<f64>| world * m * frame;
        let by_field = estimate.by_field * stone_from_field(&frame);
        let by_field = world * by_field.fixed_rows::<3>(0);
        let mut translation = estimate.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        // A slide of a single stone in the face belongs to its motion, not to the shape of the wall.
        let slide_m2 = adjustment.undetected_slide_m(i).powi(2);
        (0..2).for_each(|k| translation[(k, k)] -= estimate.p_tied * slide_m2);
        let translation = in_world(&translation);
        let field = by_field * solution.field.inverse.diagonal[i] * by_field.transpose();
        let mut own = without_negative(&(translation - field));
        let photos = adjustment.photo_part(i);
        let octave = match &photos {
            Some(photos) => photos.left_of(&one) + octaves.shown(&photos.least_error()),
            None => one,
        };
        own += in_world(&(octave + octaves.of_stone()));
        let by_poses = photos.iter().flat_map(|p| p.by_poses());
        let by_poses = by_poses.map(|(unknown, by)| (unknown, world * by)).collect();
        let common = adjustment.prior.common_in(i);
        let own_motion = Vector6::from(adjustment.prior.own_variances());
        let noise = octave + Matrix3::from_diagonal(&own_motion.fixed_rows::<3>(0));
        let observed = solution.equations[i].with_field.of_displacement(&noise);
        let vector = observed.1 + observed.0 * common.translation();
        Some(JointStone {
            id: results[i].first,
            place: node.centroid,
            face_from_world: frame,
            body: results[i].body,
            // Nor is a stone firm whose clouds show it elsewhere, whether they are right or not.
            is_loose: motion.loose || adjustment.stones[i].moving() == Moving::OnOwn,
            displacement: motion.displacement,
            by_field,
            own,
            octave: root(&in_world(&octave)),
            by_poses,
            observed: (in_world(&observed.0), world * vector),
        })
    };

    let graph = &adjustment.prior.graph;
    let stones: Vec<Option<JointStone>> = (0..results.len()).into_par_iter().map(stone).collect();
    let equations = solution.equations.iter().map(|e| &e.with_field);
    let (information, of_stones) = information(&adjustment.problem(equations));

    let pull = |i: usize| {
        let frame = graph.nodes[i].face_from_world;
        let of_points = adjustment.photo_part(i).map_or_else(Matrix3::identity, |photos| {
            frame.transpose() * photos.share_of_points() * frame
        });
        let followed = stones[i].as_ref().map_or_else(Matrix3::zeros, |stone| {
            Matrix3::identity() - stone.by_field.fixed_columns::<3>(0)
        });
        Pull {
            stone: results[i].first,
            on_field: of_stones[i].fixed_columns::<3>(0) * of_points,
            on_stone: followed * of_points,
        }
    };

    JointMotions {
        pulls: (0..results.len()).into_par_iter().map(pull).collect(),
        stones,
        edges: graph.edges.iter().map(|e| (e.low, e.high)).collect(),
        information,
        poses: octaves.of_poses(adjustment),
        octaves: adjustment.octaves(),
        step_m: adjustment.step_m().unwrap_or(f64::INFINITY),
    }
}
