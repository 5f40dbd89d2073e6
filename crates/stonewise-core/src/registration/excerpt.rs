//! Parts of a large network that stand for the whole where the whole would cost too much.

use super::graph::Graph;
use super::sparse::BlockPattern;
use std::collections::{BTreeSet, VecDeque};

/// Networks up to this size are used whole.
const WHOLE: usize = 600;
/// Connected parts, and stones in each: enough that the components vary by a tenth.
const PARTS: usize = 4;
const PART_STONES: usize = 120;

/// Some connected parts of a graph, with their place in the whole.
pub(super) struct Excerpt {
    pub graph: Graph,
    pub pattern: BlockPattern,
    /// Index in the whole, per stone of the excerpt.
    pub stones: Vec<usize>,
    /// Index in the whole, per edge of the excerpt.
    pub edges: Vec<usize>,
}

impl Excerpt {
    /// `None` where the graph is small enough to be used whole.
    pub fn new(graph: &Graph) -> Option<Self> {
        let count = graph.nodes.len();
        if count <= WHOLE {
            return None;
        }
        let mut next = vec![Vec::new(); count];
        for edge in &graph.edges {
            next[edge.low].push(edge.high);
            next[edge.high].push(edge.low);
        }
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
        let stones: Vec<usize> = chosen.into_iter().collect();
        let place = |i: usize| stones.binary_search(&i).ok();
        let mut edges = Vec::new();
        let mut inner = Vec::new();
        for (e, edge) in graph.edges.iter().enumerate() {
            if let (Some(low), Some(high)) = (place(edge.low), place(edge.high)) {
                edges.push(e);
                inner.push(super::graph::Edge {
                    low,
                    high,
                    ..edge.clone()
                });
            }
        }
        let pairs: Vec<_> = inner.iter().map(|e| (e.low, e.high)).collect();
        let nodes = stones.iter().map(|&i| graph.nodes[i].clone()).collect();
        let pattern = BlockPattern::new(stones.len(), &pairs)?;
        Some(Self {
            graph: Graph { nodes, edges: inner },
            pattern,
            stones,
            edges,
        })
    }
}
