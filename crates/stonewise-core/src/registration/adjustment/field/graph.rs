//! Which stones are neighbours, and the frame of the wall around each.

use crate::cloud::GridIndex;
use crate::geometry::{Bounds, FaceFrame};
use crate::linalg::BlockPattern;
use crate::registration::points::PairPoints;
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Point3, Vector3};

/// A stone's place on the wall.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub centroid: Point3<f64>,
    /// Takes world components to (along, up, out) of the wall around the stone.
    pub face_from_world: Matrix3<f64>,
}

/// Two neighbouring stones; `low < high`.
#[derive(Clone, Debug)]
pub(crate) struct Edge {
    pub low: usize,
    pub high: usize,
    /// From low to high along the face: horizontally and upward, metres.
    pub step: [f64; 2],
    pub length_m: f64,
    pub face_from_world: Matrix3<f64>,
}

/// The stones and which are neighbours; edges sorted by (low, high). It does not change during the
/// adjustment.
pub(crate) struct Graph {
    pub nodes: Vec<Node>,
    pub edges: Vec<Edge>,
    /// Sparsity pattern of the equations of the field: nine unknowns a node.
    pub pattern: BlockPattern<9>,
}

/// What the graph needs of a pair.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub centroid: Point3<f64>,
    pub normal: Vector3<f64>,
    /// Weight of the normal among its neighbours': the number of points, within limits.
    pub weight: f64,
}

impl From<&PairPoints> for Place {
    fn from(pair: &PairPoints) -> Self {
        Self {
            centroid: pair.centroid,
            normal: pair.normal,
            weight: (pair.points_first.len() as f64).clamp(1.0, MOST_WEIGHT),
        }
    }
}

/// Most points that count for a normal: a stone of 1,000 points already shows its face, and one of 100,000
/// must not outvote all its neighbours.
const MOST_WEIGHT: f64 = 1000.0;
/// Stones whose normals are averaged into the wall's: two rings of neighbours, so that one leaning face does
/// not matter.
const FRAME_STONES: usize = 16;
/// Stones whose faces turn by more than this (35 degrees) are on different walls: an arch dam turns by a few
/// degrees from stone to stone, a corner by 90.
const SAME_WALL_COSINE: f64 = 0.82;
/// Reach of an edge in median spacings of the stones: across three missing ones.
const REACH: f64 = 4.0;
/// Nearest stones among which neighbours are sought: those within [`REACH`] on a regular wall.
const CANDIDATES: usize = 64;
/// Shortest length of a tie, metres: nearer centroids come from split masks, and a tie's stiffness grows with
/// the third power of the inverse.
const SHORTEST_M: f64 = 0.02;
/// A frame prevails over a stone's own if this many times more of its surroundings (by weight) agree with it.
const MAJORITY: f64 = 1.5;

impl Graph {
    /// Joins each stone with its nearest in each quadrant of the face, `per_quadrant` of them.
    ///
    /// `None` where memory does not suffice for the pattern of the equations.
    pub fn new(places: &[Place], per_quadrant: usize) -> Option<Self> {
        let points: Vec<Point3<f64>> = places.iter().map(|p| p.centroid).collect();
        let spacing = median_spacing(&points);
        let index = GridIndex::new(&points, 2.0 * spacing);
        let nodes: Vec<Node> = places
            .iter()
            .map(|p| Node {
                centroid: p.centroid,
                face_from_world: wall_frame(p, places, &index, spacing),
            })
            .collect();
        let pairs = neighbour_pairs(&nodes, &index, REACH * spacing, per_quadrant);
        let edges = pairs
            .into_iter()
            .map(|(low, high)| edge(&nodes, low, high))
            .collect();
        Self::from_parts(nodes, edges)
    }

    /// `edges` must be sorted by (low, high), without repeats.
    pub fn from_parts(nodes: Vec<Node>, edges: Vec<Edge>) -> Option<Self> {
        let pairs: Vec<(usize, usize)> = edges.iter().map(|e| (e.low, e.high)).collect();
        Some(Self {
            pattern: BlockPattern::new(nodes.len(), &pairs)?,
            nodes,
            edges,
        })
    }

