//! Cracks of the wall: straight lines along which the motion jumps.
//!
//! A single tie between two stones says little where stones are noisy, and the field bends over a crack
//! instead of breaking. A crack crosses many ties, and the stones of both sides bear on it: each line through
//! the wall is tested as a whole.

use super::graph::Graph;
use super::jump::{Jump, test_jumps};
use super::prior::Tie;
use super::problem::FieldProblem;
use super::solve::Field;
use crate::statistics::upper_median;
use nalgebra::Vector3;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::VecDeque;
use std::f64::consts::PI;

/// A line through the wall on either side of which the stones move differently.
#[derive(Clone, Debug)]
pub(crate) struct Crack {
    /// Per stone: on the side that moved.
    pub side: Vec<bool>,
    /// Motion of that side against the other, world, metres.
    pub jump: Vector3<f64>,
}

/// Directions in which lines are sought: 15 degrees apart, over a wall of 20 stones off by at most two and a
/// half stones at the ends, which the refinement ([`Line::neighbours`]) makes good.
const DIRECTIONS: usize = 12;
/// Distance of parallel lines in median lengths of the ties: every row of stones is parted from the next.
const PITCH: f64 = 0.5;
/// Stones that a side needs; fewer are loose stones, not a side.
const SIDE_STONES: usize = 10;
/// Lines that are tested exactly: those over which the motion changes most. Each costs three right-hand sides of a
/// solve.
const TESTED: usize = 150;
/// Probability of finding a line, anywhere, in a wall without one.
const FALSE_ALARM: f64 = 1e-4;
/// Turns, in steps between directions, by which the best line is refined.
const TURNS: [f64; 5] = [0.0, -0.33, 0.33, -0.66, 0.66];
/// Shifts, in steps between parallel lines, by which the best line is refined.
const SHIFTS: [f64; 3] = [0.0, -0.5, 0.5];

/// Finds the most significant line; `None` where no line is beyond chance.
///
/// `smallest_m`: the smallest jump between two sides that counts, metres.
pub(crate) fn find_crack(
    problem: &FieldProblem,
    field: &Field,
    smallest_m: impl Fn(&[bool]) -> f64,
) -> Option<Crack> {
    let graph = problem.graph;
    let chart = unrolled(graph);
    let mut lengths: Vec<f64> = graph.edges.iter().map(|e| e.length_m).collect();
    let pitch = PITCH * upper_median(&mut lengths)?;
    let all: Vec<Line> = (0..DIRECTIONS)
        .flat_map(|k| parallel_lines(&chart, PI * k as f64 / DIRECTIONS as f64, pitch))
        .collect();
    let tried = all.len() as f64;
    let mut ranked: Vec<(f64, Line)> = all
        .into_par_iter()
        .map(|line| {
            (
                change_across(graph, field, &problem.ties, &line.sides(&chart)),
                line,
            )
        })
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.truncate(TESTED);
    let first: Vec<Line> = ranked.into_iter().map(|r| r.1).collect();
    let (line, _) = most_significant(&first, &chart, problem)?;
    let (line, found) = most_significant(&line.neighbours(pitch), &chart, problem)?;
    let limit = ChiSquared::new(3.0).ok()?.inverse_cdf(1.0 - FALSE_ALARM / tried);
    let side = line.sides(&chart);
    let counts = found.excess > limit && found.jump.norm() > smallest_m(&side);
    counts.then_some(Crack {
        side,
        jump: found.jump,
    })
}

/// All points with this distance from the origin along a direction.
#[derive(Clone, Copy)]
struct Line {
    angle: f64,
    distance_m: f64,
}

impl Line {
    fn sides(&self, chart: &[[f64; 2]]) -> Vec<bool> {
        let (s, c) = self.angle.sin_cos();
        chart
            .iter()
            .map(|p| c * p[0] + s * p[1] > self.distance_m)
            .collect()
    }

