//! Results against the motion that the project file prescribes.

use crate::pipeline::context::Context;
use crate::results::StoneRow;
use crate::results::records::Datum;
use crate::truth::outcome;
use nalgebra::{Point3, Vector3};
use stonewise_core::change::{ChangeField, ChangePoint};
use stonewise_core::cloud::GridIndex;
use stonewise_core::evaluate::{Evaluation, StoneOutcome, score_change, score_stones};
use stonewise_core::stone::Stone;

/// Scores stones, and M3C2 where there is any, of epoch `number` against its prescribed motion; `None`
/// where the project prescribes none.
///
/// The motion is that of the later epoch's points, as a function of where they were; a known motion of epoch
/// 1 is taken away from it.
pub fn evaluate(
    context: &Context,
    stones: &[Stone],
    rows: &[StoneRow],
    datum: &Datum,
    change: Option<&ChangeField>,
    number: usize,
) -> Option<Evaluation> {
    let epochs = &context.project.epochs;
    let (before, after) = (&epochs[0].motion, &epochs[number - 1].motion);
    if before.is_none() && after.is_none() {
        return None;
    }
    let at = |field: &Option<_>, p: &Point3<f64>| {
        field
            .as_ref()
            .map_or_else(Vector3::zeros, |f: &stonewise_core::evaluate::MotionField| {
                f.displacement_at(p)
            })
    };
    let truth = |p: &Point3<f64>| at(after, p) - at(before, p);
    let params = &context.project.settings.evaluate;
    let mut evaluation = Evaluation::new("the motion in the project file", params);
    let outcomes: Vec<StoneOutcome> = stones
        .iter()
        .zip(rows)
        .map(|(stone, row)| outcome(row, stone.normal, Some(datum)))
        .collect();
    evaluation.stones = Some(score_stones(&outcomes, truth, params));
    let index = GridIndex::new(&stones.iter().map(|s| s.centroid).collect::<Vec<_>>(), 0.5);
    let face = |p: &ChangePoint| {
        index
            .nearest(&p.position, 2.0)
            .map_or(p.normal, |(i, _)| stones[i].normal)
    };
    evaluation.m3c2 = change.map(|field| score_change(field, truth, face, params));
    Some(evaluation)
}
