//! Parts of a large wall that stand for the whole where the whole would cost too much.

use super::graph::{Edge, Graph};
use super::problem::{FieldProblem, PhotoTerms};
use std::collections::{BTreeSet, VecDeque};

/// Walls up to this number of stones are used whole: below it an estimate of the variance components costs
/// less than the stones' own equations (about a second on two cores).
const WHOLE: usize = 600;
/// Connected parts. They lie apart, so that one odd corner of the wall does not decide.
const PARTS: usize = 4;
/// Stones in each part: 480 in all determine the components to a tenth.
const PART_STONES: usize = 120;

/// Some connected parts of a graph, with their place in the whole.
pub(crate) struct Subgraph {
    graph: Graph,
    /// Index in the whole, per stone of the subgraph.
    stones: Vec<usize>,
    /// Index in the whole, per edge of the subgraph.
    edges: Vec<usize>,
}

impl Subgraph {
    /// `None` where the graph is small enough to be used whole.
    pub fn new(graph: &Graph) -> Option<Self> {
        if graph.nodes.len() <= WHOLE {
            return None;
        }
        let stones = chosen(graph);
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

    /// The problem on the subgraph alone.
    pub fn restrict<'a>(&'a self, whole: &FieldProblem<'a>) -> FieldProblem<'a> {
        FieldProblem {
            graph: &self.graph,
            stones: self.stones.iter().map(|&i| whole.stones[i]).collect(),
            ties: self.edges.iter().map(|&e| whole.ties[e]).collect(),
            components: whole.components,
            loose: whole.loose,
            photos: whole.photos.as_ref().map(|photos| PhotoTerms {
                stones: self.stones.iter().map(|&i| photos.stones[i]).collect(),
            }),
        }
    }
}

/// Stones of all parts, ascending: each part grows from a stone along the edges, breadth first.
fn chosen(graph: &Graph) -> Vec<usize> {
    let count = graph.nodes.len();
    let next = graph.neighbours();
    let mut chosen = BTreeSet::new();
    for part in 0..PARTS {
        let seed = count * (2 * part + 1) / (2 * PARTS);
        let mut queue = VecDeque::from([seed]);
        let mut reached = BTreeSet::from([seed]);
        while let Some(i) = queue.pop_front().filter(|_| reached.len() < PART_STONES) {
            queue.extend(next[i].iter().copied().filter(|&j| reached.insert(j)));
        }
        chosen.extend(reached);
    }
    chosen.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::adjustment::field::component_estimate::deviance;
    use crate::registration::adjustment::field::testing::SmallWall;
    use crate::registration::adjustment::field::variance_components::VarianceComponents;

    #[test]
    fn a_small_wall_is_used_whole() {
        assert!(Subgraph::new(&SmallWall::new(30, 20, 1).graph).is_none());
    }

    #[test]
    fn a_large_wall_is_represented_by_connected_parts_of_itself() {
        let wall = SmallWall::new(40, 30, 1);
        let whole = wall.problem(0.9);
        let part = Subgraph::new(&wall.graph).unwrap();
        let count = part.stones.len();
        assert!(
            (PART_STONES..=PARTS * (PART_STONES + 8)).contains(&count),
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
        let part = Subgraph::new(&wall.graph).unwrap();
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