    /// The line itself and those a little turned or shifted.
    fn neighbours(&self, pitch: f64) -> Vec<Self> {
        let turn = PI / DIRECTIONS as f64;
        TURNS
            .iter()
            .flat_map(|t| SHIFTS.map(|d| (t * turn, d * pitch)))
            .map(|(turn, shift)| Self {
                angle: self.angle + turn,
                distance_m: self.distance_m + shift,
            })
            .collect()
    }
}

/// Lines in one direction that part the stones differently, with enough stones on either side.
fn parallel_lines(chart: &[[f64; 2]], angle: f64, pitch: f64) -> Vec<Line> {
    let (s, c) = angle.sin_cos();
    let mut along: Vec<f64> = chart.iter().map(|p| c * p[0] + s * p[1]).collect();
    along.sort_by(f64::total_cmp);
    if along.len() < 2 * SIDE_STONES {
        return Vec::new();
    }
    let (low, high) = (along[SIDE_STONES - 1], along[along.len() - SIDE_STONES]);
    let mut last = 0;
    (0..((high - low) / pitch).max(0.0) as usize + 1)
        .filter_map(|k| {
            let distance_m = low + (k as f64 + 0.5) * pitch;
            let below = along.partition_point(|a| *a <= distance_m);
            let new = below > last && along.len() - below >= SIDE_STONES;
            last = below.max(last);
            new.then_some(Line { angle, distance_m })
        })
        .collect()
}

fn most_significant(lines: &[Line], chart: &[[f64; 2]], problem: &FieldProblem) -> Option<(Line, Jump)> {
    let sides: Vec<Vec<bool>> = lines.iter().map(|l| l.sides(chart)).collect();
    let jumps = test_jumps(problem, &sides)?;
    let mut found: Option<(Line, Jump)> = None;
    for (line, jump) in lines.iter().zip(jumps) {
        if found.is_none_or(|(_, f)| jump.excess > f.excess) {
            found = Some((*line, jump));
        }
    }
    found
}

/// How much the motion changes over a line, for ranking: mean change over the ties that cross it, times the
/// root of their number.
fn change_across(graph: &Graph, field: &Field, ties: &[Tie], side: &[bool]) -> f64 {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for (edge, tie) in graph.edges.iter().zip(ties) {
        if side[edge.low] != side[edge.high] && !tie.is_parted {
            let change = field.state[edge.high].displacement() - field.state[edge.low].displacement();
            sum += if side[edge.high] { change } else { -change };
            count += 1.0;
        }
    }
    sum.norm() / f64::max(count, 1.0).sqrt()
}

