//! Zones that creep: parts of the wall whose motion changes more from stone to stone than that of the rest.
//!
//! One drift and one strain hold for the whole wall. Where nearly all of it stands still they are small, and the field
//! smooths what a zone does: in the face, where a stone by itself shows little, most of it. Such a zone is found by what
//! its stones' own observations show together beyond the field, and gets a drift and a strain of its own.

use super::component_estimate::deviance;
use super::graph::Node;
use super::prior::Least;
use super::problem::FieldProblem;
use super::subgraph::Subgraph;
use crate::registration::bulges::{OUT, Shape, shapes};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

/// Probability of a zone, anywhere, in a wall that moves as its field says.
const FALSE_ALARM: f64 = 0.2;
/// Standard deviations up to which the residual of a stone counts: one stone in a hundred has more by chance (chi-square,
/// three degrees of freedom; Huber 1964), so that no single stone makes a zone.
const LARGEST_RESIDUAL: f64 = 3.368;
/// Deviance that a drift and a strain of its own must gain: odds of 150 to 1.
const LEAST_GAIN: f64 = 10.0;
/// Drifts per square root metre and strains that are tried, up to their bounds.
const DRIFTS: [f64; 5] = [1e-3, 3e-3, 1e-2, 3e-2, 0.1];
const STRAINS: [f64; 4] = [1e-3, 3e-3, 1e-2, 3e-2];
/// Radii of the zone that are tried, in diameters of the bulge: the bulge that is most significant lies where stones show
/// most.
const RADII: [f64; 3] = [0.5, 0.75, 1.0];
/// Radius of the zone and its surroundings whose likelihood decides, in diameters of the bulge.
const REACH: f64 = 1.5;

/// What a stone's own observations show of its displacement beyond the field, in its frame: information and vector.
pub(crate) struct LeftOver {
    pub information: Matrix3<f64>,
    pub vector: Vector3<f64>,
}

impl LeftOver {
    /// Huber weight of its residual: 1 up to the limit, then the limit over the residual.
    fn share(&self) -> f64 {
        let covariance = self.information.try_inverse().unwrap_or_else(Matrix3::zeros);
        let squared = self.vector.dot(&(covariance * self.vector)).max(0.0);
        LARGEST_RESIDUAL / squared.sqrt().max(LARGEST_RESIDUAL)
    }
}

/// The stones of the zone that most probably creeps, and the least that is assumed of the motion around them; `None`
/// where no zone is beyond chance.
///
/// `problem`: as the variance components are estimated from it. `left_over`: of each stone that is observed.
pub(crate) fn creeping_zone(
    problem: &FieldProblem,
    left_over: &[Option<LeftOver>],
) -> Option<(Vec<usize>, Least)> {
    let shares: Vec<f64> = left_over
        .iter()
        .map(|l| l.as_ref().map_or(1.0, LeftOver::share))
        .collect();
    let (shape, direction) = most_likely(&problem.graph.nodes, left_over, &shares)?;
    loosened(problem, &shape, usize::from(direction == OUT), &shares)
}

/// The bulge that the stones show most significantly, and its direction: along, up or out.
fn most_likely(nodes: &[Node], left_over: &[Option<LeftOver>], shares: &[f64]) -> Option<(Shape, usize)> {
    let observed: Vec<usize> = (0..nodes.len()).filter(|&i| left_over[i].is_some()).collect();
    let shapes = shapes(&observed, |i| nodes[i].centroid);
    let largest = |shape: &Shape| {
        let (mut score, mut variance) = (Vector3::zeros(), Vector3::zeros());
        for (i, by) in &shape.stones {
            if let Some(left) = &left_over[*i] {
                score += left.vector * (by * shares[*i]);
                variance += left.information.diagonal() * (by * by);
            }
        }
        let z = |k: usize| score[k].abs() / variance[k].max(f64::MIN_POSITIVE).sqrt();
        let k = (0..3).max_by(|a, b| z(*a).total_cmp(&z(*b))).unwrap_or(OUT);
        (z(k), k)
    };
    let all: Vec<(f64, usize)> = shapes.par_iter().map(largest).collect();
    let tested = 3.0 * shapes.len() as f64;
    let (place, (z, direction)) = all
        .into_iter()
        .enumerate()
        .max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let p = 2.0 * tested * Normal::standard().sf(z);
    let shape = shapes.into_iter().nth(place)?;
    (p < FALSE_ALARM).then_some((shape, direction))
}

