//! Consistent signs of normals over a surface.

use super::SurfaceCell;
use crate::geometry::{CellMap, cells_around};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

/// Above this cosine, the normals of two neighbouring cells are nearly parallel; below, the cells meet at an edge.
const SMOOTH_COSINE: f64 = 0.5;
/// Above this one, both lie on one smooth part of a surface.
pub(super) const PART_COSINE: f64 = 0.8;
/// Strength of the tie across an edge against that on a smooth surface: where a cell lies before or behind
/// another is less sure than how it lies.
const EDGE: f64 = 0.5;

/// Ties of some things to others: positive where the signs of both are right or both are wrong.
pub(super) type Ties = Vec<BTreeMap<usize, f64>>;

/// Smooth parts of a surface, with normals of consistent signs within each part.
pub(super) struct Parts {
    /// The cells of each, the largest part first.
    pub members: Vec<Vec<usize>>,
    /// The part of each cell.
    pub of_cell: Vec<usize>,
    /// Ties between the parts.
    pub ties: Ties,
}

/// Divides a surface into smooth parts.
///
/// Neighbouring cells are tied, the more strongly the more parallel their normals are (Hoppe, DeRose, Duchamp,
/// McDonald & Stuetzle 1992, section 3.3); across an edge both cells have the other in front, or both have it
/// behind.
pub(super) fn smooth_parts(cells: &mut [SurfaceCell]) -> Parts {
    let neighbours = neighbours(cells);
    let mut smooth: Ties = vec![BTreeMap::new(); cells.len()];
    for (i, others) in neighbours.iter().enumerate() {
        let cosines = others.iter().map(|&j| (j, cells[i].normal.dot(&cells[j].normal)));
        smooth[i].extend(cosines.filter(|(_, cosine)| cosine.abs() > PART_COSINE));
    }

    let forest = contracted(smooth);
    let mut members: CellMap<usize, Vec<usize>> = CellMap::default();
    for (i, cell) in cells.iter_mut().enumerate() {
        let (root, is_opposite) = forest.root(i);
        if is_opposite {
            *cell = cell.flipped();
        }
        members.entry(root).or_default().push(i);
    }

    let mut members: Vec<Vec<usize>> = members.into_values().collect();
    members.sort_by_key(|part| (std::cmp::Reverse(part.len()), part[0]));
    let mut of_cell = vec![0; cells.len()];
    for (part, own) in members.iter().enumerate() {
        own.iter().for_each(|&i| of_cell[i] = part);
    }
    let mut ties: Ties = vec![BTreeMap::new(); members.len()];

    for (i, others) in neighbours.iter().enumerate() {
        for &j in others.iter().filter(|&&j| of_cell[j] != of_cell[i]) {
            *ties[of_cell[i]].entry(of_cell[j]).or_default() += tie_of(&cells[i], &cells[j]);
        }
    }

    Parts {
        members,
        of_cell,
        ties,
    }
}

/// Joins all that is tied. The two groups with the strongest tie are joined first, and all ties between two groups
/// add up (greedy additive contraction, Keuper et al. 2015), so that one false tie decides nothing.
pub(super) fn contracted(mut ties: Ties) -> Forest {
    let mut queue: BinaryHeap<Tie> = BinaryHeap::new();
    for (a, of_a) in ties.iter().enumerate() {
        queue.extend(of_a.range(a..).map(|(b, tie)| Tie::new([a, *b], *tie)));
    }
    let mut forest = Forest::new(ties.len());

    while let Some(Tie {
        strength,
        ends: [a, b],
    }) = queue.pop()
    {
        // Ties that have grown or shrunk since are in the queue once more.
        if ties[a].get(&b).is_none_or(|tie| tie.abs() != strength) {
            continue;
        }
        let [kept, taken] = if ties[a].len() < ties[b].len() {
            [b, a]
        } else {
            [a, b]
        };
        let of_taken = std::mem::take(&mut ties[taken]);
        let is_opposite = of_taken.get(&kept).is_some_and(|tie| *tie < 0.0);
        ties[kept].remove(&taken);
        for (other, tie) in of_taken.into_iter().filter(|(other, _)| *other != kept) {
            ties[other].remove(&taken);
            let sum = ties[kept].entry(other).or_default();
            *sum += if is_opposite { -tie } else { tie };
            let sum = *sum;
            ties[other].insert(kept, sum);
            queue.push(Tie::new([kept, other], sum));
        }
        forest.join([kept, taken], is_opposite, strength);
    }

    forest
}

fn tie_of(a: &SurfaceCell, b: &SurfaceCell) -> f64 {
    let cosine = a.normal.dot(&b.normal);
    if cosine.abs() > SMOOTH_COSINE {
        return cosine;
    }
    let apart = (b.centroid - a.centroid).try_normalize(0.0).unwrap_or_default();
    -EDGE * a.normal.dot(&apart) * b.normal.dot(&apart)
}

