//! Which stones are neighbours, and the frame of the wall around each.

use super::pairs::PairPoints;
use crate::cloud::GridIndex;
use crate::geometry::FaceFrame;
use nalgebra::{Matrix3, Point3, Vector3};

/// A stone's place in the network.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub centroid: Point3<f64>,
    /// Takes world components to (along, up, out) of the wall around the stone.
    pub face_from_world: Matrix3<f64>,
}

/// Two neighbouring stones; `low < high`.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub low: usize,
    pub high: usize,
    /// From low to high along the face: horizontally and upward, metres.
    pub step: [f64; 2],
    pub length_m: f64,
    pub face_from_world: Matrix3<f64>,
}

/// The stones and who is next to whom; edges sorted by (low, high).
pub(super) struct Graph {
    pub nodes: Vec<Node>,
    pub edges: Vec<Edge>,
}

/// What the graph needs of a pair.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub centroid: Point3<f64>,
    pub normal: Vector3<f64>,
    /// How far the normal is to be trusted: the number of points, within limits.
    pub weight: f64,
}

impl From<&PairPoints> for Place {
    fn from(pair: &PairPoints) -> Self {
        Self {
            centroid: pair.centroid,
            normal: pair.normal,
            weight: (pair.points_first.len() as f64).clamp(1.0, 1000.0),
        }
    }
}

/// Stones whose normals are averaged into the wall's.
const FRAME_STONES: usize = 16;
/// Stones whose faces turn by more than this (35 degrees) are on different walls.
const SAME_WALL_COSINE: f64 = 0.82;
/// Reach of an edge in median spacings of the stones.
const REACH: f64 = 4.0;

impl Graph {
    /// Joins each stone with its nearest in each quadrant of the face, `per_quadrant` of them.
    pub fn new(places: &[Place], per_quadrant: usize) -> Self {
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
        let mut pairs = Vec::new();
        for (i, node) in nodes.iter().enumerate() {
            let mut taken = [0; 4];
            for (j, _) in index.nearest_k(&node.centroid, 64, REACH * spacing) {
                if j == i
                    || node.face_from_world.row(2).dot(&nodes[j].face_from_world.row(2)) < SAME_WALL_COSINE
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
        let edges = pairs
            .into_iter()
            .map(|(low, high)| edge(&nodes, low, high))
            .collect();
        Self { nodes, edges }
    }
}

fn edge(nodes: &[Node], low: usize, high: usize) -> Edge {
    let out = nodes[low].face_from_world.row(2) + nodes[high].face_from_world.row(2);
    let frame = FaceFrame::from_normal(&out.transpose()).face_from_world();
    let d = frame * (nodes[high].centroid - nodes[low].centroid);
    Edge {
        low,
        high,
        step: [d.x, d.y],
        length_m: d.xy().norm().max(0.02),
        face_from_world: frame,
    }
}

/// Median distance to the nearest other stone; 1 m where there is none.
fn median_spacing(points: &[Point3<f64>]) -> f64 {
    let Some(bounds) = crate::geometry::Bounds::of(points.iter().copied()) else {
        return 1.0;
    };
    let reach = (bounds.max - bounds.min).norm().max(1e-6);
    let guess = reach / (points.len() as f64).sqrt().max(1.0);
    let index = GridIndex::new(points, guess);
    let mut distances: Vec<f64> = points
        .iter()
        .filter_map(|p| index.nearest_k(p, 2, reach).get(1).map(|n| n.1.sqrt()))
        .collect();
    distances.sort_by(f64::total_cmp);
    distances
        .get(distances.len() / 2)
        .copied()
        .filter(|d| *d > 1e-3)
        .unwrap_or(1.0)
}

/// Frame of the wall: mean of the normals, around the stone, that agree with the one most others agree with.
///
/// A stone of few points has a normal of its own that means nothing; the wall around it has one.
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
        if support(a) > 1.5 * support(best) {
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
