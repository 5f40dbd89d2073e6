//! Consistent signs of normals over a surface.

use super::SurfaceCell;
use crate::geometry::{CellMap, cells_between};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

/// Above this cosine, two neighbouring cells belong to one smooth surface and have like normals; below, they
/// meet at an edge.
const SMOOTH_COSINE: f64 = 0.5;
/// Strength of the tie across an edge against that on a smooth surface: where a cell lies before or behind
/// another is less sure than how it lies.
const EDGE: f64 = 0.5;

/// Groups of cells that touch each other, with normals of consistent signs within each group.
///
/// Neighbouring cells are tied, the more strongly the more parallel their normals are (Hoppe, DeRose, Duchamp,
/// McDonald & Stuetzle 1992, section 3.3); across an edge both cells have the other in front, or both have it
/// behind. The two groups with the strongest ties are joined first, and all ties between two groups add up
/// (greedy additive contraction, Keuper et al. 2015), so that one false tie at an edge decides nothing.
pub(super) fn consistent_groups(cells: &mut [SurfaceCell]) -> Vec<Vec<usize>> {
    let mut ties = ties_of(cells);
    let mut queue: BinaryHeap<Tie> = BinaryHeap::new();
    for (a, of_a) in ties.iter().enumerate() {
        queue.extend(of_a.range(a..).map(|(b, tie)| Tie::new([a, *b], *tie)));
    }
    let mut forest = Forest::new(cells.len());
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
        forest.join([kept, taken], is_opposite);
    }
    let mut groups: CellMap<usize, Vec<usize>> = CellMap::default();
    for (i, cell) in cells.iter_mut().enumerate() {
        let (root, is_opposite) = forest.root(i);
        if is_opposite {
            *cell = cell.flipped();
        }
        groups.entry(root).or_default().push(i);
    }
    let mut groups: Vec<Vec<usize>> = groups.into_values().collect();
    groups.sort_by_key(|group| (std::cmp::Reverse(group.len()), group[0]));
    groups
}

/// The ties of each cell to others: positive where both normals are right or both are wrong.
fn ties_of(cells: &[SurfaceCell]) -> Vec<BTreeMap<usize, f64>> {
    let mut ties = vec![BTreeMap::new(); cells.len()];
    for (i, others) in neighbours(cells).into_iter().enumerate() {
        ties[i].extend(others.into_iter().map(|j| (j, tie_of(&cells[i], &cells[j]))));
    }
    ties
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
        let [low, high] = [-1, 1].map(|step| cell.cell.map(|c| c + step));
        let found = cells_between(low, high).flat_map(|key| at.get(&key).into_iter().flatten().copied());
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

/// Disjoint sets, each member with its sign relative to the root of its set.
struct Forest {
    parents: Vec<usize>,
    is_opposite: Vec<bool>,
}

impl Forest {
    fn new(count: usize) -> Self {
        Self {
            parents: (0..count).collect(),
            is_opposite: vec![false; count],
        }
    }

    /// The root of a member, and whether the member opposes it.
    fn root(&mut self, member: usize) -> (usize, bool) {
        let mut path = Vec::new();
        let mut at = member;
        while self.parents[at] != at {
            path.push(at);
            at = self.parents[at];
        }
        let mut is_opposite = false;
        for &i in path.iter().rev() {
            is_opposite ^= self.is_opposite[i];
            (self.parents[i], self.is_opposite[i]) = (at, is_opposite);
        }
        (at, is_opposite)
    }

    /// Joins the sets of two members, unless they are one already.
    fn join(&mut self, [a, b]: [usize; 2], is_opposite: bool) {
        let ((root_a, from_a), (root_b, from_b)) = (self.root(a), self.root(b));
        if root_a != root_b {
            self.parents[root_b] = root_a;
            self.is_opposite[root_b] = from_a ^ from_b ^ is_opposite;
        }
    }
}