/// The most likely extent of a zone, with its drift and strain in the face (0) or out of it (1); `None` where they are
/// not much more likely than those of the wall.
fn loosened(
    problem: &FieldProblem,
    shape: &Shape,
    across: usize,
    shares: &[f64],
) -> Option<(Vec<usize>, Least)> {
    let graph = problem.graph;
    let within = |radius: f64| -> Vec<usize> {
        let is_near =
            |i: &usize| (graph.nodes[*i].centroid - shape.middle).norm() < radius * shape.diameter_m;
        (0..graph.nodes.len()).filter(is_near).collect()
    };
    let mut weighed = problem.clone();
    for (stone, share) in weighed.stones.iter_mut().zip(shares) {
        // The square bounds what a stone adds to the gain of a zone.
        stone.p_with_field = share * share;
    }
    let part = Subgraph::of(graph, within(REACH))?;
    let problem = part.restrict(&weighed);

    let likelihood = |stones: &[usize], least: &Least| {
        let mut problem = problem.clone();
        for place in stones.iter().filter_map(|i| part.place(*i)) {
            problem.least[place] = problem.least[place].larger(least);
        }
        deviance(&problem, &problem.components)
    };

    let now = likelihood(&[], &Least::default())?;
    let zones = RADII.map(within);
    let mut tried = Vec::new();

    for stones in &zones {
        for (drift, strain) in DRIFTS.into_iter().flat_map(|d| STRAINS.map(|s| (d, s))) {
            let mut least = Least::default();
            (least.drift[across], least.strain[across]) = (drift, strain);
            tried.push((stones, least));
        }
    }

    let found: Vec<Option<f64>> = tried
        .par_iter()
        .map(|(stones, least)| likelihood(stones, least))
        .collect();
    let (zone, deviance) = tried
        .into_iter()
        .zip(found)
        .filter_map(|(zone, deviance)| Some((zone, deviance?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    (now - deviance > LEAST_GAIN).then(|| (zone.0.clone(), zone.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::Field;
    use crate::registration::adjustment::field::solve::solve;
    use crate::registration::adjustment::field::testing::SmallWall;
    use crate::registration::adjustment::field::variance_components::VarianceComponents;
    use crate::registration::adjustment::observation::NormalEquations;
    use crate::registration::adjustment::stone_vector::StoneVector;
    use nalgebra::{Matrix6, Vector6};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::PI;

    const COLUMNS: usize = 14;
    /// Standard deviation of what a stone shows of its motion, metres.
    const SD_M: f64 = 5e-4;

    /// Stones observed with noise; `motion`: of a stone in its frame, by its column and row, metres.
    fn wall(seed: u64, motion: impl Fn(f64, f64) -> Vector3<f64>) -> SmallWall {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut wall = SmallWall::new(COLUMNS as u32, 10, 1);
        let weight = 1.0 / (SD_M * SD_M);
        let weights = Vector6::from([weight, weight, weight, 1e4, 1e4, 1e4]);
        for (k, equations) in wall.equations.iter_mut().enumerate() {
            let noise = Vector3::from_fn(|_, _| SD_M * stonewise_testing::normal(&mut rng));
            let moved = motion((k % COLUMNS) as f64, (k / COLUMNS) as f64) + noise;
            equations.information = Matrix6::from_diagonal(&weights);
            equations.vector = equations.information * StoneVector::from_translation(moved).unknowns();
        }
        wall
    }

    /// The problem of a wall most of which stands still.
    fn problem(wall: &SmallWall) -> FieldProblem<'_> {
        FieldProblem {
            components: VarianceComponents {
                drift: [1e-4; 2],
                strain: [1e-4; 2],
                own_m: 2e-6,
                error_m: 2e-6,
                ..VarianceComponents::start()
            },
            ..wall.problem(1.0)
        }
    }

    fn left_over(wall: &SmallWall, field: &Field) -> Vec<Option<LeftOver>> {
        let of_stone = |(i, equations): (usize, &NormalEquations)| {
            let information = equations.information.fixed_view::<3, 3>(0, 0).into_owned();
            let moved = wall.graph.nodes[i].face_from_world * field.state[i].displacement();
            let vector = equations.vector.fixed_rows::<3>(0) - information * moved;
            Some(LeftOver { information, vector })
        };
        wall.equations.iter().enumerate().map(of_stone).collect()
    }

    fn found(wall: &SmallWall) -> Option<(Vec<usize>, Least)> {
        let problem = problem(wall);
        creeping_zone(&problem, &left_over(wall, &solve(&problem).unwrap()))
    }

    /// A part of the wall goes up by 1.5 mm where it moves most.
    fn creep(column: f64, row: f64) -> Vector3<f64> {
        let r = (0.3 * (column - 7.0)).hypot(0.2 * (row - 5.0));
        let share = if r < 0.8 {
            (PI * r / 1.6).cos().powi(2)
        } else {
            0.0
        };
        Vector3::new(0.0, 1.5e-3 * share, 0.0)
    }

    #[test]
    fn a_zone_that_creeps_gets_a_drift_of_its_own_in_the_face_alone() {
        let wall = wall(1, creep);
        let (stones, least) = found(&wall).unwrap();
        assert!(least.drift[0] > 0.0 && least.strain[0] > 0.0, "{least:?}");
        assert_eq!((least.drift[1], least.strain[1]), (0.0, 0.0));
        let moves = |i: &usize| creep((i % COLUMNS) as f64, (i / COLUMNS) as f64).y > 5e-4;
        let all = (0..140).filter(moves).count();
        assert!(
            stones.iter().filter(|i| moves(i)).count() > 4 * all / 5,
            "{stones:?}"
        );
        assert!(stones.len() < 80, "{}", stones.len());
        // With it the field follows the zone.
        let shown = |problem: &FieldProblem| {
            let field = solve(problem).unwrap();
            let (mut shown, mut square) = (0.0, 0.0);
            for (i, node) in wall.graph.nodes.iter().enumerate() {
                let by = creep((i % COLUMNS) as f64, (i / COLUMNS) as f64).y;
                shown += by * (node.face_from_world * field.state[i].displacement()).y;
                square += by * by;
            }
            shown / square
        };
        let mut problem = problem(&wall);
        let before = shown(&problem);
        for i in stones {
            problem.least[i] = least;
        }
        let after = shown(&problem);
        assert!(before < 0.25 && after > 0.7, "{before} {after}");
    }

    #[test]
    fn a_still_wall_has_no_zone_and_a_single_stone_is_none() {
        for seed in 1..=20 {
            assert!(found(&wall(seed, |_, _| Vector3::zeros())).is_none(), "{seed}");
        }
        let single = |column: f64, row: f64| {
            let is_it = (column, row) == (6.0, 4.0);
            Vector3::new(0.0, if is_it { 0.02 } else { 0.0 }, 0.0)
        };
        assert!(found(&wall(1, single)).is_none());
    }

    #[test]
    fn two_loose_stones_beside_each_other_are_no_zone() {
        let is_it = |column: f64, row: f64| row == 4.0 && (6.0..=7.0).contains(&column);
        let mut wall = wall(1, |column, row| {
            Vector3::new(0.0, 0.0, if is_it(column, row) { 0.02 } else { 0.0 })
        });
        // They are large: their standard deviation is a fifth of the others'.
        for (k, equations) in wall.equations.iter_mut().enumerate() {
            if is_it((k % COLUMNS) as f64, (k / COLUMNS) as f64) {
                equations.information *= 25.0;
                equations.vector *= 25.0;
            }
        }
        assert!(found(&wall).is_none());
    }

    #[test]
    fn a_zone_out_of_the_face_gets_a_drift_out_of_it() {
        let wall = wall(3, |column, row| Vector3::new(0.0, 0.0, creep(column, row).y));
        let (_, least) = found(&wall).unwrap();
        assert!(least.drift[0] == 0.0 && least.drift[1] > 0.0, "{least:?}");
    }
}