/// Places of the stones on the unrolled wall, metres: the steps of the ties added up from stone to stone.
fn unrolled(graph: &Graph) -> Vec<[f64; 2]> {
    let count = graph.nodes.len();
    let mut next = vec![Vec::new(); count];
    for edge in &graph.edges {
        next[edge.low].push((edge.high, edge.step));
        next[edge.high].push((edge.low, edge.step.map(|s| -s)));
    }
    let mut chart = vec![None; count];
    for start in 0..count {
        if chart[start].is_some() {
            continue;
        }
        chart[start] = Some([0.0; 2]);
        let mut queue = VecDeque::from([start]);
        while let Some(i) = queue.pop_front() {
            let here = chart[i].unwrap_or_default();
            for &(j, step) in &next[i] {
                if chart[j].is_none() {
                    chart[j] = Some([here[0] + step[0], here[1] + step[1]]);
                    queue.push_back(j);
                }
            }
        }
    }
    chart.into_iter().map(Option::unwrap_or_default).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::graph::Place;
    use crate::registration::adjustment::field::solve::solve;
    use crate::registration::adjustment::field::testing::SmallWall;
    use crate::registration::adjustment::stone_vector::StoneVector;
    use nalgebra::{Matrix6, Point3, Vector6};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Ten by six stones, each observed to 1 mm, on either side of a leaning line.
    fn wall(jump: Vector3<f64>, seed: u64) -> (SmallWall, Vec<bool>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut wall = SmallWall::new(10, 6, 1);
        let is_right = |p: &Point3<f64>| p.y > 1.3 + 0.4 * p.z;
        let side: Vec<bool> = wall.graph.nodes.iter().map(|n| is_right(&n.centroid)).collect();
        for (i, equations) in wall.equations.iter_mut().enumerate() {
            let frame = wall.graph.nodes[i].face_from_world;
            let mut noise = || 1e-3 * stonewise_testing::normal(&mut rng);
            let noise = Vector3::new(noise(), noise(), noise());
            let seen = frame * (if side[i] { jump } else { Vector3::zeros() }) + noise;
            let weights = [1e6, 1e6, 1e6, 1e3, 1e3, 1e3];
            equations.information = Matrix6::from_diagonal(&Vector6::from(weights));
            equations.vector = equations.information * StoneVector::from_translation(seen).unknowns();
        }
        (wall, side)
    }

    #[test]
    fn a_crack_is_found_along_its_line_with_its_jump() {
        let jump = Vector3::new(0.0, 0.006, 0.004);
        let (wall, side) = wall(jump, 1);
        let problem = wall.problem(1.0);
        let found = find_crack(&problem, &solve(&problem).unwrap(), |_| 0.0015).unwrap();
        let agreeing = found.side.iter().zip(&side).filter(|(a, b)| a == b).count();
        let (share, jump) = match agreeing > 30 {
            true => (agreeing, jump),
            false => (60 - agreeing, -jump),
        };
        assert!(share >= 58, "{share} of 60 stones on the right side");
        assert!((found.jump - jump).norm() < 1.5e-3, "{}", found.jump);
    }

    #[test]
    fn noise_alone_makes_no_crack() {
        for seed in 0..6 {
            let (wall, _) = wall(Vector3::zeros(), seed);
            let problem = wall.problem(1.0);
            assert!(find_crack(&problem, &solve(&problem).unwrap(), |_| 0.0).is_none());
        }
    }

    #[test]
    fn lines_part_the_stones_differently_and_leave_enough_on_either_side() {
        let chart: Vec<[f64; 2]> = (0..60)
            .map(|k| [0.3 * f64::from(k % 10), 0.2 * f64::from(k / 10)])
            .collect();
        for k in 0..DIRECTIONS {
            let lines = parallel_lines(&chart, PI * k as f64 / DIRECTIONS as f64, 0.1);
            let counts: Vec<usize> = lines
                .iter()
                .map(|l| l.sides(&chart).iter().filter(|s| **s).count())
                .collect();
            assert!(
                !counts.is_empty() && counts.windows(2).all(|c| c[0] > c[1]),
                "{counts:?}"
            );
            assert!(
                counts
                    .iter()
                    .all(|c| (SIDE_STONES..=60 - SIDE_STONES).contains(c))
            );
        }
    }

    #[test]
    fn a_round_wall_is_unrolled_to_its_length() {
        let radius_m = 5.0;
        let places: Vec<Place> = (0..48)
            .map(|k| {
                let angle = f64::from(k % 16) * 0.06;
                let normal = Vector3::new(angle.cos(), angle.sin(), 0.0);
                Place {
                    centroid: Point3::from(normal * radius_m + Vector3::z() * 0.3 * f64::from(k / 16)),
                    normal,
                    weight: 100.0,
                }
            })
            .collect();
        // The unrolling begins at the first stone; in the second order it also steps back along ties. 7 x 7 = 1 (mod 48).
        let mixed: Vec<Place> = (0..48).map(|i| places[7 * i % 48].clone()).collect();
        for (places, step) in [(&places, 1), (&mixed, 7)] {
            let chart = unrolled(&Graph::new(places, 2).unwrap());
            let at = |k: usize| chart[step * k % 48];
            let right = if at(15)[0] > at(0)[0] { 1.0 } else { -1.0 };
            for k in 0..48 {
                let along = right * (at(k)[0] - at(0)[0]);
                let expected = (k % 16) as f64 * 0.06 * radius_m;
                assert!(
                    (along - expected).abs() < 0.02,
                    "{k}: {along} instead of {expected}"
                );
                let up = at(k)[1] - at(0)[1];
                assert!((up - 0.3 * (k / 16) as f64).abs() < 1e-6, "{k}: {up}");
            }
        }
    }
}
