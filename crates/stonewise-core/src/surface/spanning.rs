//! Consistent signs of normals over a surface.

use super::SurfaceCell;
use crate::geometry::{CellMap, cells_between};

/// Above this cosine, two neighbouring cells belong to one smooth surface and have like normals; below, they
/// meet at an edge.
const SMOOTH_COSINE: f64 = 0.5;

/// Groups of cells that touch each other, with normals of consistent signs within each group.
///
/// The signs follow a maximum spanning tree whose ties are the surer the more parallel the normals are (Hoppe,
/// DeRose, Duchamp, McDonald & Stuetzle 1992, section 3.3). Across an edge both cells have the other in front,
/// or both have it behind.
pub(super) fn consistent_groups(cells: &mut [SurfaceCell]) -> Vec<Vec<usize>> {
    let mut ties = ties_of(cells);
    ties.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.cells.cmp(&b.cells)));
    let mut forest = Forest::new(cells.len());
    for tie in ties {
        forest.join(tie.cells, tie.is_opposite);
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

struct Tie {
    cells: [usize; 2],
    weight: f64,
    /// Whether one of the two normals must be turned round.
    is_opposite: bool,
}

fn ties_of(cells: &[SurfaceCell]) -> Vec<Tie> {
    let mut at: CellMap<[i64; 3], Vec<usize>> = CellMap::default();
    for (i, cell) in cells.iter().enumerate() {
        at.entry(cell.cell).or_default().push(i);
    }
    let mut ties = Vec::new();
    for (i, cell) in cells.iter().enumerate() {
        let [low, high] = [-1, 1].map(|step| cell.cell.map(|c| c + step));
        for key in cells_between(low, high) {
            let others = at.get(&key).into_iter().flatten();
            ties.extend(others.filter(|&&j| j > i).map(|&j| Tie::new(cells, [i, j])));
        }
    }
    ties
}

impl Tie {
    fn new(cells: &[SurfaceCell], ends: [usize; 2]) -> Self {
        let [a, b] = ends.map(|i| &cells[i]);
        let cosine = a.normal.dot(&b.normal);
        let apart = b.centroid - a.centroid;
        let is_opposite = if cosine.abs() > SMOOTH_COSINE {
            cosine < 0.0
        } else {
            a.normal.dot(&apart) * b.normal.dot(&-apart) < 0.0
        };
        Self {
            cells: ends,
            weight: cosine.abs(),
            is_opposite,
        }
    }
}

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
