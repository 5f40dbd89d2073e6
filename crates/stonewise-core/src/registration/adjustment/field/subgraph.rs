//! Parts of a large wall that stand for the whole where the whole would cost too much.

use super::graph::{Edge, Graph};
use super::problem::{FieldProblem, PhotoTerms};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeSet, VecDeque};

/// Walls up to this number of stones are used whole: below it an estimate of the variance components costs
/// less than the stones' own equations (about a second on two cores).
const WHOLE: usize = 600;
/// Connected parts at fixed places. They lie apart, so that one odd corner of the wall does not decide.
const SPREAD_PARTS: usize = 3;
/// Parts where motions of neighbours differ most, relative to their uncertainty. Components estimated only
/// where nothing moves would make the ties so stiff that stones of a bulge elsewhere would be called loose.
const STRAINED_PARTS: usize = 2;
/// Stones in each part: 600 in all determine the components to a tenth.
const PART_STONES: usize = 120;

/// The displacement of a stone as it is known so far, world.
#[derive(Clone, Copy)]
pub(crate) struct Displacement {
    /// Metres.
    pub mean: Vector3<f64>,
    /// Covariance by the stone's own points, m^2.
    pub covariance: Matrix3<f64>,
}

/// Some connected parts of a graph, with their place in the whole.
pub(crate) struct Subgraph {
    graph: Graph,
    /// Index in the whole, per stone of the subgraph.
    stones: Vec<usize>,
    /// Index in the whole, per edge of the subgraph.
    edges: Vec<usize>,
}

impl Subgraph {
    /// Whether a graph is too large to be used whole.
    pub fn is_needed(graph: &Graph) -> bool {
        graph.nodes.len() > WHOLE
    }

    /// `displacements`: of the stones as they are known so far. `None` where the graph is small enough to be
    /// used whole.
    pub fn new(graph: &Graph, displacements: &[Displacement]) -> Option<Self> {
        if !Self::is_needed(graph) {
            return None;
        }
        Self::of(graph, chosen(graph, displacements))
    }

    /// These stones, ascending, with the ties between them. `None` where memory does not suffice.
    pub fn of(graph: &Graph, stones: Vec<usize>) -> Option<Self> {
        let place = |i: usize| stones.binary_search(&i).ok();
        let mut edges = Vec::new();
        let mut inner = Vec::new();
        for (e, edge) in graph.edges.iter().enumerate() {
            if let (Some(low), Some(high)) = (place(edge.low), place(edge.high)) {
                edges.push(e);
                inner.push(Edge {
                    low,
                    high,
                    ..edge.clone()
                });
            }
        }
        let nodes = stones.iter().map(|&i| graph.nodes[i].clone()).collect();
        Some(Self {
            graph: Graph::from_parts(nodes, inner)?,
            stones,
            edges,
        })
    }

    /// Number of a stone of the whole in the subgraph.
    pub fn place(&self, stone: usize) -> Option<usize> {
        self.stones.binary_search(&stone).ok()
    }

    /// The problem on the subgraph alone.
    pub fn restrict<'a>(&'a self, whole: &FieldProblem<'a>) -> FieldProblem<'a> {
        FieldProblem {
            graph: &self.graph,
            stones: self.stones.iter().map(|&i| whole.stones[i]).collect(),
            ties: self.edges.iter().map(|&e| whole.ties[e]).collect(),
            least: self.stones.iter().map(|&i| whole.least[i]).collect(),
            components: whole.components,
            loose: whole.loose,
            photos: whole.photos.as_ref().map(|photos| PhotoTerms {
                stones: self.stones.iter().map(|&i| photos.stones[i]).collect(),
            }),
        }
    }
}