/// The cells around each of some cells.
pub(super) fn neighbours(cells: &[SurfaceCell]) -> Vec<Vec<usize>> {
    let mut at: CellMap<[i64; 3], Vec<usize>> = CellMap::default();
    for (i, cell) in cells.iter().enumerate() {
        at.entry(cell.cell).or_default().push(i);
    }
    let around = |(i, cell): (usize, &SurfaceCell)| {
        let found = cells_around(cell.cell).flat_map(|key| at.get(&key).into_iter().flatten().copied());
        found.filter(|j| *j != i).collect()
    };
    cells.iter().enumerate().map(around).collect()
}

/// The tie between two groups, the strongest first, of equal ones that of the lowest cells.
struct Tie {
    strength: f64,
    ends: [usize; 2],
}

impl Tie {
    fn new([a, b]: [usize; 2], tie: f64) -> Self {
        Self {
            strength: tie.abs(),
            ends: [a.min(b), a.max(b)],
        }
    }
}

impl Ord for Tie {
    fn cmp(&self, other: &Self) -> Ordering {
        self.strength
            .total_cmp(&other.strength)
            .then(other.ends.cmp(&self.ends))
    }
}

impl PartialOrd for Tie {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Tie {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Tie {}

/// Things that were joined, one after the other, with their signs relative to each other.
pub(super) struct Forest {
    nodes: Vec<Node>,
    joins: usize,
}

/// A thing, and its way to the root of its set.
struct Node {
    parent: usize,
    is_opposite: bool,
    /// When it was joined to its parent, and how strongly.
    joined: (usize, f64),
    size: usize,
}

impl Forest {
    fn new(count: usize) -> Self {
        let node = |parent| Node {
            parent,
            is_opposite: false,
            joined: (0, f64::INFINITY),
            size: 1,
        };
        Self {
            nodes: (0..count).map(node).collect(),
            joins: 0,
        }
    }

    /// The root of a member, and whether the member opposes it.
    pub(super) fn root(&self, member: usize) -> (usize, bool) {
        let way = self.way(member);
        let is_opposite = way
            .iter()
            .fold(false, |sign, at| sign ^ self.nodes[*at].is_opposite);
        (
            way.last().map_or(member, |at| self.nodes[*at].parent),
            is_opposite,
        )
    }

    /// The strength of the tie that joined the groups of two members; none where nothing joins them.
    pub(super) fn strength(&self, a: usize, b: usize) -> Option<f64> {
        let [of_a, of_b] = [a, b].map(|member| self.way(member));
        if self.root(a).0 != self.root(b).0 {
            return None;
        }
        // What both have in common was joined to the rest, not to each other.
        let common = of_a
            .iter()
            .rev()
            .zip(of_b.iter().rev())
            .take_while(|(a, b)| a == b)
            .count();
        let [own_a, own_b] = [&of_a, &of_b].map(|way| &way[..way.len() - common]);
        let joined = own_a.iter().chain(own_b).map(|at| self.nodes[*at].joined);
        Some(
            joined
                .max_by_key(|(time, _)| *time)
                .map_or(f64::INFINITY, |(_, strength)| strength),
        )
    }

    /// A member and what lies between it and the root.
    fn way(&self, member: usize) -> Vec<usize> {
        let up = |at: &usize| Some(self.nodes[*at].parent);
        let way = std::iter::successors(Some(member), up);
        way.take_while(|at| self.nodes[*at].parent != *at).collect()
    }

    /// Joins the sets of two members, unless they are one already.
    fn join(&mut self, [a, b]: [usize; 2], is_opposite: bool, strength: f64) {
        let ((root_a, from_a), (root_b, from_b)) = (self.root(a), self.root(b));
        if root_a == root_b {
            return;
        }
        self.joins += 1;
        let size = self.nodes[root_a].size + self.nodes[root_b].size;
        let [low, high] = match self.nodes[root_a].size < self.nodes[root_b].size {
            true => [root_a, root_b],
            false => [root_b, root_a],
        };
        self.nodes[high].size = size;
        self.nodes[low] = Node {
            parent: high,
            is_opposite: from_a ^ from_b ^ is_opposite,
            joined: (self.joins, strength),
            size,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_joined_by_the_sum_of_their_ties() {
        // 0 and 1 agree, 2 and 3 oppose each other; 0 and 2 seem to agree, two weaker ties are against it.
        let mut ties: Ties = vec![BTreeMap::new(); 5];
        for (a, b, tie) in [(0, 1, 9.0), (2, 3, -8.0), (0, 2, 3.0), (1, 2, -2.0), (1, 3, 2.5)] {
            ties[a].insert(b, tie);
            ties[b].insert(a, tie);
        }
        let forest = contracted(ties);
        let signs = [0, 1, 2, 3].map(|i| forest.root(i).1 != forest.root(0).1);
        assert_eq!(signs, [false, false, true, false]);
        assert_eq!(forest.strength(0, 1), Some(9.0));
        assert_eq!(forest.strength(3, 2), Some(8.0));
        assert!(
            [(0, 2), (1, 3), (3, 0)]
                .iter()
                .all(|&(a, b)| forest.strength(a, b) == Some(1.5))
        );
        assert_eq!(forest.strength(4, 0), None);
    }
}