    /// The neighbours of each stone, in the order of the edges.
    pub fn neighbours(&self) -> Vec<Vec<usize>> {
        let mut next = vec![Vec::new(); self.nodes.len()];
        for edge in &self.edges {
            next[edge.low].push(edge.high);
            next[edge.high].push(edge.low);
        }
        next
    }
}

/// Indices (low, high) of neighbours, sorted: each node and its nearest in each quadrant of the face,
/// `per_quadrant` of them.
fn neighbour_pairs(
    nodes: &[Node],
    index: &GridIndex,
    reach_m: f64,
    per_quadrant: usize,
) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let mut taken = [0; 4];
        for (j, _) in index.nearest_k(&node.centroid, CANDIDATES, reach_m) {
            if j == i || node.face_from_world.row(2).dot(&nodes[j].face_from_world.row(2)) < SAME_WALL_COSINE
            {
                continue;
            }
            let d = node.face_from_world * (nodes[j].centroid - node.centroid);
            if d.z.abs() > d.xy().norm() {
                continue;
            }
            // Quadrants turned by 45 degrees: left, right, above, below.
            let quadrant = usize::from(d.x + d.y > 0.0) + 2 * usize::from(d.x - d.y > 0.0);
            if taken[quadrant] < per_quadrant {
                taken[quadrant] += 1;
                pairs.push((i.min(j), i.max(j)));
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

fn edge(nodes: &[Node], low: usize, high: usize) -> Edge {
    let out = nodes[low].face_from_world.row(2) + nodes[high].face_from_world.row(2);
    let frame = FaceFrame::from_normal(&out.transpose()).face_from_world();
    let d = frame * (nodes[high].centroid - nodes[low].centroid);
    Edge {
        low,
        high,
        step: [d.x, d.y],
        length_m: d.xy().norm().max(SHORTEST_M),
        face_from_world: frame,
    }
}

/// Median distance to the nearest other stone; 1 m where there is none.
fn median_spacing(points: &[Point3<f64>]) -> f64 {
    let Some(bounds) = Bounds::of(points.iter().copied()) else {
        return 1.0;
    };
    let reach = (bounds.max - bounds.min).norm().max(1e-6);
    let guess = reach / (points.len() as f64).sqrt().max(1.0);
    let index = GridIndex::new(points, guess);
    let mut distances: Vec<f64> = points
        .iter()
        .filter_map(|p| index.nearest_k(p, 2, reach).get(1).map(|n| n.1.sqrt()))
        .collect();
    upper_median(&mut distances).filter(|d| *d > 1e-3).unwrap_or(1.0)
}

/// Frame of the wall: mean of the normals, around the stone, that agree with the one most others agree with.
///
/// The normal of a stone with few points is mostly noise, that of the wall around it is not.
fn wall_frame(place: &Place, places: &[Place], index: &GridIndex, spacing: f64) -> Matrix3<f64> {
    let mut around: Vec<&Place> = index
        .nearest_k(&place.centroid, FRAME_STONES, REACH * spacing)
        .into_iter()
        .map(|(j, _)| &places[j])
        .collect();
    if around.is_empty() {
        around.push(place);
    }
    let like = |a: &Place, b: &Place| a.normal.dot(&b.normal) > SAME_WALL_COSINE;
    let support = |a: &Place| {
        around
            .iter()
            .filter(|b| like(a, b))
            .map(|b| b.weight)
            .sum::<f64>()
    };
    let mut best = around[0];
    for a in &around[1..] {
        if support(a) > MAJORITY * support(best) {
            best = a;
        }
    }
    let sum: Vector3<f64> = around
        .iter()
        .filter(|b| like(best, b))
        .map(|b| b.normal * b.weight)
        .sum();
    FaceFrame::from_normal(&sum).face_from_world()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn place(centroid: Point3<f64>, normal: Vector3<f64>) -> Place {
        Place {
            centroid,
            normal,
            weight: 100.0,
        }
    }

    /// A wall facing x of stones 30 cm wide and 20 cm high, a little out of place and of plumb.
    fn wall(columns: u32, rows: u32) -> Vec<Place> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut off = move || rng.random_range(-0.02..0.02);
        (0..columns * rows)
            .map(|k| {
                let (y, z) = (0.3 * f64::from(k % columns), 0.2 * f64::from(k / columns));
                let centroid = Point3::new(off(), y + off(), z + off());
                place(centroid, Vector3::new(1.0, off(), off()).normalize())
            })
            .collect()
    }

    #[test]
    fn inner_stones_have_their_neighbours_on_all_sides() {
        let graph = Graph::new(&wall(8, 6), 1).unwrap();
        let next = graph.neighbours();
        for (k, near) in next.iter().enumerate() {
            let (column, row) = (k % 8, k / 8);
            if (1..7).contains(&column) && (1..5).contains(&row) {
                for neighbour in [k - 1, k + 1, k - 8, k + 8] {
                    assert!(near.contains(&neighbour), "{k} {neighbour}");
                }
            }
        }
        assert!(
            graph
                .edges
                .windows(2)
                .all(|e| (e[0].low, e[0].high) < (e[1].low, e[1].high))
        );
        for edge in &graph.edges {
            assert!(edge.low < edge.high);
            let frame = edge.face_from_world;
            let d = frame * (graph.nodes[edge.high].centroid - graph.nodes[edge.low].centroid);
            assert!((edge.length_m - d.xy().norm()).abs() < 1e-12);
            assert!((d.xy() - nalgebra::Vector2::from(edge.step)).norm() < 1e-12);
        }
    }

    #[test]
    fn edges_are_those_to_the_nearest_of_each_quadrant() {
        let per_quadrant = 2;
        let places = wall(7, 7);
        let graph = Graph::new(&places, per_quadrant).unwrap();
        let quadrant = |i: usize, j: usize| {
            let d = graph.nodes[i].face_from_world * (places[j].centroid - places[i].centroid);
            (d.x > -d.y, d.x > d.y)
        };
        let is_chosen = |i: usize, j: usize| {
            let distance = |k: usize| (places[k].centroid - places[i].centroid).norm();
            let nearer = (0..places.len())
                .filter(|&k| k != i && quadrant(i, k) == quadrant(i, j) && distance(k) < distance(j));
            nearer.count() < per_quadrant
        };
        // All of them lie within the reach of an edge.
        let count = places.len();
        let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        let expected: Vec<_> = pairs
            .filter(|&(i, j)| is_chosen(i, j) || is_chosen(j, i))
            .collect();
        let found: Vec<_> = graph.edges.iter().map(|e| (e.low, e.high)).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn walls_around_a_corner_are_not_tied() {
        let mut places = wall(5, 4);
        let side = wall(5, 4).into_iter().map(|p| {
            place(
                Point3::new(-0.15 - p.centroid.y, p.centroid.x - 0.15, p.centroid.z),
                Vector3::new(-p.normal.y, -p.normal.x, p.normal.z),
            )
        });
        places.extend(side);
        let graph = Graph::new(&places, 2).unwrap();
        assert!(!graph.edges.is_empty());
        assert!(graph.edges.iter().all(|e| (e.low < 20) == (e.high < 20)));
    }

    #[test]
    fn the_wall_around_a_stone_with_a_wrong_normal_gives_it_its_frame() {
        let mut places = wall(7, 5);
        places[17] = Place {
            normal: Vector3::new(0.1, 0.2, 1.0).normalize(),
            weight: 5.0,
            ..places[17].clone()
        };
        let graph = Graph::new(&places, 2).unwrap();
        assert!(graph.nodes[17].face_from_world[(2, 0)] > 0.99);
        assert!(graph.neighbours()[17].len() >= 6);
    }
}