/// Stones of all parts, ascending: each part grows from a stone along the edges, breadth first.
fn chosen(graph: &Graph, displacements: &[Displacement]) -> Vec<usize> {
    let count = graph.nodes.len();
    let next = graph.neighbours();
    let mut chosen = BTreeSet::new();
    for part in 0..SPREAD_PARTS {
        chosen.extend(grown(&next, count * (2 * part + 1) / (2 * SPREAD_PARTS)));
    }
    let departures = departures(&next, displacements);
    for _ in 0..STRAINED_PARTS {
        let free = (0..count).filter(|i| !chosen.contains(i));
        if let Some(seed) = free.max_by(|a, b| departures[*a].total_cmp(&departures[*b])) {
            chosen.extend(grown(&next, seed));
        }
    }
    chosen.into_iter().collect()
}

fn grown(next: &[Vec<usize>], seed: usize) -> BTreeSet<usize> {
    let mut queue = VecDeque::from([seed]);
    let mut reached = BTreeSet::from([seed]);
    while let Some(i) = queue.pop_front().filter(|_| reached.len() < PART_STONES) {
        queue.extend(next[i].iter().copied().filter(|&j| reached.insert(j)));
    }
    reached
}

/// By how much stones depart from the mean of their neighbours, squared, over the variance of this departure:
/// the median over each stone and its neighbours, so that a single stone that is loose or wrong does not
/// count. Without the variance, noisy stones at the far end of a wall would hide a bulge.
fn departures(next: &[Vec<usize>], displacements: &[Displacement]) -> Vec<f64> {
    let own: Vec<f64> = next
        .iter()
        .zip(displacements)
        .map(|(neighbours, here)| {
            let share = (neighbours.len().max(1) as f64).recip();
            let around = neighbours.iter().map(|&j| &displacements[j]);
            let (mut apart, mut covariance) = (here.mean, here.covariance);
            for other in around {
                apart -= other.mean * share;
                covariance += other.covariance * (share * share);
            }
            covariance
                .try_inverse()
                .map_or(0.0, |inverse| apart.dot(&(inverse * apart)))
        })
        .collect();
    let around = |(i, neighbours): (usize, &Vec<usize>)| {
        let mut values: Vec<f64> = neighbours.iter().map(|&j| own[j]).chain([own[i]]).collect();
        upper_median(&mut values).unwrap_or(0.0)
    };
    next.iter().enumerate().map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::component_estimate::deviance;
    use crate::registration::adjustment::field::testing::SmallWall;
    use crate::registration::adjustment::field::variance_components::VarianceComponents;

    fn at_rest(wall: &SmallWall) -> Vec<Displacement> {
        let still = Displacement {
            mean: Vector3::zeros(),
            covariance: Matrix3::identity() * 1e-6,
        };
        vec![still; wall.graph.nodes.len()]
    }

    #[test]
    fn a_small_wall_is_used_whole() {
        let wall = SmallWall::new(30, 20, 1);
        assert!(Subgraph::new(&wall.graph, &at_rest(&wall)).is_none());
    }

    #[test]
    fn a_bulge_anywhere_is_among_the_parts_and_a_loose_stone_draws_none() {
        let wall = SmallWall::new(60, 30, 1);
        for centre in [[0.6, 0.6], [17.0, 5.2], [9.0, 0.3]] {
            let depth = |p: &nalgebra::Point3<f64>| {
                let r = (p.y - centre[0]).hypot(p.z - centre[1]);
                if r < 1.0 {
                    0.01 * (0.5 * std::f64::consts::PI * r).cos().powi(2)
                } else {
                    0.0
                }
            };
            let mut displacements = at_rest(&wall);
            for (displacement, node) in displacements.iter_mut().zip(&wall.graph.nodes) {
                displacement.mean.x = depth(&node.centroid);
            }
            displacements[900].mean.z += 0.03;
            let part = Subgraph::new(&wall.graph, &displacements).unwrap();
            let bulged: Vec<usize> = (0..1800)
                .filter(|&i| depth(&wall.graph.nodes[i].centroid) > 0.002)
                .collect();
            let covered = bulged.iter().filter(|i| part.stones.contains(i)).count();
            assert!(
                2 * covered > bulged.len(),
                "{centre:?}: {covered} of {}",
                bulged.len()
            );
        }
        let mut displacements = at_rest(&wall);
        displacements[900].mean.z = 0.03;
        let next = wall.graph.neighbours();
        let around = departures(&next, &displacements);
        let most = around.iter().copied().fold(0.0, f64::max);
        // A hundred standard deviations of a departure of 1 cm.
        assert!(most < 100.0, "{most}");
    }

    #[test]
    fn noisy_stones_do_not_hide_a_bulge() {
        let wall = SmallWall::new(60, 30, 1);
        let mut displacements = at_rest(&wall);
        let is_noisy = |p: &nalgebra::Point3<f64>| p.y > 14.0;
        let is_bulged = |p: &nalgebra::Point3<f64>| (p.y - 6.3).hypot(p.z - 2.4) < 1.0;
        for (i, node) in wall.graph.nodes.iter().enumerate() {
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            if is_noisy(&node.centroid) {
                displacements[i].mean.y = 0.01 * sign;
                displacements[i].covariance = Matrix3::identity() * 1e-4;
            } else if is_bulged(&node.centroid) {
                displacements[i].mean.x = 0.004 * sign;
            }
        }
        let part = Subgraph::new(&wall.graph, &displacements).unwrap();
        let bulged: Vec<usize> = (0..1800)
            .filter(|&i| is_bulged(&wall.graph.nodes[i].centroid))
            .collect();
        let covered = bulged.iter().filter(|i| part.stones.contains(i)).count();
        assert!(2 * covered > bulged.len(), "{covered} of {}", bulged.len());
    }

    #[test]
    fn a_large_wall_is_represented_by_connected_parts_of_itself() {
        let wall = SmallWall::new(40, 30, 1);
        let whole = wall.problem(0.9);
        let part = Subgraph::new(&wall.graph, &at_rest(&wall)).unwrap();
        let count = part.stones.len();
        assert!(
            (PART_STONES..=(SPREAD_PARTS + STRAINED_PARTS) * (PART_STONES + 8)).contains(&count),
            "{count}"
        );
        let restricted = part.restrict(&whole);
        // Edges join the same stones as in the whole, and all edges among the chosen stones are there.
        for (edge, &e) in part.graph.edges.iter().zip(&part.edges) {
            let original = &wall.graph.edges[e];
            assert_eq!(
                [part.stones[edge.low], part.stones[edge.high]],
                [original.low, original.high]
            );
        }
        let inside = |i: usize| part.stones.contains(&i);
        let among = wall
            .graph
            .edges
            .iter()
            .filter(|e| inside(e.low) && inside(e.high));
        assert_eq!(among.count(), part.edges.len());
        for (stone, &i) in restricted.stones.iter().zip(&part.stones) {
            assert!(std::ptr::eq(stone.equations, &wall.equations[i]));
        }
        // Every stone of a part is tied to others of it.
        let tied = part.graph.neighbours().iter().filter(|n| n.len() >= 2).count();
        assert_eq!(tied, count);
    }

    #[test]
    fn the_parts_prefer_the_same_components_as_the_whole() {
        let wall = SmallWall::new(36, 20, 5);
        let whole = wall.problem(1.0);
        let part = Subgraph::new(&wall.graph, &at_rest(&wall)).unwrap();
        let restricted = part.restrict(&whole);
        let start = VarianceComponents::start();
        let wide = VarianceComponents {
            drift: start.drift.map(|d| 5.0 * d),
            ..start
        };
        let gain = |problem: &FieldProblem| {
            let [narrow, wide] = [start, wide].map(|c| deviance(problem, &c).unwrap());
            (narrow - wide) / problem.stones.len() as f64
        };
        let (of_whole, of_part) = (gain(&whole), gain(&restricted));
        assert!((of_part / of_whole - 1.0).abs() < 0.15, "{of_whole} {of_part}");
    }
}
