//! Breaks of the wall: straight lines along which the motion jumps.
//!
//! A single tie between two stones says little where stones are noisy, and the field bends over a crack instead of breaking. A crack
//! has many ties, and all stones of either side speak for it: each line through the wall is tested as a whole.

use super::field::{Field, Jump};
use super::graph::Graph;
use nalgebra::Vector3;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::VecDeque;

/// A line through the wall on either side of which the stones move differently.
#[derive(Clone, Debug)]
pub(super) struct BreakLine {
    /// Per stone: on the side that moved.
    pub side: Vec<bool>,
    /// Motion of that side against the other, world, metres.
    pub jump: Vector3<f64>,
}

/// Directions in which lines are sought.
const DIRECTIONS: usize = 12;
/// Distance of parallel lines in median lengths of the ties.
const PITCH: f64 = 0.5;
/// Stones that a side needs; fewer are loose stones, not a side.
const SIDE_STONES: usize = 10;
/// Lines that are tested exactly: those over which the motion changes most.
const TESTED: usize = 150;
/// Probability of finding a line, anywhere, in a wall without one.
const FALSE_ALARM: f64 = 1e-4;
/// Smaller jumps are not told from how scans join, metres.
const SMALLEST_M: f64 = 1.5e-3;

/// Finds the most significant line; `None` where no line is beyond chance. `test` estimates the jumps of many ways to part the stones.
pub(super) fn find_line(
    graph: &Graph,
    field: &Field,
    parted: &[bool],
    test: impl Fn(&[Vec<bool>]) -> Option<Vec<Jump>>,
) -> Option<BreakLine> {
    let chart = unrolled(graph);
    let mut lengths: Vec<f64> = graph.edges.iter().map(|e| e.length_m).collect();
    let pitch = PITCH * super::survey::median(&mut lengths)?;
    let all: Vec<Line> = (0..DIRECTIONS)
        .flat_map(|k| parallel_lines(&chart, std::f64::consts::PI * k as f64 / DIRECTIONS as f64, pitch))
        .collect();
    let tried = all.len() as f64;
    let mut ranked: Vec<(f64, Line)> = all
        .into_iter()
        .map(|line| (change_across(graph, field, parted, &line.sides(&chart)), line))
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.truncate(TESTED);
    let first: Vec<Line> = ranked.into_iter().map(|r| r.1).collect();
    let (line, _) = best(&first, &chart, &test)?;
    let (line, found) = best(&line.neighbours(pitch), &chart, &test)?;
    let limit = ChiSquared::new(3.0).ok()?.inverse_cdf(1.0 - FALSE_ALARM / tried);
    (found.excess > limit && found.jump.norm() > SMALLEST_M).then(|| BreakLine {
        side: line.sides(&chart),
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
        let turn = std::f64::consts::PI / DIRECTIONS as f64;
        [0.0, -0.33, 0.33, -0.66, 0.66]
            .iter()
            .flat_map(|t| [0.0, -0.5, 0.5].map(|d| (t * turn, d * pitch)))
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

fn best(
    lines: &[Line],
    chart: &[[f64; 2]],
    test: impl Fn(&[Vec<bool>]) -> Option<Vec<Jump>>,
) -> Option<(Line, Jump)> {
    let sides: Vec<Vec<bool>> = lines.iter().map(|l| l.sides(chart)).collect();
    let jumps = test(&sides)?;
    let mut found: Option<(Line, Jump)> = None;
    for (line, jump) in lines.iter().zip(jumps) {
        if found.is_none_or(|(_, f)| jump.excess > f.excess) {
            found = Some((*line, jump));
        }
    }
    found
}

/// How much the motion changes over a line, for ranking: mean change over the ties that cross it, times the root of their number.
fn change_across(graph: &Graph, field: &Field, parted: &[bool], side: &[bool]) -> f64 {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for (edge, parted) in graph.edges.iter().zip(parted) {
        if side[edge.low] != side[edge.high] && !parted {
            let change = field.state[edge.high].fixed_rows::<3>(0) - field.state[edge.low].fixed_rows::<3>(0);
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
